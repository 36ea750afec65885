# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of a recording with the model: motion, effort by term, residual, use of the limits.

The measured motion and effort pass the same zero-phase filter (`motion_filter`); the modelled
effort is that of inverse dynamics at the filtered motion (`residual`). Samples near gaps and ends,
where the filter extrapolates, are returned but excluded from the statistics.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.joints.effort_convention import joint_effort_at_rest, MOTOR_SIDE
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics_tools.analysis.arm_recording import (
    AnalysisSettings,
    read_for_arm,
    ReadRecording,
)
from robot_dynamics_tools.analysis.contradictions import corrected
from robot_dynamics_tools.analysis.motion_filter import filter_motion, FilteredMotion
from robot_dynamics_tools.estimation.model_terms import model_terms, TermSeries

_ROUNDING = 1e-12
"""Fraction of the mean square; a signal with a smaller variance is a constant."""


@dataclass(frozen=True, eq=False)
class ResidualStatistics:
    """
    The residual measured − model of m samples at n joints, each (n,).

    RMS, means and largest magnitudes are [N·m] or [N]. `relative` is the RMS of the residual
    divided by that of the measured effort. `r_squared` is 1 − Σ r² / Σ (τ − mean τ)², the fraction
    of the variance that the model explains (at best 1, negative if the mean explains more). Both
    are NaN if the measured effort is zero, or constant.
    """

    joint_names: tuple[str, ...]
    sample_count: int
    rms_measured: FloatArray
    mean_measured: FloatArray
    rms: FloatArray
    mean: FloatArray
    largest: FloatArray

    @property
    def relative(self) -> FloatArray:
        return np.sqrt(_ratio(self.rms**2, self.rms_measured**2))

    @property
    def r_squared(self) -> FloatArray:
        variance = self.rms_measured**2 - self.mean_measured**2
        constant = variance <= _ROUNDING * self.rms_measured**2
        return np.asarray(1.0 - _ratio(self.rms**2, np.where(constant, 0.0, variance)))


def residual_statistics(
    measured: FloatArray, model: FloatArray, joint_names: tuple[str, ...],
) -> ResidualStatistics:
    """Return the statistics of the residual, measured − model, both (m, n), m > 0."""
    residual = measured - model
    return ResidualStatistics(
        tuple(joint_names), len(measured), _rms(measured), np.asarray(measured.mean(axis=0)),
        _rms(residual), np.asarray(residual.mean(axis=0)),
        np.asarray(np.abs(residual).max(axis=0)))


