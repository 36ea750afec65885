# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Presliding hysteresis of Coulomb friction.

After a velocity reversal, contacts yield like a spring before they slide.
A state z in [−1, 1] that follows the *displacement* replaces the sign of velocity: dz = dq / d
within the bounds, with the presliding distance d. This is Maxwell's slip element, or the stop
operator of Prandtl and Ishlinskii, and independent of the speed. Source: F. Al-Bender, V.
Lampaert, J. Swevers, "The generalized Maxwell-slip model", IEEE Trans. Automatic Control 50(11),
2005.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign


def presliding_state(
    position: FloatArray, velocity: FloatArray, distance: FloatArray,
) -> FloatArray:
    """
    Return z along a motion, (m, n), which replaces the sign of Coulomb friction at each sample.

    `position` (m, n) [rad] or [m] and `velocity` are in the order of time, `distance` (n,) is d.
    A joint with d = 0 has the smooth sign of its velocity (`friction.smooth_sign`). The first z is
    the sign of the first velocity, because the motion before it is unknown.
    """
    z = smooth_sign(velocity, SMOOTHING_VELOCITY)
    if len(z) == 0:
        return z
    for joint in np.flatnonzero(distance > 0.0):
        step = np.diff(position[:, joint]) / distance[joint]
        value = float(np.sign(velocity[0, joint]))
        values = [value]
        for change in step.tolist():
            value += change
            value = 1.0 if value > 1.0 else -1.0 if value < -1.0 else value
            values.append(value)
        z[:, joint] = values
    return z
