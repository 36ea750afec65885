# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes in executors of others: real nodes in this process, next to nodes of rclpy."""

from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import subprocess
import sys
import threading

from action_clients import Client
from children import TIMEOUT
from closed_loop import receiving
from control_msgs.action import FollowJointTrajectory
from own_process import answer, own_process, OwnProcess, stamps_of
import pytest
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from ros_harness import NodeProcess, UNHURRIED, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES, Q = ['joint1', 'joint2'], [0.4, -0.3]
GRAVITY = default_dynamics().gravity(Q)
EXAMPLES = Path(__file__).parents[2] / 'docs' / 'examples'


@pytest.fixture
def process() -> Iterator[OwnProcess]:
    with own_process() as process:
        yield process


@pytest.mark.parametrize('executor', [SingleThreadedExecutor, MultiThreadedExecutor])
def test_both_and_a_third_node_in_one_executor(client, process, executor):
    """No state is answered twice, and the threads of the nodes end with the nodes."""
    before = set(threading.enumerate())
    nodes = (process.simulated_arm(rate=50.0, initial_position=Q), process.dynamics(**UNHURRIED))
    neighbour, ticks = process.other('neighbour'), Counter[str]()
    neighbour.create_timer(0.05, lambda: ticks.update(['timer']))
    neighbour.create_subscription(
        JointState, 'joint_states', lambda _: ticks.update(['state']), 10)
    with process.spun(executor), receiving(
            client, process.namespace, 'dynamics/gravity_compensation', 'effort_command',
            'joint_states', count=30) as (answers, efforts, states):
        states.wait_for(lambda message: any(message.effort))  # the arm takes the efforts
        wait_until(lambda: min(ticks['timer'], ticks['state']) >= 10, 'the neighbour')
        found = stamps_of(answers), stamps_of(efforts)  # before the effort is ramped out
        during = {thread.name for thread in set(threading.enumerate()) - before}
    for stamps in found:
        assert len(set(stamps)) == len(stamps), 'a joint state was answered twice'
    assert [node.callback_errors for node in nodes] == [0, 0]
    of_nodes = {'joint_states loop', 'command watch', '~/stop service', 'simulation'}
    assert of_nodes <= during
    assert not of_nodes & {thread.name for thread in set(threading.enumerate()) - before}


def test_the_example_of_the_documentation(client):
    namespace = '/example'
    example = NodeProcess(
        'one_process', {
            **UNHURRIED, 'rate': 50.0, 'initial_position': Q, 'end_action': 'ramp_to_zero'},
        namespace=namespace,
        arguments=['--threads', '3'], environment={'PYTHONPATH': os.pathsep.join(
            [str(EXAMPLES), os.environ.get('PYTHONPATH', '')])})
    with ExitStack() as stack:
        with example:
            answers, efforts = stack.enter_context(receiving(
                client, namespace, 'dynamics/gravity_compensation', 'effort_command', count=30))
            example.wait_for_log(r'monitor.*Positions: \[0\.\d+, -0\.\d+\]')
            stamps = stamps_of(answers)
            first = efforts.messages[0]
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
for _ in range(10):
    executor.spin_once(timeout_sec=0.1)
if sys.argv[2] == 'shutdown':
    executor.shutdown()
    rclpy.shutdown()
print('all done')
"""


@pytest.mark.parametrize(('executor', 'end'), [
    ('SingleThreadedExecutor', 'shutdown'), ('MultiThreadedExecutor', 'nothing')])
def test_a_process_that_destroys_no_node_ends_in_order(executor, end):
    done = subprocess.run(
        [sys.executable, '-c', FORGETFUL, executor, end],
        capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith('all done\n')  # the middleware may log there as well
    assert 'Traceback' not in done.stderr


def test_a_stop_ends_what_waits_for_a_busy_executor(client, process):
    node, busy = process.dynamics(**UNHURRIED), threading.Event()
    released = threading.Event()

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
