# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The calibration of gravity from recordings of static holds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.joints.effort_convention import joint_effort_at_rest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics.model.payload import Payload
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.gravity_calibration.calibration import calibrate_holds, Calibration
from robot_dynamics_tools.gravity_calibration.holds import find_holds, Hold
from robot_dynamics_tools.gravity_calibration.tool_estimate import Tool


@dataclass(frozen=True, eq=False)
class RecordedHolds:
    """The holds of recordings of one arm; `lines` are remarks."""

    arm: ArmModel
    bags: tuple[Path, ...]
    holds: tuple[Hold, ...]
    lines: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RecordedCalibration:
    """A calibration, and the holds that it is from: without the weight, and with it if known."""

    calibration: Calibration
    recorded: tuple[RecordedHolds, ...]


def calibrate_recordings(
    bags: Sequence[Path], settings: AnalysisSettings, weighted_bags: Sequence[Path] = (),
    weight: Payload | None = None, tool: Tool | None = None,
) -> RecordedCalibration:
    """
    Return the calibration from recordings, `weighted_bags` with a known weight.

    Raises RecordingError if a recording cannot be used, ModelError, or InvalidInputError as
    `calibrate_holds`, or if the recordings have different joints.
    """
    recorded = [read_holds(group, settings) for group in (bags, weighted_bags) if group]
    _check_joints(recorded)
    return RecordedCalibration(
        calibrate_holds(
            recorded[0].arm, recorded[0].holds, recorded[1].holds if weighted_bags else (),
            weight, tool),
        tuple(recorded))


def read_holds(bags: Sequence[Path], settings: AnalysisSettings) -> RecordedHolds:
    """
    Return the holds of recordings with the same load, as if they were one recording.

    `effort.scale` and `effort.offset` of the settings do not change the effort, which is that of
    the driver. Raises as `calibrate_recordings`.
    """
    read = [_read(bag, settings) for bag in bags]
    _check_joints(read)
    holds: list[Hold] = []
    for one in read:
        before = holds[-1].end if holds else 0.0
        holds += [hold._replace(start=hold.start + before, end=hold.end + before)
                  for hold in one.holds]
    return RecordedHolds(
        read[0].arm, tuple(bags), tuple(holds), tuple(line for one in read for line in one.lines))


def _read(bag: Path, settings: AnalysisSettings) -> RecordedHolds:
    convention = convention_from_parameters(settings.parameters)
    kind = convention.measured_effort
    if convention.lacks_gravity or kind == 'none':
        raise InvalidInputError(
            f'measured_effort is {kind!r}, expected an effort that includes gravity')
    read = read_for_arm(bag, settings)
    if read.series.effort is None:
        raise RecordingError(f'recording {str(bag)!r} has no effort, expected joint states with '
                             'effort')
    effort = joint_effort_at_rest(kind, read.series.effort, read.arm.actuators)
    holds = find_holds(replace(read.series, effort=effort), read.arm.joint_kinds)
    return RecordedHolds(
        read.arm, (bag,), tuple(holds),
        tuple(f'{bag.name}: {line}' for line in read.remarks))


def _check_joints(recorded: Sequence[RecordedHolds]) -> None:
    first = recorded[0]
    for one in recorded:
        if one.arm.joint_names != first.arm.joint_names:
            raise InvalidInputError(
                f'{one.bags[0].name} has the joints {list(one.arm.joint_names)}, expected those '
                f'of {first.bags[0].name}: {list(first.arm.joint_names)}')
