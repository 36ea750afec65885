# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the gravity torque of a fit says about arm and mount, by that of the URDF."""

from collections.abc import Sequence

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import inertial_parameters, TorqueRegressor

FAR = 2.0
"""
Ratio of the gravity torque at a joint to that of the URDF that suggests another arm.

ln 2 is two standard deviations of a URDF whose masses are wrong by a third, all in one sense.
"""
TWICE = 1.6, 2.5
"""Size of gravity, by that of the URDF, that suggests that it is added twice."""
_LEAST_SHARE = 0.2
LEAST_TILT = np.radians(3.0)
LEAST_GRAVITY = 0.5
"""Size of gravity, by that of the URDF, below which the effort lacks it; a tilt keeps it."""


def gravity_ratios(arm: ArmModel, phi: FloatArray, q: FloatArray) -> FloatArray:
    """
    Return the RMS (n,) of the gravity torque of bodies φ (p,) by that of the arm, at q (m, n).

    It is 1 at joints with less than a fifth of the largest torque. `arm` has no payload.
    """
    rest = np.zeros_like(q)
    Y = TorqueRegressor(arm)(q, rest, rest)
    found, described = (np.sqrt(np.mean((Y @ each)**2, axis=0))
                        for each in (phi, inertial_parameters(arm)))
    bears = np.maximum(found, described)
    counts = (bears > _LEAST_SHARE * bears.max()) & (np.minimum(found, described) > 0.0)
    return np.asarray(np.divide(found, described, out=np.ones_like(found), where=counts))


def far_from_urdf(names: Sequence[str], ratios: FloatArray) -> tuple[str, ...]:
    """Return a sentence if a gravity ratio of the named joints is far from 1."""
    worst = int(np.argmax(np.abs(np.log(ratios))))
    if 1.0 / FAR <= ratios[worst] <= FAR:
        return ()
    low, high = TWICE
    is_twice = all(low <= ratio <= high for ratio in ratios.tolist() if ratio != 1.0)
    return (f'the gravity torque at {names[worst]} is {ratios[worst]:.2g} times that of the URDF: '
            'another arm, another URDF, or a load that is not given'
            + (', or gravity is added twice' if is_twice else ', or the effort is a current '
               '(`identify --effort current`)' if ratios[worst] < 1.0 else ''),)


def gravity_cause(g: FloatArray, found: FloatArray) -> str:
    """Return the cause if gravity `found` (3,) fits better than that of the model, g (3,)."""
    size = float(np.linalg.norm(found) / np.linalg.norm(g))
    if size < LEAST_GRAVITY:
        return ('the effort lacks gravity (`measured_effort: joint_torque_without_gravity`), or '
                'the robot compensates it')
    angle = float(np.arccos(np.clip(found @ g / np.linalg.norm(g)**2 / size, -1.0, 1.0)))
    if angle < LEAST_TILT:
        is_twice = TWICE[0] <= size <= TWICE[1]
        return (f'the effort of gravity is {size:.2g} times that of the URDF: '
                f'{"gravity is added twice, " if is_twice else ""}another arm, another URDF, a '
                'load, or another unit of the effort')
    listed = ', '.join(f'{x:.3g}' for x in found / size)
    return (f'the base is tilted by {np.degrees(angle):.0f}°: gravity is about ({listed}) m/s² '
            'in its frame (parameter `gravity`)')
