# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The joint states of a recording for one arm: topic, joint name matching, usable samples."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.joints.effort_convention import MOTOR_SIDE
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics_tools.analysis import units
from robot_dynamics_tools.analysis.position_drives import commands, drive_effort, STIFFNESS
from robot_dynamics_tools.recordings.bag_files import is_table
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.sample_faults import counted
from robot_dynamics_tools.recordings.tables import TableRecording
from robot_dynamics_tools.recordings.topics import ROBOT_DESCRIPTION
from robot_dynamics_tools.reporting.text_table import percent

MOST_IMPLAUSIBLE = 0.1
"""Largest share of implausible samples of a joint that counts as noise."""
_CAUSES = {
    'position': 'positions in degrees or millimetres, or the URDF of another arm',
    'velocity': 'velocities in degrees or millimetres per second, or the URDF of another arm',
    'effort': 'efforts in mA or in another unit than N·m (`identify --effort current`, '
              'or `effort.report_scale`)'}


@dataclass(frozen=True)
class AnalysisSettings:
    """
    The settings of the comparison of a recording with a model.

    `urdf` is the text of the URDF, empty for the URDF in the recording. `topic` is a topic or a
    type, None for the joint states in the recording. `joint_map` has pairs of names of the same
    joint, in the recording and in the URDF. `cutoff_hz` [Hz] is the cut-off frequency of the
    filter, None to choose it from the data. `parameters` are those of `dynamics_node`, by their
    full names. With `effort_is_current`, the limits of the effort do not apply. `columns` are
    those of `TableRecording`, `unit` is that of positions (`units.in_radians`). `command_topic`
    has the commanded positions of drives that report no effort (`position_drives`).
    """

    urdf: str = ''
    topic: str | None = None
    joint_map: tuple[tuple[str, str], ...] = ()
    cutoff_hz: float | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    effort_is_current: bool = False
    columns: tuple[tuple[str, str], ...] = ()
    unit: str = ''
    command_topic: str | None = None

    @property
    def seeks_stiffness(self) -> bool:
        """Whether the effort is the distance to the command of drives of unknown stiffness."""
        return self.command_topic is not None and not self.parameters.get(STIFFNESS)


@dataclass(frozen=True, eq=False)
class ReadRecording:
    """The joint states of a recording for an arm, with remarks."""

    path: Path
    topic: str
    arm: ArmModel
    series: JointSeries
    remarks: tuple[str, ...]

    def check_effort(self) -> None:
        """Raise RecordingError without effort, with the joints whose effort is not finite."""
        if self.series.effort is None:
            raise RecordingError('; '.join((
                'the recording has no effort, expected the measured effort',
                *(f'no finite number: {each}' for each in self.series.faults.never_finite))))


def open_recording(
    path: Path, columns: tuple[tuple[str, str], ...] = (),
) -> Recording | TableRecording:
    """Return an open recording; raise RecordingError."""
    return TableRecording(path, columns) if is_table(path) else Recording(path)


def read_for_arm(path: Path, settings: AnalysisSettings) -> ReadRecording:
    """
    Return the joint states of a recording for the arm of the settings.

    Joints of the arm that were not recorded are locked. Raises RecordingError, ModelError, or
    InvalidInputError if arm and recording do not match.
    """
    with open_recording(path, settings.columns) as recording:
        topic = recording.joint_state_topic(settings.topic)
        states = recording.joint_states(topic)
        urdf = settings.urdf or recording.description()
        if urdf is None:
            raise InvalidInputError(
                f'recording {str(path)!r} has no {ROBOT_DESCRIPTION}, expected the URDF with '
                '--urdf')
        whole = arm_from_urdf(urdf, settings.parameters.get('joints') or ())
        names = _renamed(settings.joint_map, states.joint_names, whole)
        states = states.renamed(names)
        joints = states.together(whole.joint_names)
        if not joints:
            raise InvalidInputError(
                f'the recording has the joints {list(states.joint_names)}, but the arm '
                f'{whole.name!r} has {list(whole.joint_names)}: give its own description with '
                '--urdf, or the names with --map')
        series = states.series(joints)
        remarks = [*recording.notes, *series.faults.words()]
        arm = arm_from_parameters(urdf, settings.parameters, joints)
        series, converted = units.in_radians(series, arm, settings.unit, is_table(path))
        remarks += converted
        series = series.unwrapped(arm.is_continuous)
        if settings.command_topic is not None:
            sent, _ = units.in_radians(
                commands(recording, settings.command_topic, joints, names), arm, settings.unit,
                is_table(path))
            series, delay = drive_effort(series, sent, arm, settings.parameters.get(STIFFNESS, ()))
            factor = '' if settings.seeks_stiffness else f'{STIFFNESS} times '
            remarks.append(f'effort: {factor}the distance to the command on '
                           f'{settings.command_topic}, which acts after {1e3 * delay:.0f} ms')
    series, wild = plausible(series, arm, settings.effort_is_current or (
        settings.parameters.get('measured_effort') in MOTOR_SIDE))
    units.check_degrees(series)
    units.check_sign_bits(series)
    received, series = len(series.stamps_ns), series.driven()
    held = received - len(series.stamps_ns)
    locked = [name for name in whole.joint_names if name not in joints]
    if locked:
        remarks.append(f'not recorded, therefore locked: {", ".join(locked)}')
    if series.velocity is None:
        remarks.append('velocity not recorded: differentiated from the position')
    if series.effort is None:
        remarks.append('effort not recorded: the model cannot be compared')
    if held:
        remarks.append(f'left out: {counted(held, "sample")} with zero effort, because the brakes '
                       'were probably engaged')
    if wild:
        remarks.append(f'left out: {counted(wild, "sample")} beyond the limits of the arm (' + (
            ', '.join(f'{name} {factor:g} times'
                      for name, factor in units.IMPLAUSIBLE.items())) + ')')
    return ReadRecording(path, topic, arm, series, tuple(remarks))


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
                f"--map {'='.join(pair)} matches no joint, expected one name of the recording, "
                f'{list(recorded)}, and one of the arm, {list(arm.joint_names)}')
    return names


def plausible(series: JointSeries, arm: ArmModel, is_motor_side: bool) -> tuple[JointSeries, int]:
    """
    Return the samples within IMPLAUSIBLE times the limits, and the number of the others.

    Raises RecordingError if more than MOST_IMPLAUSIBLE of the samples of a joint are beyond.
    """
    good = np.ones(len(series.stamps_ns), dtype=np.bool_)
    for name, values, limit in (
            ('position', series.position, units.reach(arm)),
            ('velocity', series.velocity, arm.limits.velocity),
            ('effort', None if is_motor_side else series.effort, arm.given_report.limit)):
        if values is None:
            continue
        is_good = np.abs(values) <= np.where(limit > 0.0, units.IMPLAUSIBLE[name] * limit, np.inf)
        share = 1.0 - is_good.mean(axis=0)
        if share.max() > MOST_IMPLAUSIBLE:
            listed = ', '.join(
                f'{joint} ({percent(part)} of the samples, up to {largest:.4g}, limit {bound:.4g})'
                for joint, part, largest, bound in zip(
                    arm.joint_names, share, np.abs(values).max(axis=0), limit)
                if part > MOST_IMPLAUSIBLE)
            raise RecordingError(
                f'{name} beyond {units.IMPLAUSIBLE[name]:g} times the limit at {listed}. '
                f'Likely cause: {_CAUSES[name]}')
        good &= is_good.all(axis=1)
    return (series, 0) if good.all() else (series.at(np.flatnonzero(good)), int((~good).sum()))
