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
import os
import signal
import threading
import time
from typing import Any

from children import TIMEOUT
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_bench import NANOSECONDS, nanoseconds_of, stamp_of
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from lock_step_loop import middle
import numpy as np
import numpy.typing as npt
import pytest
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robots import JOINTS, robot_urdf
from ros_harness import DYNAMICS, KEEP_MANY, NodeProcess, RESEND_PERIOD, RosClient
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

Array = npt.NDArray[np.float64]
Measure = Callable[[Array, Array], tuple[Array, Array]]
NUMBERS = count()
PATIENCE = {'state_timeout': 60.0, 'state_max_age': 0.0, 'hold_time': 1000.0}
"""Without the checks of timing, which a slow machine could fail."""
FIRST_STAMP = NANOSECONDS
PERIOD = 2_000_000
"""[ns] between two joint states."""
soak = pytest.mark.soak
GAP = 0.042
"""[s] without joint states, which is less than `state_timeout`."""
TRACKING = 0.02
"""[rad] by which the arm may leave the hull of its reference."""
OVERSPEED = 1.2
"""Largest speed after a wrong velocity, by the velocity limit."""
AT_REST = 0.05
"""[rad/s]"""
HELD = 0.08
"""[s] for which the arm is at rest before its effort decreases."""
HELD_BY_FRICTION = 0.008
"""[rad] from a goal at which known dry friction may hold a joint; see friction.md."""
SLOW = 0.05
"""[rad/s] of all joints, after the stop that a disturbance has caused."""
TICK = PERIOD / NANOSECONDS
LONGEST_STEP = 0.02
"""[s] that a motion in real time advances between two states, if the machine is slow."""
LATE = 0.5
"""[s] by which a motion in real time may be late: the node ends its command in real time."""
ATTEMPTS_IN_REAL_TIME = 5


class DisturbedArm:
    """
    The arm in lock-step with the node; `run` advances both.

    Positions and velocities are (n,). `q` and `v` are the true motion, one row per state; what
    was seen is judged from the last `begin` on.
    """

    def __init__(
        self, client: RosClient, namespace: str, node: NodeProcess, arm: ArmModel, paced: bool,
    ) -> None:
        """`paced` is true for a motion in real time."""
        self.client, self.node, self.arm, self.namespace = client, node, arm, namespace
        self.names = list(arm.joint_names)
        start = middle(arm, 0.3)
        self.plant = ArmSimulation(arm, start)
        self.plant.release()
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
        self._paced_from = time.monotonic() if paced else None
        self.late = 0.0
        """Time [s] by which the motion took longer than in real time."""
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
            self._step(max(PERIOD, min(self._behind(), round(LONGEST_STEP * NANOSECONDS))))

    def gap(self, seconds: float) -> None:
        """Advance by a time [s] without joint states; the last effort continues."""
        self._step(round(seconds * NANOSECONDS))

    def _step(self, duration: int) -> None:
        limit = self.arm.limits.effort
        state = self.plant.step(np.clip(self.effort, -limit, limit), duration / NANOSECONDS)
        self.motion.append((state.position, state.velocity))
        self.time += duration
        self.times.append(self.time / NANOSECONDS)
        if self._paced_from is not None:
            behind = self._behind() / NANOSECONDS
            if behind < 0.0:
                time.sleep(-behind)
            elif behind > LONGEST_STEP:
                self._paced_from += behind
                self.late += behind

    def _behind(self) -> int:
        """Return by how much the motion in real time is late [ns], 0 in simulated time."""
        if self._paced_from is None:
            return 0
        return round((time.monotonic() - self._paced_from) * NANOSECONDS) - self.time

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
def disturbed_arm(client: RosClient, name: str, paced: bool = False) -> Iterator[DisturbedArm]:
    """Run a node at default parameters for an arm at rest."""
    urdf, joints, namespace = robot_urdf(name), JOINTS.get(name, []), f'/{name}_{next(NUMBERS)}'
    with NodeProcess(
            DYNAMICS, {'robot_description': urdf, 'joints': joints, **PATIENCE},
            namespace=namespace, patient=False) as node:
        bench = DisturbedArm(client, namespace, node, load_arm(urdf, joints), paced)
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


