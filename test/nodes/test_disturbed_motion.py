# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A motion stays safe when it is disturbed: a real node at default parameters, in lock-step.

The arm is an `ArmSimulation` in the process of the test. A test can therefore withhold joint
states, change what they measure, and compare the true motion with its limits. Each state waits for
the effort with its stamp, so that a run does not depend on the load of the machine.
`test/control/test_loop_velocities.py` has more wrong velocities, without ROS.
`scripts/bench safe_motion` runs thousands of disturbed motions without ROS.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import count
import threading
import time
from typing import Any

from children import TIMEOUT
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_bench import NANOSECONDS, nanoseconds_of, stamp_of
from lock_step_loop import middle
import numpy as np
import numpy.typing as npt
import pytest
from robot_dynamics.model import ArmDynamics, ArmModel, load_arm
from robots import JOINTS, robot_urdf
from ros_harness import DYNAMICS, KEEP_MANY, NodeProcess, RESEND_PERIOD, RosClient
from sensor_msgs.msg import JointState
from simulated_arms import released
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

Array = npt.NDArray[np.float64]
Measure = Callable[[Array, Array], tuple[Array, Array]]
NUMBERS = count()
PATIENCE = {'state_timeout': 60.0, 'state_max_age': 0.0, 'hold_time': 1000.0}
"""Without the checks of timing, which a slow machine could fail."""
FIRST_STAMP = NANOSECONDS
PERIOD = 4_000_000
"""[ns] between two joint states."""
HELD_BY_FRICTION = 0.008
"""[rad] from a goal at which known dry friction may hold a joint; see friction.md."""


class DisturbedArm:
    """
    The arm in lock-step with a real node; `run` advances both, a test withholds or changes states.

    Positions and velocities are (n,). `q` and `v` are the true motion, one row per state; what
    was seen is judged from the last `begin` on.
    """

    def __init__(
        self, client: RosClient, namespace: str, node: NodeProcess, arm: ArmModel,
    ) -> None:
        self.client, self.node, self.arm, self.namespace = client, node, arm, namespace
        self.names = list(arm.joint_names)
        start = middle(arm, 0.3)
        self.plant = released(arm, start)
        self.measure: Measure = lambda q, v: (q, v)
        """Returns what the joint states contain."""
        self.time = 0
        """Simulated time [ns]."""
        self.begun = 0
        """Row of the last `begin`."""
        self.effort = ArmDynamics(arm).rigid_body.gravity(start)
        self.motion = [(start, 0.0 * start)]
        self.times = [0.0]
        """Simulated time of each row [s]."""
        self.ends = False
        """Whether the command ends: efforts with any stamp count, and a state needs no answer."""
        self._waiting = 0
        self._answer: Array | None = None
        self._news = threading.Condition()
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
            self._step(PERIOD)

    def gap(self, seconds: float) -> None:
        """Advance by a time [s] without joint states; the last effort continues."""
        self._step(round(seconds * NANOSECONDS))

    def _step(self, duration: int) -> None:
        limit = self.arm.limits.effort
        state = self.plant.step(np.clip(self.effort, -limit, limit), duration / NANOSECONDS)
        self.motion.append((state.position, state.velocity))
        self.time += duration
        self.times.append(self.time / NANOSECONDS)

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

    def send(self, q: Array) -> None:
        """Send a set-point."""
        self._trajectories.publish(JointTrajectory(
            joint_names=self.names, points=[JointTrajectoryPoint(positions=q.tolist())]))
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
        """Return how far the published reference has left the hull of these and its start."""
        q = np.array([message.position for message in self._references.messages])
        corners = (*corners, q[0])  # dry friction holds the arm away from its reference
        return float(np.maximum(
            q - np.max(corners, axis=0), np.min(corners, axis=0) - q).max())

    def beyond_limits(self) -> float:
        """Return how far the arm was beyond a position limit, negative if it was not."""
        return self.excess(self.arm.limits.lower, self.arm.limits.upper)

    def rests_at(self, goal: Array) -> bool:
        """Return whether the arm rests at a goal, or where dry friction holds it (friction.md)."""
        return bool(np.abs(self.plant.q - goal).max() < HELD_BY_FRICTION and np.abs(
            self.plant.v).max() < 0.005)

    def status(self, check: str, holds: Callable[[DiagnosticStatus], bool]) -> DiagnosticStatus:
        """Wait for a status of the node, from now or before, that fulfils this."""
        name = f'{self.namespace}/dynamics: {check}'

        def find(message: Any) -> DiagnosticStatus | None:
            return next((s for s in message.status if s.name == name and holds(s)), None)

        found = find(self._diagnostics.wait_for(lambda message: find(message) is not None))
        assert found is not None
        return found


@contextmanager
def disturbed_arm(client: RosClient, name: str) -> Iterator[DisturbedArm]:
    """Run a node at default parameters for an arm at rest."""
    urdf, joints, namespace = robot_urdf(name), JOINTS.get(name, []), f'/{name}_{next(NUMBERS)}'
    with NodeProcess(
            DYNAMICS, {
                'robot_description': urdf, 'joints': joints, 'end_action': 'ramp_to_zero',
                **PATIENCE},
            namespace=namespace) as node:
        bench = DisturbedArm(client, namespace, node, load_arm(urdf, joints))
        try:
            yield bench
            bench.end()
        finally:
            bench.close()


