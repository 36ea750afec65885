# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a velocity that contradicts its position is called, with the probable cause."""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray

SHORT = 0.02
"""[s] of a window that may begin before the velocities were wrong."""


def reversal_ratio(positions: FloatArray, differences: FloatArray) -> float | None:
    """
    Return the ratio of the path by velocities to that by positions if the joint reversed, or None.

    `differences` are those of the integral and the position, both (m,). After a reversal the
    displacement of the window states neither scale nor sign; equal paths leave the sign.
    """
    steps = np.diff(positions)
    path = float(np.abs(steps).sum())
    if not abs(float(steps.sum())) < 0.9 * path:
        return None
    ratio = float(np.abs(steps + np.diff(differences)).sum()) / path
    return -1.0 if 0.7 < ratio < 1.3 else ratio


def describe(
    name: str, length: float, integral: float, moved: float, v: float, reversal: float | None,
) -> str:
    """Return what contradicts what, and the probable cause; v is the last velocity."""
    ratio = integral / moved if moved else math.inf
    if moved and v == 0.0:
        ratio = 0.0
    elif reversal is not None:
        ratio = reversal
    elif moved and length <= SHORT and v * moved < 0.0:
        ratio = v * length / moved  # the integral contains true velocities
    if abs(ratio) < 0.1:
        cause = 'velocity is zero or missing'
    elif -4.0 < ratio < 0.0:
        cause = 'wrong sign'
    elif 20.0 < abs(ratio) < 75.0:
        cause = f'about {ratio:.0f} times the displacement: degrees instead of radians?'
    elif abs(ratio) < 1e3:
        cause = f'{ratio:.2g} times the displacement'
    else:
        cause = 'the position does not move'
    return (f'velocity of {name!r} is {integral / length:.2g}, but its position moved by '
            f'{moved:.2g} in {1e3 * length:.0f} ms: {cause}')