# ------------------------------------------------------------------ gaps and rates


GAPS = [(0.35, -0.5), (0.9, 1.7)]
"""Share of the way to the first goal at which the gap begins, and the second goal by this way."""
MORE_GAPS = [(share, second) for share in (0.02, 0.1, 0.5, 0.7, 0.98) for second in (
    -0.5, 0.0, 0.3, 1.3)]


@pytest.mark.parametrize(('name', 'gaps'), [
    *((name, GAPS) for name in ('default', 'panda', 'z1')),
    *(pytest.param(name, MORE_GAPS, marks=soak) for name in (
        'default', 'panda', 'z1', 'ur5', 'ur10', 'xarm7'))])
def test_a_gap_and_a_second_goal(
    client: RosClient, name: str, gaps: list[tuple[float, float]], seen: Any,
) -> None:
    """The arm stays in the hull of start, earliest stop and goals."""
    with disturbed_arm(client, name) as bench:
        limits, worst = bench.arm.limits, [0.0, 0.0]
        for share, second in gaps:
            bench.run(0.1)
            bench.begin()
            start, goal = bench.plant.q.copy(), alternating(bench, 1.0)
            other = np.clip(
                start + second * (goal - start), limits.lower + 0.02, limits.upper - 0.02)
            bench.send(goal)
            run_to(bench, goal, share)
            bench.gap(GAP)
            bench.send(other)
            bench.run(5.0, partial(bench.rests_at, other))
            hull = (start, goal, other)
            worst = np.maximum(worst, (bench.excess(*hull), bench.reference_excess(*hull)))
            seen(f'{worst[0]:.4f} rad, reference {worst[1]:.4f}, speed {bench.peak_speed():.2f}')
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


def zero(q: Array, v: Array) -> tuple[Array, Array]:
    """Return the state of a driver without velocities."""
    return q, np.zeros_like(v)


def in_degrees(q: Array, v: Array) -> tuple[Array, Array]:
    """Return the state of a driver that measures velocities in deg/s."""
    return q, np.degrees(v)


WRONG = [('panda', 'sign 1'), ('ur5', 'zero'), ('ur5', 'in degrees'), ('ur10', 'frozen 1')]
FURTHER = [
    (name, kind) for name in ('default', 'ur5', 'ur10', 'panda', 'xarm7', 'z1')
    for kind in ('sign 0', 'sign 1', 'zero', 'in degrees', 'frozen 0', 'frozen 1')
    if (name, kind) not in WRONG]


@pytest.mark.parametrize('share', [pytest.param(0.05, marks=soak), 0.4])
@pytest.mark.parametrize(('name', 'kind'), [
    *WRONG, *(pytest.param(*one, marks=soak) for one in FURTHER)])
def test_a_wrong_measurement_during_a_motion(
    client: RosClient, name: str, kind: str, share: float, seen: Any,
) -> None:
    """The speed stays below 1.2 times its limit, and the arm stops."""
    with disturbed_arm(client, name) as bench:
        bench.run(0.1)
        goal = alternating(bench, 1.5)
        bench.send(goal)
        run_to(bench, goal, share)
        bench.begin()
        j = int(kind[-1]) if kind[-1].isdigit() else 0
        bench.measure = {
            'sign': reversed_sign(j), 'zero': zero, 'in degrees': in_degrees,
            'frozen': frozen(j, float(bench.plant.q[j]), float(bench.plant.v[j])),
        }[kind.rstrip(' 01')]
        is_frozen = 'frozen' in kind
        bench.run(0.6)
        bench.run(3.0, lambda: bool(np.abs(bench.v[-50:]).max() < SLOW))
        bench.run(0.4 + is_frozen)
        speed = float(np.abs(bench.v[-50:]).max())
        passed = bench.times[-1] - bench.times[bench.begun]
        seen(f'speed {bench.peak_speed():.2f}, after {passed:.1f} s {speed:.4f} rad/s')
        assert speed < SLOW
        assert bench.peak_speed() < OVERSPEED
        assert bench.beyond_limits() <= 0.0
        if is_frozen:
            bench.status('command', lambda s: 'frozen_joint' in s.message)
        else:
            status = bench.status('joint states', lambda s: 'velocity of' in s.message)
            assert bench.names[j] in status.message or 'sign' not in kind


