# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A block on a rail with dry friction: its motion is known in closed form."""

import numpy as np
import pytest
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from simulated_arms import block, released

MASS, DRY = 3.0, 6.0
EXACT = 1e-12


def moving(velocity: float = 0.0, slope: float = 0.0, **friction: float) -> ArmSimulation:
    """Return a block on a rail that descends by `slope` [rad] along its axis."""
    axis = float(np.cos(slope)), 0.0, -float(np.sin(slope))
    return released(block(MASS, axis, **friction), [0.0], [velocity])


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_push_a_slide_and_a_stop(sign):
    """A push F gives (F − F_c)/m; then the block slides v²/(2 F_c/m) in v/(F_c/m) and sticks."""
    force, pushed = 15.0, 0.4
    simulation = moving(coulomb=DRY)
    q, v = simulation.step(np.array([sign * force]), pushed)
    gain, loss = (force - DRY) / MASS, DRY / MASS
    assert v == pytest.approx([sign * gain * pushed], rel=EXACT)
    assert q == pytest.approx([sign * gain * pushed**2 / 2.0], rel=EXACT)

    speed, way = gain * pushed, gain * pushed**2 / 2.0
    until = speed / loss
    q, v = simulation.step(np.zeros(1), 0.5 * until)
    assert v == pytest.approx([sign * 0.5 * speed], rel=EXACT)
    q, v = simulation.step(np.zeros(1), 0.5 * until + 0.01)
    assert v.tolist() == [0.0]
    assert q == pytest.approx([sign * (way + speed**2 / (2.0 * loss))], rel=EXACT)
    assert simulation.heat == pytest.approx(DRY * abs(q[0]), rel=1e-11)
    assert simulation.work == pytest.approx(force * way, rel=1e-11)
    assert simulation.step(np.array([sign * 0.999 * DRY]), 60.0).position.tolist() == q.tolist()


@pytest.mark.parametrize('fraction', [0.99, 1.01])
def test_on_a_slope_it_slides_from_the_angle_of_friction_on(fraction):
    """
    It sticks for m g sin(slope) ≤ F_s, and otherwise slides with g sin(slope) − F_c/m.

    The decrease from F_s to F_c lasts about 1e-5 s here.
    """
    static = 1.2 * DRY
    slope = float(np.arcsin(fraction * static / (MASS * 9.81)))
    simulation = moving(slope=slope, coulomb=DRY, static=static, stribeck_velocity=1e-6)
    q, v = simulation.step(np.zeros(1), 0.5)
    if fraction < 1.0:
        assert (q.tolist(), v.tolist()) == ([0.0], [0.0])
    else:
        assert v == pytest.approx([0.5 * (9.81 * np.sin(slope) - DRY / MASS)], rel=1e-4)
