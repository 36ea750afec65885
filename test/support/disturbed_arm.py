# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A running node `dynamics` at default parameters, and the arm that it commands, in lock-step.

The arm is an `ArmSimulation` in the process of the test. A test can therefore withhold joint
states, change what they measure, and compare the true motion with its limits. Each state waits for
the effort with its stamp, so that a run does not depend on the load of the machine.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import threading
import time
from typing import Any

from builtin_interfaces.msg import Duration
from children import TIMEOUT
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_bench import NANOSECONDS, nanoseconds_of, stamp_of
import numpy as np
import numpy.typing as npt
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robots import robot_urdf
from ros_harness import DYNAMICS, KEEP_MANY, NodeProcess, RESEND_PERIOD, RosClient
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

Array = npt.NDArray[np.float64]
Measure = Callable[[Array, Array], tuple[Array, Array]]
PATIENCE = {'state_timeout': 60.0, 'state_max_age': 0.0}
"""Without the checks of timing, which a slow machine could fail."""
JOINTS = {'panda': [f'panda_joint{i + 1}' for i in range(7)],
          'z1': [f'joint{i + 1}' for i in range(6)]}
"""Joints of an arm without its gripper."""
FIRST_STAMP = NANOSECONDS


def urdf_of(name: str) -> str:
    """Return the description of an arm; the test is skipped if it is not installed."""
    return default_arm_urdf() if name == 'default' else robot_urdf(name)


