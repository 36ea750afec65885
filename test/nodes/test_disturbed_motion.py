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

from collections.abc import Callable
from functools import partial
import os
import signal
import time
from typing import Any

from disturbed_arm import alternating, Array, disturbed_arm, DisturbedArm, PERIOD, run_to
from fault_bench import NANOSECONDS
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from robot_dynamics.model.arm_dynamics import ArmDynamics
from ros_harness import RosClient
from simulated_arms import released

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
SLOW = 0.05
"""[rad/s] of all joints, after the stop that a disturbance has caused."""
TICK = PERIOD / NANOSECONDS
LATE = 0.5
"""[s] by which a motion in real time may be late: the node ends its command in real time."""
ATTEMPTS_IN_REAL_TIME = 5


# ------------------------------------------------------------------ gaps and rates


GAPS = [(0.35, -0.5), (0.9, 1.7)]
"""Share of the way to the first goal at which the gap begins, and the second goal by this way."""
MORE_GAPS = [(share, second) for share in (0.02, 0.1, 0.5, 0.7, 0.98) for second in (
    -0.5, 0.0, 0.3, 1.3)]


@pytest.mark.parametrize(('name', 'gaps'), [
    *((name, GAPS) for name in ('default', 'panda', 'z1')),
    *(pytest.param(name, MORE_GAPS, marks=soak) for name in (
        'default', 'panda', 'z1', 'ur5', 'ur10', 'xarm7'))])
def test_a_gap_and_a_second_goal(client, name, gaps, seen):
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
def test_a_wrong_measurement_during_a_motion(client, name, kind, share, seen):
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
def test_the_command_ends_in_a_motion(client, name, end, seen):
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
    plant = released(bench.arm, rest)
    hold = ArmDynamics(bench.arm).rigid_body.gravity(rest)
    for t in np.arange(0.0, ramp_time, TICK):
        plant.step((1.0 - t / ramp_time) * hold, TICK)
    return float(np.abs(plant.v).max())
