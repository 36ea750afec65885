# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Whatever happens to `dynamics_monitor`, the commands of `dynamics` are those without it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
import os
import signal
import threading

from bounded_waits import Collector
from builtin_interfaces.msg import Duration
from closed_loop import NAMES, START
from geometry_msgs.msg import WrenchStamped
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_to_ros
from robot_dynamics_interfaces.srv import EstimatePayload
from ros_harness import (
    BEST_EFFORT,
    DYNAMICS,
    LONG,
    MONITOR,
    NO_SHARED_MEMORY,
    NodeProcess,
    RosClient,
    wait_until,
)
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import MarkerArray

NAMESPACE = '/watched'
STEP = 0.008
"""[s] between two states."""
STEPS, SENT_AT, DISTURBED_AT = 600, 60, 150
"""Number of states, and the states at which the motion is sent and the monitor is disturbed."""
BEGIN = 1
"""[s] at which the motion begins."""
MOTION = ((1, [1.2, 0.0]), (2, [0.4, 1.0]), (3, START))
PARAMETERS = {
    'joints': NAMES, 'lock_step': True, 'contact.effort': [0.5],
    'uncertainty.noise_deviation': [0.1], 'uncertainty.noise_bandwidth': 2.0,
    'effort_rate_limit': 1e9}
"""Limits of rates apply to the time between two commands, which differs from run to run."""


def trajectory() -> JointTrajectory:
    """Return a motion that begins at a stamp."""
    message = JointTrajectory(joint_names=NAMES, points=[
        JointTrajectoryPoint(positions=q, velocities=[0.0, 0.0], time_from_start=Duration(sec=t))
        for t, q in MOTION])
    message.header.stamp.sec = BEGIN
    return message


class Arm:
    """A simulated arm whose states wait for their commands."""

    def __init__(self) -> None:
        self._dynamics = ArmDynamics(load_arm(default_arm_urdf()))
        self.q, self.v = np.array(START), np.zeros(2)
        self.effort = self._dynamics.rigid_body.gravity(self.q)
        self._noise = np.random.default_rng(1)

    def state(self, stamp_ns: int) -> JointState:
        """Return the measured state, with noise."""
        q, v, effort = (
            value + size * self._noise.normal(size=2)
            for value, size in ((self.q, 1e-5), (self.v, 1e-3), (self.effort, 0.2)))
        message = JointState(name=NAMES, position=q, velocity=v, effort=effort)
        message.header.stamp = stamp_to_ros(stamp_ns)
        return message

    def move(self, effort: np.ndarray) -> None:
        """Integrate over a step."""
        self.effort = effort
        for _ in range(8):
            q = self.q + 0.5 * STEP / 8 * self.v
            v = self.v + STEP / 8 * self._dynamics.forward_dynamics(q, self.v, effort)
            self.q, self.v = self.q + 0.5 * STEP / 8 * (self.v + v), v


def commands(
    client: RosClient, monitor: NodeProcess | None = None,
    at_step: Callable[[], None] = lambda: None,
) -> list[bytes]:
    """Return the commands of a motion; call `at_step` at each state after DISTURBED_AT."""
    arm, found = Arm(), []
    with NodeProcess(DYNAMICS, PARAMETERS, namespace=NAMESPACE), \
            client.collect(JointState, f'{NAMESPACE}/effort_command') as efforts:
        if monitor is not None:
            monitor.start()
        states = client.publisher(JointState, f'{NAMESPACE}/joint_states', 1)
        motion = client.publisher(JointTrajectory, f'{NAMESPACE}/dynamics/joint_trajectory')
        efforts.wait_matched()
        for k in range(STEPS):
            if k == SENT_AT:
                motion.publish(trajectory())
                motion.wait_for_all_acked()
                client.get_parameter(f'{NAMESPACE}/dynamics', 'joints')  # answered after it
            if k >= DISTURBED_AT:
                at_step()
            message = arm.state(round(1e9 * STEP * (k + 1)))
            command = client.answer_to(states, message, efforts)
            efforts.clear()
            found.append(command.effort.tobytes())
            arm.move(np.array(command.effort))
        assert np.abs(arm.q - START).max() < 0.05
    client.forget(f'{NAMESPACE}/dynamics/')
    return found


@contextmanager
def watched(client: RosClient) -> Iterator[list[Collector]]:
    """Subscribe to the topics of the monitor; yield their collectors."""
    with ExitStack() as stack:
        yield [
            stack.enter_context(
                client.collect(kind, f'{NAMESPACE}/dynamics_monitor/{topic}', BEST_EFFORT))
            for kind, topic in (
                (JointState, 'external_effort'), (JointState, 'residual'),
                (JointState, 'external_effort_deviation'), (WrenchStamped, 'external_wrench'),
                (MarkerArray, 'markers'))]


def flood(client: RosClient, ends: threading.Event) -> int:
    """Send requests without waiting for their answers until the end; return their number."""
    requests = [
        (EstimatePayload, 'estimate_payload', EstimatePayload.Request(start=True, link='tool0')),
        (EstimatePayload, 'estimate_payload', EstimatePayload.Request(link='no link')),
        (Trigger, 'zero_external_wrench', Trigger.Request()),
        (GetParameters, 'get_parameters', GetParameters.Request(names=['dynamics']))]
    services = [
        client.node.create_client(kind, f'{NAMESPACE}/dynamics_monitor/{name}')
        for kind, name, _ in requests]
    wait_until(lambda: all(one.service_is_ready() for one in services), 'the services', LONG)
    count = 0
    while not ends.wait(0.001):
        services[count % 4].call_async(requests[count % 4][2])
        count += 1
    for service in services:
        client.node.destroy_client(service)
    return count


@pytest.fixture(scope='module')
def undisturbed(client: RosClient) -> list[bytes]:
    """Return the commands without a monitor."""
    return commands(client)


@pytest.mark.parametrize('deed', ['is stopped', 'is killed', 'is flooded'])
def test_the_commands_are_bit_for_bit_those_without_a_monitor(client, undisturbed, deed):
    monitor = NodeProcess(MONITOR, namespace=NAMESPACE, environment=NO_SHARED_MEMORY)
    ends, sent, steps = threading.Event(), [], []
    flooding = threading.Thread(target=lambda: sent.append(flood(client, ends)))

    def disturb() -> None:
        if steps:
            steps.append(deed)
        elif all(one.messages for one in topics):
            steps.append(deed)
            if deed == 'is flooded':
                flooding.start()
            else:
                os.kill(monitor.pid, signal.SIGKILL if deed == 'is killed' else signal.SIGSTOP)

    with watched(client) as topics:
        try:
            found = commands(client, monitor, disturb)
        finally:
            ends.set()
            if flooding.ident is not None:
                flooding.join()
            monitor.kill()
    assert len(steps) > STEPS // 4
    assert deed != 'is flooded' or sent[0] > 100
    assert found == undisturbed
