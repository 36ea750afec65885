# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Calibration of effort scale and offset of each joint from static holds.

The true joint torque is τ = s (e − o), with the driver's effort e on the joint side, the effort
scale s and the offset o. At rest, τ is the gravity torque. Scale and mass are confounded: if s
and all masses change by one factor, the efforts are the same. `Reference` lists what determines
the scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_calibration import EffortCalibration
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.worst_gravity import sample_positions
from robot_dynamics_tools.estimation.effort_fit import EffortFit, NORMAL, Spread
from robot_dynamics_tools.estimation.priors import unknown_drives
from robot_dynamics_tools.gravity_calibration import scale_fit
from robot_dynamics_tools.gravity_calibration.holds import Hold, pair_holds, PairedHolds

LEAST_POSES = 4
"""Smallest number of poses that a joint must approach from both sides."""
UNOBSERVABLE = 0.1
"""Relative standard deviation from which on a scale is not observable."""
_SAME = 1e-9
"""Relative singular value below which gravity parameters have no effect on the poses."""


class ScaleReference(Enum):
    """What determines the effort scales; the value states the assumption."""

    WEIGHT = ('The known weight determines the scales. Scales and offsets do not depend on the '
              'masses of the URDF.')
    TOOL = ('Assumed: the mass of the tool, and the masses and centres of mass of the URDF, are '
            'right. If all masses are too high by 1 %, all scales are too high by 1 %.')
    URDF = ('Assumed: the masses and centres of mass of the URDF are right. If all masses are too '
            'high by 1 %, all scales are too high by 1 %.')


class HoldSet(NamedTuple):
    """Holds with the same load: the tool, and a known weight or None."""

    paired: PairedHolds
    weight: Payload | None = None

    @property
    def title(self) -> str:
        return 'without weight' if self.weight is None else 'with the weight'


@dataclass(frozen=True, eq=False)
class Calibration:
    """
    Effort scale (n,) and offset (n,) [N·m] or [N] of an arm.

    They have half widths of the 95 % intervals (n,), infinite if kept, and the `covariance`
    (2n, 2n) of all scales, then all offsets, which is never infinite: a scale that is kept has the
    deviation of `unknown_drives`, and so has an offset. Few residuals enlarge it as the
    intervals, so that ±1.96 deviations contain the truth in 95 %.
    A joint that `is_observable` does not mark keeps its previous scale; one with fewer than
    LEAST_POSES poses (`pose_count`) also keeps its previous offset. `noise` is the standard
    deviation of the effort at a pose, `torque_range` the range of the gravity torque in the poses,
    `reachable_range` its range within the position limits, all (n,) [N·m] or [N].
    `times` (P,) [s], `measured` and `model` (P, n) are the effort at the poses of all sets, NaN
    where a joint was not approached from both sides.
    """

    arm: ArmModel
    reference: ScaleReference
    sets: tuple[HoldSet, ...]
    tool: scale_fit.ToolEstimate | None
    scale: FloatArray
    offset: FloatArray
    scale_interval: FloatArray
    offset_interval: FloatArray
    covariance: FloatArray
    is_observable: BoolArray
    pose_count: IntArray
    noise: FloatArray
    torque_range: FloatArray
    reachable_range: FloatArray
    condition: float
    times: FloatArray
    measured: FloatArray
    model: FloatArray

    @property
    def has_enough_poses(self) -> BoolArray:
        return np.asarray(self.pose_count >= LEAST_POSES)


def calibrate_holds(
    arm: ArmModel, without_weight: Sequence[Hold], with_weight: Sequence[Hold] = (),
    weight: Payload | None = None, tool: scale_fit.Tool | None = None,
) -> Calibration:
    """
    Return the calibration from holds, those `with_weight` with a known weight on a link.

    `arm` is that of the URDF, with its gravity. The values of its report are kept if the holds do
    not determine them. Raises InvalidInputError if there are too few
    poses, no scale is observable, a link is unknown, or the mass of the tool is needed.
    """
    if bool(with_weight) != (weight is not None):
        raise InvalidInputError(
            f'there are {len(with_weight)} holds with a weight, and the weight is {weight!r}, '
            'expected both or none')
    sets = [HoldSet(pair_holds(without_weight, arm.joint_kinds))]
    if weight is not None:
        if arm.link_frame(weight.link, 'link').parentJoint == 0:
            raise InvalidInputError(
                f'the weight is on {weight.link!r}, which is fixed to the base, expected a link '
                'that joints move')
        sets.append(HoldSet(pair_holds(with_weight, arm.joint_kinds), weight))
    for one in sets:
        count = len(one.paired.times)
        if count < LEAST_POSES:
            raise InvalidInputError(
                f'{len(one.paired.holds)} holds {one.title} have {count} poses that a joint '
                f'approached from both sides, expected at least {LEAST_POSES}: hold each pose for '
                '1 s or longer after a motion in the positive direction, and again after one in '
                'the negative direction')
    if tool is not None and tool.mass is None and weight is None:
        raise InvalidInputError(
            'the mass of the tool is not given, expected it, or holds with a known weight: effort '
            'scale and mass are confounded')
    reference = ScaleReference.WEIGHT if weight is not None else (
        ScaleReference.TOOL if tool is not None else ScaleReference.URDF)
    counts = np.sum([one.paired.is_paired.sum(axis=0) for one in sets], axis=0)
    seen, basis = _observations(arm, sets, tool, reference)
    n, has_enough = arm.joint_count, counts >= LEAST_POSES
    seen = replace(seen, is_used=seen.is_used & has_enough)
    previous = arm.given_report
    fit, is_observable = _fit(seen, arm, 1.0 / previous.scale)
    torque = seen.torque(fit)
    scale, offset = _values(seen, torque, fit, is_observable, has_enough, previous)
    used = np.where(seen.is_used, 1.0, np.nan)
    spread = fit.spread(np.eye(2 * n, len(fit.values)))
    return Calibration(
        arm, reference, tuple(sets),
        None if tool is None else scale_fit.estimate_tool(
            arm, tool, weight is not None, basis, fit),
        scale, offset,
        np.where(is_observable, spread.interval[:n] * scale**2, np.inf),
        np.where(has_enough, spread.interval[n:], np.inf),
        _covariance(arm, seen, fit, spread, scale, is_observable, has_enough), is_observable,
        counts, np.sqrt(fit.variances),
        np.array([np.ptp(torque[rows, j]) if rows.any() else 0.0
                  for j, rows in enumerate(seen.is_used.T)]),
        np.ptp(RigidBody(arm).gravity_batch(sample_positions(arm, 128)), axis=0),
        fit.solution.condition, np.concatenate([one.paired.times for one in sets]),
        used * seen.effort, used * (torque / scale + offset))