# ------------------------------------------------------------------ ends of streams


# ------------------------------------------------------------------ the end of the command


def terminate(bench: DisturbedArm) -> None:
    os.kill(bench.node.pid, signal.SIGTERM)


def interrupt(bench: DisturbedArm) -> None:
    bench.node.interrupt()


def command_none(bench: DisturbedArm) -> None:
    bench.client.set_parameters(f'{bench.namespace}/dynamics', {'command': 'none'})


def deactivate(bench: DisturbedArm) -> None:
    service = bench.client.node.create_client(
        ChangeState, f'{bench.namespace}/dynamics/change_state')
    assert service.wait_for_service()
    service.call_async(ChangeState.Request(
        transition=Transition(id=Transition.TRANSITION_DEACTIVATE)))


@pytest.mark.parametrize(('name', 'end'), [
    ('ur10', terminate), ('ur10', command_none), ('default', deactivate),
    *(pytest.param(*one, marks=soak) for one in (
        ('ur10', interrupt), ('panda', terminate), ('z1', command_none), ('xarm7', interrupt),
        ('ur10', deactivate)))])
def test_the_command_ends_in_a_motion(
    client: RosClient, name: str, end: Callable[[DisturbedArm], None], seen: Any,
) -> None:
    """The arm stops and is held; then the command ramps to zero; all within 5 s."""
    for _ in range(ATTEMPTS_IN_REAL_TIME):
        late = end_in_a_motion(client, name, end, seen)
        if late < LATE:
            return
    raise AssertionError(f'no attempt in real time: this machine was {late:.1f} s late')


def end_in_a_motion(
    client: RosClient, name: str, end: Callable[[DisturbedArm], None], seen: Any,
) -> float:
    """Judge the motion, unless the arm was slower than in real time; return by how much [s]."""
    with disturbed_arm(client, name, paced=True) as bench:
        bench.run(0.1)
        goal = alternating(bench, 1.5)
        bench.send(goal)
        run_to(bench, goal, 0.55)  # slower from here on, however late the request arrives
        bench.begin()
        start, speed = bench.plant.q.copy(), float(np.abs(bench.plant.v).max())
        began, late = time.monotonic(), bench.late
        bench.ends = True
        end(bench)
        bench.run(5.0, lambda: not bench.effort.any())
        duration, late = time.monotonic() - began, bench.late - late
        v = np.abs(bench.v[bench.begun:]).max(axis=1)
        t = np.array(bench.times[bench.begun:]) - bench.times[bench.begun]
        at_rest = next((k for k, begin in enumerate(t) if v[
            (t >= begin) & (t < begin + HELD)].max() < AT_REST), 0)
        rest = bench.q[bench.begun + at_rest]
        ramp = ramp_speed(bench, rest)
        seen(f'{speed:.2f} rad/s, at rest after {t[at_rest]:.2f} s and '
             f'{np.abs(rest - start).max():.2f} rad, zero after {duration:.2f} s at '
             f'{v[-1]:.2f} rad/s, {ramp:.2f} by the ramp; {late:.2f} s late')
        if late < LATE:
            assert at_rest, 'the arm did not stop'
            assert v[:at_rest].max() < 1.1 * speed
            assert v[-1] < 1.2 * ramp + 0.1
            assert duration < 5.0
    return late


def ramp_speed(bench: DisturbedArm, rest: Array, ramp_time: float = 0.5) -> float:
    """Return the speed of the arm after a ramp of the effort to zero from rest [rad/s]."""
    plant = ArmSimulation(bench.arm, rest)
    plant.release()
    hold = ArmDynamics(bench.arm).rigid_body.gravity(rest)
    for t in np.arange(0.0, ramp_time, TICK):
        plant.step((1.0 - t / ramp_time) * hold, TICK)
    return float(np.abs(plant.v).max())


# ------------------------------------------------------------------ the start, and loads