def merged_statistics(parts: Sequence[ResidualStatistics]) -> ResidualStatistics:
    """Return the combined statistics of several parts of the same joints."""
    counts = [part.sample_count for part in parts]

    def mean(field: str, power: int = 1) -> FloatArray:
        values = [getattr(part, field)**power for part in parts]
        return np.asarray(np.average(values, axis=0, weights=counts))

    return ResidualStatistics(
        parts[0].joint_names, sum(counts), np.sqrt(mean('rms_measured', 2)),
        mean('mean_measured'), np.sqrt(mean('rms', 2)), mean('mean'),
        np.max([part.largest for part in parts], axis=0))


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return part / whole, NaN if the whole is 0."""
    safe = np.where(whole > 0.0, whole, 1.0)
    return np.asarray(np.where(whole > 0.0, part / safe, np.nan))


@dataclass(frozen=True, eq=False)
class LimitUse:
    """
    The largest use of the limits, each (n,), NaN for joints without a limit.

    `effort` (measured, or modelled if it was not measured) and `velocity` are fractions of the
    limit; `position` is the smallest distance to a position limit [rad] or [m], negative beyond.
    """

    effort: FloatArray
    velocity: FloatArray
    position: FloatArray


@dataclass(frozen=True, eq=False)
class BagAnalysis:
    """
    A recording compared with the model.

    `measured` (m, n) [N·m] or [N] is None if no effort was recorded, and so are `residual` and
    `statistics`, which are computed from the samples that `motion.usable` marks.
    """

    recording: ReadRecording
    motion: FilteredMotion
    terms: TermSeries
    measured: FloatArray | None
    statistics: ResidualStatistics | None
    limit_use: LimitUse

    @property
    def arm(self) -> ArmModel:
        return self.recording.arm

    @property
    def residual(self) -> FloatArray | None:
        """Measured − model effort, (m, n)."""
        return None if self.measured is None else np.asarray(self.measured - self.terms.effort)


STEPS = ('read', 'filtered', 'compared')
"""The steps that `analyze_recording` reports, in this order."""


def analyze_recording(
    path: Path, settings: AnalysisSettings, on_step: Callable[[str], None] = lambda _: None,
) -> BagAnalysis:
    """
    Return a recording compared with the model.

    `on_step` is called with each of STEPS when it is done. Raises RecordingError, ModelError, or
    InvalidInputError if recording and model do not match.
    """
    read = read_for_arm(path, settings)
    on_step('read')
    motion = filter_motion(read.series, settings.cutoff_hz)
    on_step('filtered')
    terms = model_terms(ArmDynamics(read.arm), *motion.state())
    measured, remark = joint_effort(motion.effort, terms.gravity, read.arm, settings.parameters)
    usable = motion.usable
    if not usable.any():
        raise RecordingError(
            f'recording {str(path)!r} has only samples near gaps and ends, expected others too')
    causes = () if measured is None else corrected(read.arm, replace(motion, effort=measured))[1]
    read = replace(read, remarks=(*read.remarks, *filter(None, (
        remark, *(f'likely cause of the residual: {cause}' for cause in causes)))))
    statistics = None if measured is None else residual_statistics(
        measured[usable], terms.effort[usable], read.arm.joint_names)
    use = _limit_use(read.arm, motion, terms.effort if measured is None else measured)
    on_step('compared')
    return BagAnalysis(read, motion, terms, measured, statistics, use)


def joint_effort(
    recorded: FloatArray | None, gravity: FloatArray, arm: ArmModel,
    parameters: Mapping[str, object],
) -> tuple[FloatArray | None, str]:
    """Return the measured effort on the joint side, with gravity, and a remark on the method."""
    convention = convention_from_parameters(parameters)
    kind = convention.measured_effort
    if recorded is None:
        return None, ''
    if kind == 'none':
        return None, "measured_effort is 'none': the recorded effort is not compared"
    effort, remarks = joint_effort_at_rest(kind, recorded, arm.actuators), []
    if kind in MOTOR_SIDE:
        remarks.append(f'measured_effort is {kind!r}: converted by torque constant and gear ratio')
    if convention.lacks_gravity:
        effort = effort + gravity
        remarks.append(f"measured_effort is {kind!r}: the model's gravity is added")
    if arm.report is not None:
        effort = arm.report.torque(effort)
        remarks.append(
            'the measured effort is converted by effort.report_scale and effort.report_offset')
    return effort, '; '.join(remarks)


def with_joint_effort(
    motion: FilteredMotion, arm: ArmModel, parameters: Mapping[str, object],
) -> tuple[FilteredMotion, str]:
    """Return a motion with `joint_effort`, and a remark; raise RecordingError without effort."""
    gravity = RigidBody(arm).gravity_batch(motion.position)
    found, remark = joint_effort(motion.effort, gravity, arm, parameters)
    if found is None:
        raise RecordingError('the recording has no effort, expected the measured effort')
    recorded, _ = joint_effort(motion.recorded_effort, gravity, arm, parameters)
    return replace(motion, effort=found, recorded_effort=recorded), remark


def _limit_use(arm: ArmModel, motion: FilteredMotion, effort: FloatArray) -> LimitUse:
    limits = arm.limits

    def ratio(values: FloatArray, limit: FloatArray) -> FloatArray:
        return _ratio(np.abs(values).max(axis=0), np.where(np.isfinite(limit), limit, 0.0))

    distance = np.minimum(
        motion.position.min(axis=0) - limits.lower, limits.upper - motion.position.max(axis=0))
    return LimitUse(
        ratio(effort, limits.effort), ratio(motion.velocity, limits.velocity),
        np.where(np.isfinite(distance), distance, np.nan))
