# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The calibration of gravity from recordings of static holds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.joints.effort_convention import joint_effort_at_rest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics.model.payload import Payload
from robot_dynamics_tools.analysis import arm_recording
from robot_dynamics_tools.gravity_calibration.calibration import calibrate_holds, Calibration
from robot_dynamics_tools.gravity_calibration.holds import find_holds, Hold
from robot_dynamics_tools.gravity_calibration.reported_gravity import explanations
from robot_dynamics_tools.gravity_calibration.scale_fit import Tool
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.tables import TableRecording

COMMAND = 'effort_command'
"""The topic of the command, in any namespace."""
LEAST_TILT = np.radians(10.0)
"""Errors of the masses of a URDF look like a smaller tilt."""


@dataclass(frozen=True, eq=False)
class RecordedHolds:
    """
    The holds of recordings of one arm; `lines` are remarks.

    `commanded` are the same holds with the commanded instead of the measured effort, empty if a
    recording has no commands.
    """

    arm: ArmModel
    bags: tuple[Path, ...]
    holds: tuple[Hold, ...]
    commanded: tuple[Hold, ...]
    lines: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RecordedCalibration:
    """
    A calibration, and the holds that it is from: without the weight, and with it if known.

    `command` is the calibration of the command, None if a recording has no commands. `mount` says
    that the base is tilted, empty if the holds do not show it.
    """

    calibration: Calibration
    recorded: tuple[RecordedHolds, ...]
    command: Calibration | None = None
    mount: str = ''


def calibrate_recordings(
    bags: Sequence[Path], settings: arm_recording.AnalysisSettings,
    weighted_bags: Sequence[Path] = (), weight: Payload | None = None, tool: Tool | None = None,
) -> RecordedCalibration:
    """
    Return the calibration from recordings, `weighted_bags` with a known weight.

    Raises RecordingError if a recording cannot be used, ModelError, or InvalidInputError as
    `calibrate_holds`, or if the recordings have different joints.
    """
    recorded = [read_holds(group, settings) for group in (bags, weighted_bags) if group]
    _check_joints(recorded)
    arm, mount = recorded[0].arm, tilt(recorded[0].arm, recorded[0].holds)

    def calibrated(holds: Sequence[tuple[Hold, ...]], arm: ArmModel) -> Calibration:
        try:
            return calibrate_holds(arm, holds[0], holds[1] if weighted_bags else (), weight, tool)
        except InvalidInputError as error:
            raise InvalidInputError('. '.join(filter(None, (str(error), mount)))) from error

    return RecordedCalibration(
        calibrated([one.holds for one in recorded], arm), tuple(recorded),
        calibrated([one.commanded for one in recorded], replace(arm, report=arm.drive))
        if all(one.commanded for one in recorded) else None, mount)


def tilt(arm: ArmModel, holds: Sequence[Hold]) -> str:
    """Return that the base is tilted, if it is in each likely explanation of the holds."""
    q, effort = (np.array([getattr(hold, name) for hold in holds]).reshape(-1, arm.joint_count)
                 for name in ('position', 'effort'))
    found = explanations(arm, q, arm.given_report.torque(effort))
    if not len(holds) or any(one.angle[0] < LEAST_TILT for one in found):
        return ''
    return (f'The holds look as if {found[0].words(arm.joint_names)}: set gravity in --parameters '
            'to that of the mount')


def read_holds(bags: Sequence[Path], settings: arm_recording.AnalysisSettings) -> RecordedHolds:
    """
    Return the holds of recordings with the same load, as if they were one recording.

    Scales and offsets of the settings do not change the effort, which is that of the driver.
    Raises as `calibrate_recordings`.
    """
    read = [_read(bag, settings) for bag in bags]
    _check_joints(read)
    return RecordedHolds(
        read[0].arm, tuple(bags), _joined([one.holds for one in read]),
        _joined([one.commanded for one in read]) if all(one.commanded for one in read) else (),
        tuple(line for one in read for line in one.lines))


def _joined(parts: Sequence[Sequence[Hold]]) -> tuple[Hold, ...]:
    """Return the holds of recordings, one after the other."""
    holds: list[Hold] = []
    for part in parts:
        before = holds[-1].end if holds else 0.0
        holds += [hold._replace(start=hold.start + before, end=hold.end + before) for hold in part]
    return tuple(holds)


def _read(bag: Path, settings: arm_recording.AnalysisSettings) -> RecordedHolds:
    convention = convention_from_parameters(settings.parameters)
    kind = convention.measured_effort
    if convention.lacks_gravity or kind == 'none':
        raise InvalidInputError(
            f'measured_effort is {kind!r}, expected an effort that includes gravity')
    read = arm_recording.read_for_arm(bag, settings)
    if read.series.effort is None:
        raise RecordingError(f'recording {str(bag)!r} has no effort, expected joint states with '
                             'effort')
    effort = joint_effort_at_rest(kind, read.series.effort, read.arm.actuators)
    holds = find_holds(replace(read.series, effort=effort), read.arm.joint_kinds)
    command = None if convention.compensates_gravity else _command(bag, read.series)
    return RecordedHolds(
        read.arm, (bag,), tuple(holds), () if command is None else tuple(
            find_holds(replace(read.series, effort=command), read.arm.joint_kinds)),
        tuple(f'{bag.name}: {line}' for line in read.remarks))


def _command(bag: Path, series: JointSeries) -> FloatArray | None:
    """Return the command (m, n) at the samples of a recording, None without one for each."""
    with arm_recording.open_recording(bag) as recording:
        if isinstance(recording, TableRecording):
            return None
        topics = [topic.name for topic in recording.topics
                  if topic.name.endswith(COMMAND) and topic.message_count]
        if len(topics) != 1:
            return None
        sent = recording.joint_series(topics[0], series.joint_names)
    rows = np.searchsorted(sent.stamps_ns, series.stamps_ns, side='right') - 1
    if sent.effort is None or rows[0] < 0:
        return None
    return np.asarray(sent.effort[rows])


def _check_joints(recorded: Sequence[RecordedHolds]) -> None:
    first = recorded[0]
    for one in recorded:
        if one.arm.joint_names != first.arm.joint_names:
            raise InvalidInputError(
                f'{one.bags[0].name} has the joints {list(one.arm.joint_names)}, expected those '
                f'of {first.bags[0].name}: {list(first.arm.joint_names)}')
