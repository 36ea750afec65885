# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The topics of `dynamics`: joint states in, efforts out; and where the model comes from."""

from collections.abc import Iterator
import threading

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.dynamics.control_path import ControlCounters
from robot_dynamics.ros.dynamics.state_log import StateReport
from robots import robot_urdf
from ros_harness import DYNAMICS, NodeProcess, RosClient
from topic_bench import Bench, G, make_bench, NAMES


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[Bench]:
    """Return the node on the default arm with gravity compensation."""
    with NodeProcess(
            DYNAMICS, {'robot_description': default_arm_urdf(), 'command': 'gravity_compensation'},
            namespace='/gravity') as node:
        yield make_bench(client, node, '/gravity')


# --- gravity compensation ------------------------------------------------------------------------

@pytest.mark.parametrize('stamp', [
    Time(sec=1, nanosec=123_456_789), Time(sec=1_790_000_000, nanosec=987_654_321),
    Time(sec=2**31 - 1, nanosec=999_999_999)])
def test_the_command_for_a_state_carries_its_stamp(bench, stamp):
    state = bench.state()
    state.header.stamp = stamp
    message = bench.command(state)
    assert message.header.stamp == stamp
    assert list(message.name) == NAMES
    assert message.effort == pytest.approx(G, abs=5e-9)
    assert list(message.position) == list(message.velocity) == []
    gravity = bench.gravity.wait_for(lambda m: m.header.stamp == stamp)
    assert gravity.effort == message.effort
    assert bench.computed_torque.messages == []  # there is no reference


# --- the robot description -----------------------------------------------------------------------

def test_a_description_on_its_topic_replaces_the_embedded_arm(client):
    one = planar_arm_urdf([2.0], [1.0], [0.5], [0.1], name='one_link', joint_names=['hinge'])
    with client.describing('/described') as publish:
        publish(one)
        with NodeProcess(DYNAMICS, namespace='/described') as node:
            node.wait_for_log("Model 'one_link'")  # transient local: it was published before
            bench = make_bench(client, node, '/described')
            effort = bench.command(bench.state([np.pi / 2], [0.0], ['hinge']))
    assert list(effort.name) == ['hinge']
    assert effort.effort == pytest.approx([-2.0 * 9.81 * 0.5])


def test_a_parameter_takes_precedence_over_the_topic(client):
    urdf = robot_urdf('kinova')
    arm = load_arm(urdf)
    with NodeProcess(
            DYNAMICS, {'robot_description': urdf, 'state_thread': False},
            namespace='/given') as node:
        bench = make_bench(client, node, '/given')
        assert client.node.count_subscribers('/given/robot_description') == 0
        q = np.clip(
            np.linspace(-1.0, 1.0, arm.joint_count), arm.limits.lower, arm.limits.upper)
        effort = bench.command(bench.state(q.tolist(), [], list(arm.joint_names)))
        assert effort.effort == pytest.approx(ArmDynamics(arm).rigid_body.gravity(q))


def test_drops_may_be_counted_while_they_are_reported():
    counters = ControlCounters()
    report = StateReport(counters, lambda: None)

    def drop() -> None:
        for i in range(30_000):
            counters.dropped[f'reason {i}'] += 1

    thread = threading.Thread(target=drop)
    thread.start()
    while thread.is_alive():
        report.statuses(0.05)
    thread.join()
    assert report.statuses(0.05)[0].values['dropped: reason 29999'] == 1