class DisturbedArm:
    """
    The arm in lock-step with the node; `run` advances both.

    Positions and velocities are (n,). `q` and `v` are the true motion, one row per state; what
    was seen is judged from the last `begin` on.
    """

    def __init__(
        self, client: RosClient, namespace: str, node: NodeProcess, arm: ArmModel,
        start: Array, velocity: Array, rate: float, load: float, paced: bool,
    ) -> None:
        """`load` [kg] is a payload that the node does not know; `paced`: in real time."""
        self.client, self.node, self.arm, self.namespace = client, node, arm, namespace
        self.names = list(arm.joint_names)
        self.plant = ArmSimulation(arm, start, velocity)
        if load:
            self.add_load(load)
        self.plant.release()
        self.period = round(NANOSECONDS / rate)
        self.measure: Measure = lambda q, v: (q, v)
        """Returns what the joint states contain."""
        self.time = 0
        """Simulated time [ns]."""
        self.begun = 0
        """Row of the last `begin`."""
        self.effort = ArmDynamics(arm).rigid_body.gravity(start)
        self.motion = [(start, velocity)]
        self.ends = False
        """Whether the command ends: efforts with any stamp count, and a state needs no answer."""
        self._waiting = 0
        self._answer: Array | None = None
        self._news = threading.Condition()
        self._paced_from = time.monotonic() if paced else None
        self._references = client.collect(
            JointState, f'{namespace}/dynamics/reference')
        self._diagnostics = client.collect(DiagnosticArray, '/diagnostics')
        self._efforts = client.node.create_subscription(
            JointState, f'{namespace}/effort_command', self._keep, KEEP_MANY)
        self._states = client.publisher(JointState, f'{namespace}/joint_states', 1)
        self._trajectories = client.publisher(
            JointTrajectory, f'{namespace}/dynamics/joint_trajectory')

    def _keep(self, message: JointState) -> None:
        with self._news:
            if nanoseconds_of(message.header.stamp) == self._waiting or self.ends:
                self._answer = np.array(message.effort)
                self._news.notify()

    def end(self) -> None:
        """Interrupt the node, and answer it until its command has ended."""
        self.ends = True
        self.node.interrupt()
        self.run(10.0, lambda: not self.effort.any())

    def close(self) -> None:
        """Destroy the publishers and subscriptions."""
        self._references.close()
        self._diagnostics.close()
        self.client.node.destroy_subscription(self._efforts)
        for publisher in (self._states, self._trajectories):
            self.client.node.destroy_publisher(publisher)

    def add_load(self, mass: float) -> None:
        """Attach a load [kg] that the node does not know to the last link."""
        joint = self.arm.pinocchio_model.getJointId(self.names[-1])
        link = [name for name in self.arm.link_names
                if self.arm.link_frame(name).parentJoint == joint][-1]
        self.plant.set_payloads([make_payload(link, mass)])

    # ------------------------------------------------------------------ the motion

    @property
    def q(self) -> Array:
        """Positions (m, n)."""
        return np.array([q for q, _ in self.motion])

    @property
    def v(self) -> Array:
        """Velocities (m, n)."""
        return np.array([v for _, v in self.motion])

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Advance by a time [s]; each state waits for its effort."""
        end = self.time + round(seconds * NANOSECONDS)
        while self.time < end and not until():
            self._exchange()
            self._step(self.period)

    def gap(self, seconds: float) -> None:
        """Advance by a time [s] without joint states; the last effort continues."""
        self._step(round(seconds * NANOSECONDS))

    def _step(self, duration: int) -> None:
        limit = self.arm.limits.effort
        state = self.plant.step(np.clip(self.effort, -limit, limit), duration / NANOSECONDS)
        self.motion.append((state.position, state.velocity))
        self.time += duration
        if self._paced_from is not None:
            ahead = self._paced_from + self.time / NANOSECONDS - time.monotonic()
            if ahead > 0.0:
                time.sleep(ahead)
            else:
                self._paced_from -= ahead

    def _exchange(self) -> None:
        """Publish the state, and take the effort that answers it; repeat it if it was lost."""
        q, v = self.measure(self.plant.q.copy(), self.plant.v.copy())
        message = JointState(name=self.names, position=q.tolist(), velocity=v.tolist())
        message.header.stamp = stamp_of(FIRST_STAMP + self.time)
        with self._news:
            self._waiting = FIRST_STAMP + self.time
            if not self.ends:
                self._answer = None
            deadline = time.monotonic() + TIMEOUT
            self._states.publish(message)
            while not self._news.wait_for(
                    lambda: self._answer is not None, RESEND_PERIOD):
                assert time.monotonic() < deadline, f'no effort at {self.time} ns'
                self._states.publish(message)
            assert self._answer is not None
            self.effort = self._answer
            if self.ends and self.effort.any():  # the next one may be the last
                self._answer = None

    # ------------------------------------------------------------------ requests

    def send(self, *points: tuple[float, Any], velocity: Any = ()) -> None:
        """Send positions at times [s], or one set-point with a velocity."""
        self._trajectories.publish(JointTrajectory(joint_names=self.names, points=[
            JointTrajectoryPoint(
                positions=np.asarray(q).tolist(), velocities=np.asarray(velocity).tolist(),
                time_from_start=Duration(sec=int(t), nanosec=round(1e9 * (t % 1.0))))
            for t, q in points]))
        if self._paced_from is None:  # until they have arrived
            self._trajectories.wait_for_all_acked()

    def begin(self) -> None:
        """Judge the motion from now on."""
        self.begun = len(self.motion) - 1
        self._references.clear()

    # ------------------------------------------------------------------ results

    def peak_speed(self) -> float:
        """Return the largest speed, as a share of the velocity limit."""
        return float((np.abs(self.v[self.begun:]) / self.arm.limits.velocity).max())

    def excess(self, *corners: Array) -> float:
        """Return how far the arm has left the hull of positions (n,)."""
        q = self.q[self.begun:]
        return float(np.maximum(
            q - np.max(corners, axis=0), np.min(corners, axis=0) - q).max())

    def reference_excess(self, *corners: Array) -> float:
        """Return how far the published reference has left the hull."""
        q = np.array([message.position for message in self._references.messages])
        return float(np.maximum(
            q - np.max(corners, axis=0), np.min(corners, axis=0) - q).max())

    def beyond_limits(self) -> float:
        """Return how far the arm was beyond a position limit, negative if it was not."""
        return self.excess(self.arm.limits.lower, self.arm.limits.upper)

    def rests_at(self, goal: Array) -> bool:
        """Return whether the arm rests at a goal."""
        return bool(np.abs(self.plant.q - goal).max() < 0.005 and np.abs(
            self.plant.v).max() < 0.005)

    def last_speed(self, seconds: float = 0.2) -> float:
        """Return the largest speed [rad/s] in the last seconds."""
        return float(np.abs(self.v[-max(round(seconds * NANOSECONDS / self.period), 1):]).max())

    def status(self, check: str, holds: Callable[[DiagnosticStatus], bool]) -> DiagnosticStatus:
        """Wait for a status of the node, from now or before, that fulfils this."""
        name = f'{self.namespace}/dynamics: {check}'

        def find(message: Any) -> DiagnosticStatus | None:
            return next((s for s in message.status if s.name == name and holds(s)), None)

        found = find(self._diagnostics.wait_for(lambda message: find(message) is not None))
        assert found is not None
        return found


@contextmanager
def disturbed_arm(
    client: RosClient, name: str, start: Any = None, velocity: float = 0.0, rate: float = 500.0,
    load: float = 0.0, urdf: str = '', paced: bool = False,
    parameters: Mapping[str, Any] | None = None, environment: Mapping[str, str] | None = None,
    joints: Sequence[str] | None = None,
) -> Iterator[DisturbedArm]:
    """Run a node at default parameters for an arm that stands at `start`, or moves from there."""
    urdf = urdf or urdf_of(name)
    joints = JOINTS.get(name, []) if joints is None else joints
    arm = load_arm(urdf, joints)
    begin = middle(arm) if start is None else np.array(start)
    namespace = f'/{name}_{next(_NUMBERS)}'
    with NodeProcess(
            DYNAMICS, {'robot_description': urdf, 'joints': list(joints), **PATIENCE,
                       **(parameters or {})},
            namespace=namespace, patient=False, environment=environment) as node:
        bench = DisturbedArm(
            client, namespace, node, arm, begin, np.full(len(begin), velocity), rate, load, paced)
        try:
            yield bench
            bench.end()
        finally:
            bench.close()


_NUMBERS = iter(range(10**6))


def middle(arm: ArmModel) -> Array:
    """Return 0.3 at each joint without limits, and the middle between the limits of others."""
    limits = arm.limits
    start = np.full(arm.joint_count, 0.3)
    bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    start[bounded] = 0.5 * (limits.lower[bounded] + limits.upper[bounded])
    return start
