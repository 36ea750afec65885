# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of operation with ros2_control and with replayed recordings, on the real nodes."""

from contextlib import ExitStack
import time

from closed_loop import NAMES
from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import fault_bench, FaultBench, G, stamp_of
from fault_stimuli import shifted
from fault_table import fault
from lock_stepped_arm import lock_stepped
import numpy as np
import pytest
from ros2_control_standin import commanding, ros2_control
from ros_harness import KEEP_MANY, NodeProcess, RosClient, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState
from silent_clients import NodelessReader
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

GROUP = 'ros2_control and replayed recordings'

# ------------------------------------------------------------------ the drives of simulated_arm


@fault(GROUP, '`simulated_arm` receives 5,000 N·m on a joint with an effort limit of 60 N·m',
       '60 N·m act on the arm and are reported; a warning names joint, value, limit and '
       '`clip_efforts`; with `clip_efforts: false` 5,000 N·m act')
def test_an_effort_beyond_the_limit_is_clipped(client):
    with lock_stepped(client, '/clips', rate=500.0) as arm:
        clipped = arm.step([1.0, -5000.0])
        assert list(clipped.effort) == [1.0, -60.0]
        assert np.isfinite(clipped.position).all()
        line = arm.node.wait_for_log("Clipped the effort of 'joint2'")
        assert 'received -5000 N·m, its effort limit is 60 N·m (clip_efforts)' in line
        client.set_parameters('/clips/simulated_arm', {'clip_efforts': False})
        assert list(arm.step([0.0, 5000.0]).effort) == [0.0, 5000.0]


# ------------------------------------------------------------------ lock-step without commands


@fault(GROUP, '`lock_step` without a subscriber to `joint_states`; without a publisher of '
       '`effort_command`; with one that sends nothing; with other stamps, as from ros2_control',
       'within 1 s a warning names the reason, and `lock_step:=false` for the last two; simulated '
       'time advances with the first command that has the stamp of the state')
def test_lock_step_names_the_reason_why_it_gets_no_answer(client):
    with NodeProcess(
            SIMULATED_ARM, {'lock_step': True}, namespace='/unanswered',
            remaps={'/clock': '/unanswered/clock'}) as node:
        node.wait_for_log(
            r'lock_step: no effort for the joint state of 0\.002 s for [0-9.]+ s: '
            '/unanswered/joint_states has no subscriber')
        with client.collect(JointState, '/unanswered/joint_states', KEEP_MANY) as states:
            node.wait_for_log('/unanswered/effort_command has no publisher')
            publisher = client.publisher(JointState, '/unanswered/effort_command', 1)
            node.wait_for_log(
                'publisher of /unanswered/effort_command has sent no valid effort since.*'
                'use lock_step:=false behind ros2_control')
            effort = JointState(name=NAMES, effort=[0.0, 0.0])
            effort.header.stamp = stamp_of(time.time_ns())

            def is_named() -> bool:
                publisher.publish(effort)
                return 'lock_step needs efforts under the stamp of the state; use ' \
                    'lock_step:=false behind ros2_control' in node.log

            wait_until(is_named, 'a warning of other stamps')
            before = states.messages[-1].header.stamp
            effort.header.stamp = before
            client.ask(publisher, effort, states, lambda m: m.header.stamp != before)


# ------------------------------------------------------------------ replayed recordings


def has_replay_hint(status: DiagnosticStatus) -> bool:
    return '`ros2 bag play --clock`' in status.message and (
        '`use_sim_time:=true`' in status.message)


@fault(GROUP, 'joint states with stamps that are half an hour old, as from a replayed bag',
       'dropped as too old; log and diagnostics name `ros2 bag play --clock` and '
       '`use_sim_time:=true`; live states are answered and clear the hint')
def test_a_replayed_recording_is_recognised(client):
    with fault_bench(client, '/replayed', stream=False) as bench:
        bench.driver.stream_changed(shifted(-1800.0))
        status = bench.wait_status('joint states', has_replay_hint)
        assert status.level == DiagnosticStatus.ERROR
        line = bench.node.wait_for_log(r'\[WARN\].*header.stamp is [0-9.]+ s old.*ros2 bag play')
        assert 'is 1800' in line
        assert not bench.efforts.messages
        bench.driver.go_on()
        bench.wait_running()
        bench.wait_status('joint states', lambda one: not has_replay_hint(one))


# ------------------------------------------------------------------ the order of the joints


@fault(GROUP, 'the effort controller has another joint order than `joints`',
       'latched fault `controller_order`, which names both orders; no message on `~/commands`; '
       'with a controller in the right order and `~/reset_fault` commands are published')
def test_another_order_of_the_controller_stops_the_command(client):
    space = '/order'
    with client.collect(
            JointState, f'{space}/simulated/effort_command', KEEP_MANY) as forwarded, \
            ExitStack() as stack:
        wrong = stack.enter_context(ExitStack())
        wrong.enter_context(ros2_control(space, NAMES[::-1]))
        node = stack.enter_context(commanding(space))
        bench = FaultBench(client, node, space)
        stack.callback(bench.close)
        bench.driver.start()
        words = bench.wait_fault('controller_order').message
        assert '/order/effort_controller applies' in words
        assert "to the joints ['joint2', 'joint1'], expected" in words
        assert "['joint1', 'joint2']" in words
        forwarded.clear()
        assert all(np.isnan(m.effort).all() for m in forwarded.wait_count(50))
        reset = client.call(Trigger, bench.name('reset_fault'))
        assert not reset.success, reset.message
        wrong.close()
        with ros2_control(space, NAMES):
            def is_reset() -> bool:
                return bool(client.call(Trigger, bench.name('reset_fault')).success)

            wait_until(is_reset, 'a reset')
            bench.wait_running()
            forwarded.wait_for(lambda m: list(m.name) == NAMES and m.effort == pytest.approx(G))


@fault(GROUP, 'subscribers to `~/commands` without a parameter service, without a parameter '
       '`joints`, or without a node (a DDS reader of another program)',
       'one warning each that the order was not checked, with the required order; commands are '
       'published')
def test_an_order_that_cannot_be_checked_is_named(client):
    space = '/unchecked'
    topic = f'{space}/effort_controller/commands'
    with RosClient('bridge') as bridge, RosClient('relay', has_parameters=True) as relay, \
            NodelessReader() as reader, \
            bridge.collect(Float64MultiArray, topic), \
            relay.collect(Float64MultiArray, topic) as commands, commanding(space) as node:
        bench = FaultBench(client, node, space)
        bench.driver.start()
        reader.subscribe(topic)
        for name, reason in (
                ('/bridge', 'parameter service'), ('/relay', 'parameter `joints`'),
                ('a DDS reader that is no node', 'parameter service')):
            node.wait_for_log(
                rf'\[WARN\].*joint order of {name}, a subscriber of {topic}, was not checked: it '
                rf"has no {reason}. It must be \['joint1', 'joint2'\]")
        commands.wait_for(lambda m: m.data.tolist() == pytest.approx(G))
        assert reader.wait_for_message() == pytest.approx(G)
        bench.close()
        assert node.log.count('was not checked') == 3
