# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
A recording beside the model: motion, effort by term, residual, and use of the limits.

The measured motion and effort pass one zero-phase filter (`motion_filter`); the model's effort is
that of inverse dynamics at the filtered motion (`effort_residual`). Samples near gaps and ends,
where the filter has to guess, are given but do not count.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import ArmModel, load_arm
from robot_dynamics.effort_residual import (
    model_terms,
    residual_statistics,
    ResidualStatistics,
    TermSeries,
)
from robot_dynamics.effort_semantics import joint_effort_at_rest, MOTOR_SIDE
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.motion_filter import filter_motion, FilteredMotion
from robot_dynamics.parameter_file import described_arm, described_semantics
from robot_dynamics.recording import JointSeries, RecordedTopic, Recording
from robot_dynamics.validation import FloatArray

ROBOT_DESCRIPTION = '/robot_description'
IMPLAUSIBLE = 10.0
"""Times a limit of position, velocity or effort: what is beyond is noise of a damaged file."""


@dataclass(frozen=True)
class AnalysisSettings:
    """
    What to compare a recording with, and how.

    `urdf` is the text, empty for the one in the recording; `topic` a topic or a type, None for
    the joint states that are there; `joint_map` pairs of names of the same joint, in the
    recording and in the URDF; `cutoff_hz` [Hz] of the filter, None to choose it from the data;
    `parameters` those of `dynamics_node`, by their full names.
    """

    urdf: str = ''
    topic: str | None = None
    joint_map: tuple[tuple[str, str], ...] = ()
    cutoff_hz: float | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ReadRecording:
    """The joint states of a recording for an arm, and what is to be said about them."""

    path: Path
    topic: str
    arm: ArmModel
    series: JointSeries
    losses: tuple[str, ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class LimitUse:
    """
    The largest use of the limits, each (n,), NaN where there is no limit.

    `effort` (measured, or the model's where none was) and `velocity` are shares of the limit;
    `position` is the least distance to a position limit [rad] or [m], negative beyond.
    """

    effort: FloatArray
    velocity: FloatArray
    position: FloatArray


@dataclass(frozen=True, eq=False)
class BagAnalysis:
    """
    A recording beside the model.

    `measured` (m, n) [N·m] or [N] is None where no effort was recorded, and so are `residual` and
    `statistics`, which are of the samples that `motion.usable` marks.
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


def read_for_arm(path: Path, settings: AnalysisSettings) -> ReadRecording:
    """
    Return the joint states of a recording for the arm of the settings.

    Joints of the arm that were not recorded are locked. Raises RecordingError, ModelError, or
    InvalidInputError where arm and recording do not fit.
    """
    with Recording(path) as recording:
        topic = recording.joint_state_topic(settings.topic)
        states = recording.joint_states(topic)
        urdf = settings.urdf or _recorded_urdf(recording)
        whole = load_arm(urdf, settings.parameters.get('joints') or ())
        states = states.renamed(_renamed(settings.joint_map, states.joint_names, whole))
        joints = states.together(whole.joint_names)
        if not joints:
            raise InvalidInputError(
                f'the recording has the joints {list(states.joint_names)}, but the arm '
                f'{whole.name!r} has {list(whole.joint_names)}: give its own description with '
                '--urdf, or the names with --map')
        series = states.series(joints)
        origin = int(series.stamps_ns[0])
        losses = tuple(loss.words(origin) for loss in recording.losses)
        remarks = [*recording.notes, *series.faults.words()]
    arm = described_arm(urdf, joints, settings.parameters)
    series, wild = _plausible(series, arm, settings.parameters)
    series, held = _with_motors_on(series)
    locked = [name for name in whole.joint_names if name not in joints]
    if locked:
        remarks.append(f'not recorded, and so locked: {", ".join(locked)}')
    if series.velocity is None:
        remarks.append('no velocity was recorded: it is the derivative of the position')
    if series.effort is None:
        remarks.append('no effort was recorded: there is nothing to compare the model with')
    if held:
        remarks.append(f'the first {held} samples have no effort at all, as with brakes on, and '
                       'are left out')
    if wild:
        remarks.append(f'left out: {wild} samples beyond {IMPLAUSIBLE:g} times a limit of the arm')
    return ReadRecording(path, topic, arm, series, losses, tuple(remarks))


STEPS = ('read', 'filtered', 'compared')
"""What `analyze_recording` tells of, in this order."""


def analyze_recording(
    path: Path, settings: AnalysisSettings, on_step: Callable[[str], None] = lambda _: None,
) -> BagAnalysis:
    """
    Return a recording beside the model; `on_step` hears of each of STEPS when it is done.

    Raises RecordingError, ModelError, or InvalidInputError where they do not fit.
    """
    read = read_for_arm(path, settings)
    on_step('read')
    motion = filter_motion(read.series, settings.cutoff_hz)
    on_step('filtered')
    terms = model_terms(
        ArmDynamics(read.arm), motion.position, motion.velocity, motion.acceleration)
    measured, remark = joint_effort(motion, terms.gravity, read.arm, settings.parameters)
    if remark:
        read = replace(read, remarks=(*read.remarks, remark))
    usable = motion.usable
    if not usable.any():
        raise RecordingError(
            f'recording {str(path)!r} has no sample away from gaps and ends, expected more')
    statistics = None if measured is None else residual_statistics(
        measured[usable], terms.effort[usable], read.arm.joint_names)
    use = _limit_use(read.arm, motion, terms.effort if measured is None else measured)
    on_step('compared')
    return BagAnalysis(read, motion, terms, measured, statistics, use)


def _recorded_urdf(recording: Recording) -> str:
    described: list[RecordedTopic] = [
        topic for topic in recording.topics
        if topic.name == ROBOT_DESCRIPTION and topic.message_count]
    if not described:
        raise InvalidInputError(
            f'recording {str(recording.path)!r} has no {ROBOT_DESCRIPTION}, expected the URDF '
            'with --urdf')
    return str(next(recording.messages(ROBOT_DESCRIPTION))[1].data)


def _renamed(
    pairs: tuple[tuple[str, str], ...], recorded: tuple[str, ...], arm: ArmModel,
) -> dict[str, str]:
    """Return {recorded: joint of the arm}; a pair may name them in either order."""
    names: dict[str, str] = {}
    for pair in pairs:
        for ours, theirs in (pair, pair[::-1]):
            if ours in recorded and theirs in arm.joint_names:
                names[ours] = theirs
                break
        else:
            raise InvalidInputError(
                f"--map {'='.join(pair)} fits no joint, expected one name of the recording, "
                f'{list(recorded)}, and one of the arm, {list(arm.joint_names)}')
    return names


def _plausible(
    series: JointSeries, arm: ArmModel, parameters: Mapping[str, Any],
) -> tuple[JointSeries, int]:
    """Return the samples within IMPLAUSIBLE times the limits, and how many are not: noise."""
    good = np.ones(len(series.stamps_ns), dtype=np.bool_)
    is_motor_side = parameters.get('measured_effort') in MOTOR_SIDE
    reach = np.maximum(np.maximum(np.abs(arm.limits.lower), np.abs(arm.limits.upper)), 1.0)
    for values, limit in (
            (series.position, reach), (series.velocity, arm.limits.velocity),
            (None if is_motor_side else series.effort, arm.limits.effort)):
        if values is not None:
            bound = np.where(limit > 0.0, IMPLAUSIBLE * limit, np.inf)
            good &= (np.abs(values) <= bound).all(axis=1)
    if not good.any():
        raise RecordingError(
            f'every sample is beyond {IMPLAUSIBLE:g} times a limit of the arm {arm.name!r}, '
            'expected its own description')
    return (series, 0) if good.all() else (
        series.at(np.flatnonzero(good)), int((~good).sum()))


def _with_motors_on(series: JointSeries) -> tuple[JointSeries, int]:
    """Return the samples from the first with an effort on: before it, brakes hold the arm."""
    if series.effort is None or not series.effort.any():
        return series, 0
    held = int(np.argmax(series.effort.any(axis=1)))
    return series.after(held), held


def joint_effort(
    motion: FilteredMotion, gravity: FloatArray, arm: ArmModel, parameters: Mapping[str, Any],
) -> tuple[FloatArray | None, str]:
    """Return the measured effort on the joint side, with gravity, and a remark on how."""
    semantics = described_semantics(parameters, arm)
    kind = semantics.measured_effort
    if motion.effort is None or kind == 'none':
        return None, '' if motion.effort is None else (
            "measured_effort is 'none': the recorded effort is not compared")
    effort = joint_effort_at_rest(kind, motion.effort, arm.actuators)
    if kind in MOTOR_SIDE:
        return effort, f'measured_effort is {kind!r}: converted by torque constant and gear ratio'
    if semantics.lacks_gravity:
        return effort + gravity, f"measured_effort is {kind!r}: the model's gravity is added"
    return effort, ''


def _limit_use(arm: ArmModel, motion: FilteredMotion, effort: FloatArray) -> LimitUse:
    limits = arm.limits

    def share(values: FloatArray, limit: FloatArray) -> FloatArray:
        is_limit = np.isfinite(limit) & (limit > 0.0)
        largest = np.abs(values).max(axis=0)
        return np.where(is_limit, largest / np.where(is_limit, limit, 1.0), np.nan)

    distance = np.minimum(
        motion.position.min(axis=0) - limits.lower, limits.upper - motion.position.max(axis=0))
    return LimitUse(
        share(effort, limits.effort), share(motion.velocity, limits.velocity),
        np.where(np.isfinite(distance), distance, np.nan))