def alternating(bench: DisturbedArm, size: float) -> Array:
    """Return a goal at a distance of `size` [rad] at each joint, within the limits."""
    start, limits = bench.plant.q, bench.arm.limits
    way = np.where(np.arange(len(start)) % 2 == 0, size, -size)
    return np.asarray(np.clip(start + way, limits.lower + 0.1, limits.upper - 0.1))


def run_to(bench: DisturbedArm, goal: Array, share: float) -> None:
    """Run until the arm has made this share of the way to a goal."""
    start = bench.q[-1]
    way = goal - start
    j = int(np.argmax(np.abs(way)))

    def is_there() -> bool:
        moved = abs(bench.plant.q[j] - start[j])
        return bool(moved >= min(share * abs(way[j]), abs(way[j]) - HELD_BY_FRICTION))

    bench.run(6.0, is_there)
    assert is_there(), f'the arm has not made {share:g} of its way to {goal} in 6 s'


GAP = 0.042
"""[s] without joint states, which is less than `state_timeout`."""
TRACKING = 0.02
"""[rad] by which the arm may leave the hull of its reference."""
OVERSPEED = 1.2
"""Largest speed after a wrong velocity, by the velocity limit."""
SLOW = 0.05
"""[rad/s] of all joints, after the stop that a disturbance has caused."""


# ------------------------------------------------------------------ gaps

@pytest.mark.parametrize(('share', 'second'), [
    (0.35, -0.5), pytest.param(0.9, 1.7, marks=pytest.mark.soak)])
def test_a_gap_and_a_second_goal(client, share, second, seen):
    """
    The arm stays in the hull of start, earliest stop and goals.

    The gap begins at this share of the way to the first goal; `second` is the second goal by it.
    """
    with disturbed_arm(client, 'panda') as bench:
        limits = bench.arm.limits
        bench.run(0.1)
        bench.begin()
        start, goal = bench.plant.q.copy(), alternating(bench, 1.0)
        other = np.clip(start + second * (goal - start), limits.lower + 0.02, limits.upper - 0.02)
        bench.send(goal)
        run_to(bench, goal, share)
        bench.gap(GAP)
        bench.send(other)
        bench.run(5.0, partial(bench.rests_at, other))
        hull = (start, goal, other)
        seen(f'{bench.excess(*hull):.4f} rad, speed {bench.peak_speed():.2f}')
        assert bench.reference_excess(*hull) < 1e-3
        assert bench.excess(*hull) < TRACKING
        assert bench.beyond_limits() <= 0.0
        assert bench.peak_speed() < 1.05
        assert bench.rests_at(other)


# ------------------------------------------------------------------ wrong measurements


def reversed_sign(j: int) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Return the fault of a driver that reverses the sign of one velocity."""
    sign = np.ones(20)
    sign[j] = -1.0
    return lambda q, v: (q, sign[:len(v)] * v)


def frozen(j: int, q0: float, v0: float) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Return the fault of a driver that repeats the sample of one joint."""
    def measure(q: Array, v: Array) -> tuple[Array, Array]:
        q[j], v[j] = q0, v0
        return q, v
    return measure


def test_a_wrong_sign_of_a_velocity_during_a_motion(client, seen):
    """The motion continues, with the velocity of the positions."""
    with disturbed_arm(client, 'panda') as bench:
        bench.run(0.1)
        start, goal = bench.plant.q.copy(), alternating(bench, 1.5)
        bench.send(goal)
        run_to(bench, goal, 0.4)
        bench.begin()
        bench.measure = reversed_sign(1)
        bench.run(5.0, partial(bench.rests_at, goal))
        seen(f'{bench.excess(start, goal):.4f} rad, speed {bench.peak_speed():.2f}')
        assert bench.rests_at(goal)
        assert bench.excess(start, goal) < TRACKING
        assert bench.peak_speed() < OVERSPEED


def test_a_frozen_joint_during_a_motion(client, seen):
    """An arm with friction stops, within its velocity limits; the fault names the joint."""
    with disturbed_arm(client, 'z1') as bench:
        bench.run(0.1)
        goal = alternating(bench, 1.5)
        bench.send(goal)
        run_to(bench, goal, 0.4)
        bench.begin()
        bench.measure = frozen(1, float(bench.plant.q[1]), float(bench.plant.v[1]))
        bench.run(0.6)
        bench.run(3.0, lambda: bool(np.abs(bench.v[-50:]).max() < SLOW))
        bench.run(0.5)
        speed = float(np.abs(bench.v[-50:]).max())
        passed = bench.times[-1] - bench.times[bench.begun]
        seen(f'speed {bench.peak_speed():.2f}, after {passed:.1f} s {speed:.4f} rad/s')
        assert speed < SLOW
        assert bench.peak_speed() < OVERSPEED
        assert bench.beyond_limits() <= 0.0
        status = bench.status('command', lambda s: 'frozen_joint' in s.message)
        assert f"the position of ['{bench.names[1]}'] has not changed" in status.message
