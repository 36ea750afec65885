# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The faults of a measured motion: a joint beyond its range, too fast, or without a signal."""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.control.safety.faults import (
    Fault,
    FROZEN_JOINT,
    OVERSPEED,
    POSITION_LIMIT,
    STATE_TIMEOUT,
)
from robot_dynamics.trajectories.goal_limits import POSITION_TOLERANCE

FAR = 1.0
"""[rad] past a limit from which the positions may be in degrees."""
OVERSPEED_FACTOR = 1.2
"""Multiple of a velocity limit above which a fault occurs: references reach the limit itself."""


def beyond_a_limit(
    names: tuple[str, ...], limits: EffortLimits, q: FloatArray,
) -> Fault | None:
    """Return the fault of a position q (n,) that is POSITION_TOLERANCE past a limit."""
    past = np.maximum(q - limits.upper, limits.lower - q)
    j = int(np.argmax(past))
    if not past[j] > POSITION_TOLERANCE:
        return None
    as_degrees, words = np.radians(q), ''
    if past[j] > FAR and (np.abs(as_degrees - np.clip(
            as_degrees, limits.lower, limits.upper)) <= POSITION_TOLERANCE).all():
        words = '; are the positions in degrees? Radians are expected'
    return Fault(
        POSITION_LIMIT, f'position of {names[j]!r} is {q[j]:g}, {past[j]:g} past its limit, '
        f'expected at most {POSITION_TOLERANCE:g}{words}', recovery=5)


def too_fast(
    names: tuple[str, ...], limits: EffortLimits, v: FloatArray,
) -> Fault | None:
    """Return the fault of a velocity v (n,) above OVERSPEED_FACTOR times its limit."""
    ratio = np.abs(v) / limits.velocity
    j = int(np.argmax(ratio))
    return None if not ratio[j] > OVERSPEED_FACTOR else Fault(
        OVERSPEED, f'velocity of {names[j]!r} is {v[j]:g}, {ratio[j]:.3g} times its limit, '
        f'expected at most {OVERSPEED_FACTOR:g} times')


def frozen_joint(names: tuple[str, ...], lost: BoolArray) -> Fault:
    """Return the fault of joints that are `lost` (n,)."""
    found = [name for name, is_lost in zip(names, lost) if is_lost]
    return Fault(
        FROZEN_JOINT, f'the position of {found} has not changed for more than '
        f'{STATE_TIMEOUT:g} s, although it has to move: check brake, encoder and driver',
        recovery=25)