def _covariance(
    arm: ArmModel, seen: scale_fit.Observations, fit: EffortFit, spread: Spread, scale: FloatArray,
    is_observable: BoolArray, has_enough: BoolArray,
) -> FloatArray:
    """Return the covariance (2n, 2n) of s and o, from that of k = 1 / s and o."""
    n = len(scale)
    is_known = np.concatenate([is_observable, has_enough & ~fit.solution.is_lost[n:2 * n]])
    ratio = np.divide(
        spread.interval, NORMAL * spread.deviation, out=np.zeros(2 * n), where=is_known)
    slope = ratio * np.concatenate([-scale**2, np.ones(n)])
    limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort,
                     np.abs(seen.effort).max(axis=0))
    return np.asarray(np.where(
        np.outer(is_known, is_known), fit.covariance[:2 * n, :2 * n] * np.outer(slope, slope),
        unknown_drives(scale, limit)))


def _observations(
    arm: ArmModel, sets: Sequence[HoldSet], tool: scale_fit.Tool | None,
    reference: ScaleReference,
) -> tuple[scale_fit.Observations, FloatArray]:
    """Return the equations of all sets, and the gravity parameters (4 × bodies, k) of β."""
    Y = np.concatenate([
        one.paired.mean(scale_fit.gravity_regressor(arm, one.paired.positions)) for one in sets])
    effort = np.concatenate([one.paired.effort for one in sets])
    is_used = np.concatenate([one.paired.is_paired for one in sets])
    T = np.zeros((Y.shape[2], 4)) if tool is None else scale_fit.link_columns(arm, tool.link)
    known = np.concatenate([one.paired.mean(
        RigidBody(arm.with_payloads([*arm.payloads, *filter(None, [one.weight])])).gravity_batch(
            one.paired.positions)) for one in sets])
    if tool is not None and tool.mass is not None:
        known += Y @ (tool.mass * T[:, 0])
    basis = T[:, :0] if tool is None else T[:, 1:]
    if reference is ScaleReference.WEIGHT:
        _, singular, Vt = np.linalg.svd(Y[is_used], full_matrices=False)
        basis = Vt[singular > _SAME * singular[0]].T  # of what determines these rows
    return scale_fit.Observations(effort, known, Y @ basis, is_used), basis


def _fit(
    seen: scale_fit.Observations, arm: ArmModel, assumed: FloatArray,
) -> tuple[EffortFit, BoolArray]:
    """Return the fit, and which joints have an observable scale; the others are `assumed`."""
    n = arm.joint_count
    fit = scale_fit.fit_scales(seen, assumed, np.ones(n, dtype=np.bool_))
    deviation = fit.spread(np.eye(n, len(fit.values))).deviation
    is_observable = seen.is_used.any(axis=0) & (deviation < UNOBSERVABLE * np.abs(fit.values[:n]))
    if not is_observable.any():
        span, noise = np.ptp(seen.torque(fit), axis=0), np.sqrt(fit.variances)
        raise InvalidInputError(
            'no effort scale is observable: the gravity torque in the poses varies by '
            f'{span.round(3).tolist()} N·m at {list(arm.joint_names)}, and the effort has the '
            f'standard deviation {noise.round(3).tolist()}, expected poses in which the gravity '
            'torque differs more')
    if not is_observable.all():
        fit = scale_fit.fit_scales(seen, assumed, is_observable)
    return fit, is_observable


def _values(
    seen: scale_fit.Observations, torque: FloatArray, fit: EffortFit,
    is_observable: BoolArray, has_enough: BoolArray, previous: EffortCalibration,
) -> tuple[FloatArray, FloatArray]:
    """Return scale and offset, of the fit or the previous ones."""
    inverse, offset = fit.values[:2 * len(is_observable)].reshape(2, -1)
    scale = np.where(is_observable, 1.0 / inverse, previous.scale)
    rows = np.maximum(seen.is_used.sum(axis=0), 1)
    with_previous = np.where(seen.is_used, seen.effort - torque / scale, 0.0).sum(axis=0) / rows
    return scale, np.asarray(np.where(
        is_observable, offset, np.where(has_enough, with_previous, previous.offset)))
