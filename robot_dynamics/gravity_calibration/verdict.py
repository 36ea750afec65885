# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict on the calibration of each joint, and the next step."""

from robot_dynamics.gravity_calibration.calibration import (
    Calibration,
    LEAST_POSES,
    Reference,
)
from robot_dynamics.joints.drive_effort import LARGEST_OFFSET, LARGEST_SCALE, LEAST_SCALE
from robot_dynamics.reporting.html_page import Grade, Verdict

GOOD_SCALE, GOOD_OFFSET = 0.01, 0.02
"""Half widths of the 95 % intervals of a good calibration: of the scale, and of the limit."""
UNLOADED = 0.01
"""A joint bears no gravity if its torque varies by less than this fraction of that of others."""
RULE = (
    f'Rule: good if the 95 % interval of the scale is within ±{100.0 * GOOD_SCALE:g} % and that '
    f'of the offset within ±{100.0 * GOOD_OFFSET:g} % of the effort limit, check if not, bad if '
    f'the scale is not in [{LEAST_SCALE:g}, {LARGEST_SCALE:g}] or the offset above '
    f'{100.0 * LARGEST_OFFSET:g} % of the effort limit, unknown if the holds do not determine the '
    'scale.')
USE = 'use the written parameter file'
SIDES = ('approach each pose by a motion of this joint in the positive direction, and again in '
         'the negative direction, without overshoot, and hold it for 1 s or longer')
POSES = 'add poses in which the gravity torque of this joint differs more'
WEIGHT = f'{POSES}, or attach the weight at a larger distance from the axis of this joint'
OTHER_SOURCE = ('tilt the base so that gravity loads this joint, or set the scale of a joint with '
                'the same drive; for gravity compensation nothing is missing')
UNITS = ('check the unit of the effort (`measured_effort`), the joint names (`--map`), the '
         'direction of gravity, and the masses of the URDF, the tool and the weight')


def joint_verdicts(found: Calibration) -> list[Verdict]:
    """Return the verdict on each joint."""
    return [_verdict(found, j) for j in range(found.arm.joint_count)]


def is_accepted(found: Calibration) -> bool:
    """Return whether the nodes accept the scale and the offset of each joint."""
    return not any(verdict.grade is Grade.BAD for verdict in joint_verdicts(found))


def _verdict(found: Calibration, j: int) -> Verdict:
    name, unit = found.arm.joint_names[j], effort_unit(found, j)
    limit = float(found.arm.given_drive.limit[j])
    offset, of_offset = float(found.offset[j]), float(found.offset_interval[j])
    if not found.has_enough_poses[j]:
        return Verdict(name, Grade.UNKNOWN, (
            f'approached from both sides in {found.pose_count[j]} poses, expected at least '
            f'{LEAST_POSES}: scale {found.scale[j]:.4g} and offset {offset:.3g} {unit} are '
            'kept'), SIDES)
    at_zero = f'offset {offset:.3g} ± {of_offset:.2g} {unit}'
    if abs(offset) > LARGEST_OFFSET * limit:
        return Verdict(name, Grade.BAD, (
            f'{at_zero} is above {100.0 * LARGEST_OFFSET:g} % of the effort limit '
            f'{limit:g} {unit}'), UNITS)
    if not found.is_observable[j]:
        return _unobservable(found, j, at_zero)
    scale, of_scale = float(found.scale[j]), float(found.scale_interval[j])
    text = f'scale {scale:.4g} ± {of_scale:.2g}, {at_zero}'
    if not LEAST_SCALE <= scale <= LARGEST_SCALE:
        return Verdict(name, Grade.BAD, (
            f'{text}: the scale is not in [{LEAST_SCALE:g}, {LARGEST_SCALE:g}]'), UNITS)
    if of_scale <= GOOD_SCALE * scale and of_offset <= GOOD_OFFSET * limit:
        return Verdict(name, Grade.GOOD, text, USE)
    return Verdict(name, Grade.CHECK, text, _more(found))


def _unobservable(found: Calibration, j: int, at_zero: str) -> Verdict:
    name, unit = found.arm.joint_names[j], effort_unit(found, j)
    kept = f'scale {found.scale[j]:.4g} is kept; {at_zero}'
    if found.reachable_range[j] <= UNLOADED * found.reachable_range.max() and (
            found.torque_range[j] <= UNLOADED * found.reachable_range.max()):
        return Verdict(name, Grade.UNKNOWN, (
            f'gravity does not load this joint: {kept}'), OTHER_SOURCE)
    return Verdict(name, Grade.UNKNOWN, (
        f'the gravity torque varies by {found.torque_range[j]:.3g} {unit} in the poses, within '
        f'the limits by {found.reachable_range[j]:.3g} {unit}; the effort has the standard '
        f'deviation {found.noise[j]:.2g} {unit}: {kept}'), _more(found))


def _more(found: Calibration) -> str:
    return WEIGHT if found.reference is Reference.WEIGHT else POSES


def effort_unit(found: Calibration, j: int) -> str:
    return 'N' if found.arm.joint_kinds[j] == 'prismatic' else 'N·m'


