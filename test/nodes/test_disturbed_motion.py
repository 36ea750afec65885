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

from disturbed_arm import alternating, Array, disturbed_arm, run_to
import numpy as np
import pytest

GAP = 0.042
"""[s] without joint states, which is less than `state_timeout`."""
TRACKING = 0.02
"""[rad] by which the arm may leave the hull of its reference."""
OVERSPEED = 1.2
"""Largest speed after a wrong velocity, by the velocity limit."""
SLOW = 0.05
"""[rad/s] of all joints, after the stop that a disturbance has caused."""


# ------------------------------------------------------------------ gaps

@pytest.mark.parametrize(('share', 'second'), [(0.35, -0.5), (0.9, 1.7)])
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


@pytest.mark.parametrize(('name', 'kind'), [('panda', 'sign'), ('ur10', 'frozen')])
def test_a_wrong_measurement_during_a_motion(client, name, kind, seen):
    """The speed stays below 1.2 times its limit, and the arm stops."""
    with disturbed_arm(client, name) as bench:
        bench.run(0.1)
        goal = alternating(bench, 1.5)
        bench.send(goal)
        run_to(bench, goal, 0.4)
        bench.begin()
        bench.measure = reversed_sign(1) if kind == 'sign' else frozen(
            1, float(bench.plant.q[1]), float(bench.plant.v[1]))
        bench.run(0.6)
        bench.run(3.0, lambda: bool(np.abs(bench.v[-50:]).max() < SLOW))
        bench.run(0.5)
        speed = float(np.abs(bench.v[-50:]).max())
        passed = bench.times[-1] - bench.times[bench.begun]
        seen(f'speed {bench.peak_speed():.2f}, after {passed:.1f} s {speed:.4f} rad/s')
        assert speed < SLOW
        assert bench.peak_speed() < OVERSPEED
        assert bench.beyond_limits() <= 0.0
        if kind == 'frozen':
            bench.status('command', lambda s: 'frozen_joint' in s.message)
        else:
            status = bench.status('joint states', lambda s: 'velocity of' in s.message)
            assert bench.names[1] in status.message
