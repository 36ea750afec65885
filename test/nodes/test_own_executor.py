# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes in executors of others: real nodes in this process, next to nodes of rclpy."""

from collections import Counter
from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import threading
from typing import Any

from action_clients import Client
from children import TIMEOUT
from control_msgs.action import FollowJointTrajectory
from own_process import answer, own_process, OwnProcess, stamps_of
import pytest
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from ros_harness import NodeProcess, PATIENT, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES, Q = ['joint1', 'joint2'], [0.4, -0.3]
GRAVITY = default_dynamics().gravity(Q)
EXAMPLES = Path(__file__).parents[2] / 'docs' / 'examples'
EXECUTORS = [SingleThreadedExecutor, MultiThreadedExecutor]


@pytest.fixture(params=EXECUTORS)
def executor(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.fixture
def process() -> Iterator[OwnProcess]:
    with own_process() as process:
        yield process


@pytest.mark.parametrize('state_thread', [True, False])
def test_dynamics_answers_joint_states(client, process, executor, state_thread):
    node = process.dynamics(state_thread=state_thread)
    process.other('neighbour')
    with process.spun(executor):
        effort = answer(client, process, NAMES, Q).effort
        stopped = client.call(Trigger, f'{process.namespace}/dynamics/stop')
    assert list(effort) == pytest.approx(GRAVITY)
    assert stopped.success
    assert node.callback_errors == 0


def test_a_node_that_changes_its_executor_answers(client, process):
    node = process.dynamics()
    first = SingleThreadedExecutor(context=process.context)
    first.add_node(node)
    for _ in range(10):
        first.spin_once(timeout_sec=0.0)
    first.remove_node(node)
    first.shutdown()
    with process.spun(MultiThreadedExecutor):
        assert list(answer(client, process, NAMES, Q).effort) == pytest.approx(GRAVITY)


def test_simulated_arm_publishes_states_and_takes_efforts(client, process, executor):
    process.simulated_arm(rate=50.0, command_timeout=0.0)
    with process.spun(executor), client.collect(
            JointState, f'{process.namespace}/joint_states') as states:
        first = states.wait_for()
        efforts = client.publisher(JointState, f'{process.namespace}/effort_command')
        moved = client.ask(
            efforts, JointState(name=NAMES, effort=[5.0, 0.0]), states,
            lambda state: abs(state.position[0] - first.position[0]) > 0.01)
    assert len(moved.effort) == 2


def test_both_and_a_third_node_in_one_executor(client, process, executor):
    nodes = process.simulated_arm(rate=50.0), process.dynamics()
    neighbour, ticks = process.other('neighbour'), Counter[str]()
    neighbour.create_timer(0.05, lambda: ticks.update(['timer']))
    neighbour.create_subscription(
        JointState, 'joint_states', lambda _: ticks.update(['state']), 10)
    with client.collect(
            JointState, f'{process.namespace}/dynamics/gravity_compensation') as answers, \
            client.collect(JointState, f'{process.namespace}/effort_command') as efforts, \
            process.spun(executor):
        answers.wait_count(100)
        efforts.wait_count(50)
        wait_until(lambda: min(ticks['timer'], ticks['state']) >= 10, 'the neighbour')
        found = stamps_of(answers), stamps_of(efforts)  # before the effort is ramped out
    for stamps in found:
        assert len(set(stamps)) == len(stamps), 'a joint state was answered twice'
    assert [node.callback_errors for node in nodes] == [0, 0]


def test_the_threads_of_both_nodes_end_with_the_nodes(client, process):
    before = set(threading.enumerate())
    process.simulated_arm(rate=50.0)
    process.dynamics()
    with process.spun(SingleThreadedExecutor):
        with client.collect(JointState, f'{process.namespace}/effort_command') as efforts:
            efforts.wait_for()
        during = {thread.name for thread in set(threading.enumerate()) - before}
    assert {'joint_states loop', 'command watch', '~/stop service', 'simulation'} <= during
    assert set(threading.enumerate()) <= before


@pytest.mark.parametrize('threads', [1, 3])
def test_the_example_of_the_documentation(client, threads):
    namespace = f'/example{threads}'
    example = NodeProcess(
        'one_process', {**PATIENT, 'rate': 50.0, 'initial_position': Q}, namespace=namespace,
        arguments=['--threads', str(threads)], environment={'PYTHONPATH': os.pathsep.join(
            [str(EXAMPLES), os.environ.get('PYTHONPATH', '')])})
    with client.collect(
            JointState, f'{namespace}/dynamics/gravity_compensation') as answers, \
            client.collect(JointState, f'{namespace}/effort_command') as efforts:
        with example:
            answers.wait_count(100)
            example.wait_for_log(r'monitor.*Positions: \[0\.\d+, -0\.\d+\]')
            stamps = stamps_of(answers)
            first = efforts.wait_for()
        last = efforts.wait_for(lambda effort: not any(effort.effort))
    assert list(answers.messages[0].effort) == pytest.approx(GRAVITY, rel=1e-3)
    assert list(first.effort) == pytest.approx(GRAVITY, rel=1e-3)
    assert len(set(stamps)) == len(stamps), 'a joint state was answered twice'
    assert len(last.effort) == 2


FORGETFUL = """
import sys
import rclpy
from rclpy import executors
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode

rclpy.init()
executor = getattr(executors, sys.argv[1])()
for node in (DynamicsNode(), SimulatedArmNode()):
    executor.add_node(node)
for _ in range(30):
    executor.spin_once(timeout_sec=0.1)
if sys.argv[2] == 'shutdown':
    executor.shutdown()
    rclpy.shutdown()
print('all done')
"""


@pytest.mark.parametrize('end', ['shutdown', 'nothing'])
def test_a_process_that_destroys_no_node_ends_in_order(executor, end):
    done = subprocess.run(
        [sys.executable, '-c', FORGETFUL, executor.__name__, end],
        capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith('all done\n')  # the middleware may log there as well
    assert 'Traceback' not in done.stderr


def test_a_stop_ends_what_waits_for_a_busy_executor(client, process):
    node, busy, released = process.dynamics(), threading.Event(), threading.Event()

    def work() -> None:
        timer.cancel()
        busy.set()
        assert released.wait(TIMEOUT)

    timer = process.other('neighbour').create_timer(0.0, work)
    timer.cancel()
    trajectories = client.publisher(
        JointTrajectory, f'{process.namespace}/dynamics/joint_trajectory')
    trajectory = JointTrajectory(
        joint_names=NAMES, points=[JointTrajectoryPoint(positions=[0.9, 0.6])])
    goal = FollowJointTrajectory.Goal(trajectory=trajectory)
    with process.spun(SingleThreadedExecutor):
        answer(client, process, NAMES, Q)
        action = Client(client, process.namespace)
        assert 'joint_names is empty' in action.send(FollowJointTrajectory.Goal()).result()[2]
        timer.reset()
        assert busy.wait(TIMEOUT)
        sent = action.in_executor(lambda: action.action.send_goal_async(goal))
        trajectories.publish(trajectory)
        assert trajectories.wait_for_all_acked(Duration(seconds=TIMEOUT))
        assert client.call(Trigger, f'{process.namespace}/dynamics/stop').success
        assert not node._trajectories.refusal.startswith('~/stop')
        released.set()
        handle = action.answer(lambda: sent)
        found = action.answer(handle.get_result_async).result.error_string
        assert found == '~/stop was called'
        wait_until(lambda: node._trajectories.status().values['refused'] == 3, 'the rejections')
        assert node._trajectories.refusal == '~/stop was called'
        trajectories.publish(trajectory)
        wait_until(lambda: not node._trajectories.refusal, 'a trajectory that is followed')
