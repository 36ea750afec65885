# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A motion stays safe when it is disturbed: a real node at default parameters, in lock-step.

`scripts/bench safe_motion` runs thousands of disturbed motions without ROS.
"""

from collections.abc import Callable
from functools import partial
import os
import signal
import time
from typing import Any

from disturbed_arm import Array, disturbed_arm, DisturbedArm, middle, urdf_of
from interruption_bench import URDF as DEFAULT_WITH_LIMITS
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from ros_harness import RosClient

soak = pytest.mark.soak
GAP = 0.042
"""[s] without joint states, which is less than `state_timeout`."""
TRACKING = 0.02
"""[rad] by which the arm may leave the hull of its reference."""
OVERSPEED = 1.2
"""Largest speed after a wrong velocity, by the velocity limit."""
AT_REST = 0.01
"""[rad/s]"""
SLOW, FROZEN_SLOW = 0.05, 0.3
"""[rad/s] 0.6 s after the disturbance: of all joints, and of a joint without a sensor."""
TICK = 1.0 / 500.0


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
    bench.run(6.0, lambda: bool((bench.plant.q[j] - start[j]) / way[j] >= share))


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
            bench.send((0.0, goal))
            run_to(bench, goal, share)
            bench.gap(GAP)
            bench.send((0.0, other))
            bench.run(5.0, partial(bench.rests_at, other))
            hull = (start, goal, other)
            worst = np.maximum(worst, (bench.excess(*hull), bench.reference_excess(*hull)))
            seen(f'{worst[0]:.4f} rad, reference {worst[1]:.4f}, speed {bench.peak_speed():.2f}')
            assert bench.reference_excess(*hull) < 1e-3  # the start is that of the arm
            assert bench.excess(*hull) < TRACKING
            assert bench.beyond_limits() <= 0.0
            assert bench.peak_speed() < 1.05
            assert bench.rests_at(other)


@pytest.mark.parametrize('name', ['z1', *(
    pytest.param(name, marks=soak) for name in ('default', 'panda', 'ur10'))])
def test_slower_states_and_a_second_goal(client: RosClient, name: str, seen: Any) -> None:
    """The rate of the joint states drops from 500 to 100 and 30 Hz during a motion."""
    with disturbed_arm(client, name) as bench:
        bench.run(0.1)
        start, goal = bench.q[0], alternating(bench, 1.0)
        bench.send((0.0, goal))
        run_to(bench, goal, 0.3)
        for k, rate in enumerate((100.0, 30.0, 100.0)):
            bench.period = round(1e9 / rate)
            bench.run(0.2)
            bench.send((0.0, (start, goal, start)[k]))
        bench.run(5.0, lambda: bench.rests_at(start))
        seen(f'hull {bench.excess(start, goal):.4f} rad, speed {bench.peak_speed():.2f}')
        assert bench.reference_excess(start, goal) < 1e-6
        assert bench.excess(start, goal) < TRACKING
        assert bench.peak_speed() < 1.05
        assert bench.rests_at(start)


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
        bench.send((0.0, goal))
        run_to(bench, goal, share)
        bench.begin()
        j = int(kind[-1]) if kind[-1].isdigit() else 0
        bench.measure = {
            'sign': reversed_sign(j), 'zero': zero, 'in degrees': in_degrees,
            'frozen': frozen(j, float(bench.plant.q[j]), float(bench.plant.v[j])),
        }[kind.rstrip(' 01')]
        bench.run(0.6)
        # What gravity does later to a joint without a sensor is unknown.
        others = np.arange(len(goal)) != (j if 'frozen' in kind else -1)
        speeds = np.abs(bench.v[-50:]).max(axis=0)
        seen(f'speed {bench.peak_speed():.2f}, after 0.6 s {speeds[others].max():.4f} rad/s, all '
             f'{speeds.max():.4f}')
        bench.run(0.4)
        seen(f'speed within 1 s {bench.peak_speed():.2f}')
        assert bench.peak_speed() < OVERSPEED
        assert speeds[others].max() < SLOW
        assert speeds.max() < (FROZEN_SLOW if 'frozen' in kind else SLOW)
        assert bench.beyond_limits() <= 0.0
        if 'frozen' in kind:
            bench.status('command', lambda s: 'frozen_joint' in s.message)
        else:
            status = bench.status('joint states', lambda s: 'velocity of' in s.message)
            assert bench.names[j] in status.message or 'sign' not in kind


# ------------------------------------------------------------------ ends of streams


def stream(bench: DisturbedArm, speed: Array, ends: Array, period: float = 0.02) -> None:
    """Send set-points that accelerate to `speed` (n,) [rad/s] until `ends`, and then nothing."""
    start = bench.q[-1]
    duration = 2.0 * float((np.abs(ends - start) / speed).max())
    count = max(round(duration / period), 1)
    for i in range(1, count + 1):
        way = ends - start
        bench.send((0.0, start + (i / count)**2 * way), velocity=2.0 * i / count**2 / period * way)
        bench.run(period)
    bench.begin()
    bench.run(2.0)


@pytest.mark.parametrize('share', [pytest.param(0.4, marks=soak), 0.9])
@pytest.mark.parametrize('name', ['ur5', 'panda', 'xarm7', *(
    pytest.param(name, marks=soak) for name in ('ur10', 'z1'))])
def test_a_stream_that_ends_at_a_position_limit(
    client: RosClient, name: str, share: float, seen: Any,
) -> None:
    """Moving set-points inside the limits, and then silence: the arm stays inside."""
    arm = load_arm(urdf_of(name), *([f'panda_joint{i + 1}' for i in range(7)],) * (
        name == 'panda'))
    limits, start = arm.limits, middle(arm)
    moves = np.arange(len(start)) % 3 != 1  # joints 1 and 4 bear most of gravity
    start = np.where(moves, limits.upper - np.minimum(1.0, limits.upper - start), start)
    ends = np.where(moves, limits.upper - 1e-3, start)
    with disturbed_arm(client, name, start, paced=True) as bench:
        bench.run(0.1)
        stream(bench, share * limits.velocity, ends)
        seen(f'{bench.beyond_limits():.4f} rad beyond, speed {bench.peak_speed():.2f}')
        assert bench.beyond_limits() <= 0.0
        assert bench.reference_excess(limits.lower, limits.upper) <= 0.0
        assert bench.last_speed() < SLOW


@pytest.mark.parametrize('slow', [pytest.param(0.05, marks=soak), 0.2])
def test_a_stream_of_a_fast_and_a_slow_joint_ends(
    client: RosClient, slow: float, seen: Any,
) -> None:
    """The slow joint is near its limit, and does not wait for the stop of the fast one."""
    limit = load_arm(DEFAULT_WITH_LIMITS).limits
    start = np.array([-1.0, limit.upper[1] - 0.02 - slow])
    with disturbed_arm(client, 'default', start, urdf=DEFAULT_WITH_LIMITS, paced=True) as bench:
        bench.run(0.1)
        stream(bench, np.array([0.9 * limit.velocity[0], slow]),
               np.array([0.8, limit.upper[1] - 2e-3]))
        seen(f'{bench.beyond_limits():.4f} rad beyond, speed {bench.peak_speed():.2f}')
        assert bench.beyond_limits() <= 0.0
        assert bench.last_speed() < SLOW


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
    with disturbed_arm(client, name, paced=True) as bench:
        bench.run(0.1)
        goal = alternating(bench, 1.5)
        bench.send((0.0, goal))
        run_to(bench, goal, 0.55)  # slower from here on, however late the request arrives
        bench.begin()
        start, speed = bench.plant.q.copy(), float(np.abs(bench.plant.v).max())
        began = time.monotonic()
        bench.ends = True
        end(bench)
        bench.run(5.0, lambda: not bench.effort.any())
        duration = time.monotonic() - began
        v = np.abs(bench.v[bench.begun:]).max(axis=1)
        at_rest = int(np.argmax(v < AT_REST))
        rest = bench.q[bench.begun + at_rest]
        ramp = ramp_speed(bench, rest)
        seen(f'{speed:.2f} rad/s, at rest after {at_rest * TICK:.2f} s and '
             f'{np.abs(rest - start).max():.2f} rad, zero after {duration:.2f} s at '
             f'{v[-1]:.2f} rad/s, {ramp:.2f} by the ramp')
        assert at_rest, 'the arm did not stop'
        assert v[:at_rest].max() < 1.1 * speed
        assert v[at_rest:at_rest + 40].max() < AT_REST
        assert v[-1] < 1.2 * ramp + 0.1
        assert duration < 5.0


def ramp_speed(bench: DisturbedArm, rest: Array, ramp_time: float = 0.5) -> float:
    """Return the speed of the arm after a ramp of the effort to zero from rest [rad/s]."""
    plant = ArmSimulation(bench.arm, rest)
    plant.release()
    hold = ArmDynamics(bench.arm).rigid_body.gravity(rest)
    for t in np.arange(0.0, ramp_time, TICK):
        plant.step((1.0 - t / ramp_time) * hold, TICK)
    return float(np.abs(plant.v).max())


# ------------------------------------------------------------------ the start, and loads


@pytest.mark.parametrize(('name', 'speed'), [
    ('ur10', 0.3), *(pytest.param(*one, marks=soak) for one in (
        ('ur10', -0.8), ('default', 0.3), ('panda', 0.3), ('xarm7', 0.5), ('z1', -0.3)))])
def test_the_node_starts_while_the_arm_moves(
    client: RosClient, name: str, speed: float, seen: Any,
) -> None:
    """The arm stops from the measured state, and is held."""
    with disturbed_arm(client, name, velocity=speed) as bench:
        bench.run(2.0)
        moved = np.abs(bench.plant.q - bench.q[0]).max()
        seen(f'after 2 s {bench.last_speed():.4f} rad/s, {moved:.3f} rad from the start, '
             f'at most {np.abs(bench.v).max():.2f} rad/s')
        assert np.abs(bench.v).max() < 1.2 * abs(speed)
        assert bench.last_speed() < 1e-3
        assert moved < 0.5 * abs(speed)


@pytest.mark.parametrize(('name', 'load', 'sag'), [
    ('default', 0.5, 0.05), *(pytest.param(*one, marks=soak) for one in (
        ('ur5', 0.5, 0.05), ('ur10', 0.5, 0.05), ('panda', 0.5, 0.05), ('z1', 0.5, 0.1)))])
def test_the_arm_is_held_from_the_start_with_a_load_that_the_node_does_not_know(
    client: RosClient, name: str, load: float, sag: float, seen: Any,
) -> None:
    with disturbed_arm(client, name, load=load) as bench:
        bench.run(3.0, lambda: np.abs(bench.plant.v).max() > 10.0)
        moved = np.abs(bench.q - bench.q[0]).max()
        seen(f'{moved:.3f} rad, at most {np.abs(bench.v).max():.2f} rad/s, at the end '
             f'{bench.last_speed():.4f} rad/s')
        assert moved < sag
        assert bench.last_speed() < AT_REST


@pytest.mark.parametrize(('load', 'sag', 'most'), [(3.0, 0.2, 0.25), (4.0, 0.25, 0.7)])
@pytest.mark.parametrize('start', [[0.8, 0.5], pytest.param([0.0, 0.0], marks=soak),
                                   pytest.param([-0.6, 1.2], marks=soak)], ids=str)
def test_a_load_that_the_node_does_not_know_at_a_low_rate(
    client: RosClient, start: list[float], load: float, sag: float, most: float, seen: Any,
) -> None:
    """At 125 Hz the gains are scaled for the rate; the falling load is caught, and sags."""
    with disturbed_arm(client, 'default', start, rate=125.0) as bench:
        bench.run(0.1)
        bench.send((0.0, start))
        bench.run(0.2)
        bench.add_load(load)
        bench.run(4.0, lambda: np.abs(bench.plant.v).max() > 10.0)
        moved, peak = np.abs(bench.plant.q - start).max(), np.abs(bench.q - start).max()
        seen(f'{moved:.3f} rad, at most {peak:.3f} rad, {bench.last_speed():.4f} rad/s')
        assert moved < sag
        assert peak < most
        assert bench.last_speed() < AT_REST
