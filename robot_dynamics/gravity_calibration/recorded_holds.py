# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The calibration of gravity from recordings of static holds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robot_dynamics.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.gravity_calibration.calibration import calibrate_holds, Calibration
from robot_dynamics.gravity_calibration.holds import find_holds, Hold
from robot_dynamics.gravity_calibration.tool_estimate import Tool
from robot_dynamics.joints.effort_convention import joint_effort_at_rest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics.model.payload import Payload


@dataclass(frozen=True, eq=False)
class RecordedHolds:
    """The holds of recordings of one arm; `lines` are losses and remarks."""

    arm: ArmModel
    bags: tuple[Path, ...]
    holds: tuple[Hold, ...]
    lines: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RecordedCalibration:
    """A calibration, and the recordings without and with the weight that it is from."""

    calibration: Calibration
    without_weight: RecordedHolds
    with_weight: RecordedHolds | None


def calibrate_recordings(
    bags: Sequence[Path], settings: AnalysisSettings, weighted_bags: Sequence[Path] = (),
    weight: Payload | None = None, tool: Tool | None = None,
) -> RecordedCalibration:
    """
    Return the calibration from recordings, `weighted_bags` with a known weight.

    Raises RecordingError if a recording cannot be used, ModelError, or InvalidInputError as
    `calibrate_holds`, or if the recordings have different joints.
    """
    without = read_holds(bags, settings)
    loaded = read_holds(weighted_bags, settings) if weighted_bags else None
    if loaded is not None and loaded.arm.joint_names != without.arm.joint_names:
        raise _different_joints(loaded, without)
    return RecordedCalibration(
        calibrate_holds(
            without.arm, without.holds, loaded.holds if loaded is not None else (), weight, tool),
        without, loaded)


def read_holds(bags: Sequence[Path], settings: AnalysisSettings) -> RecordedHolds:
    """
    Return the holds of recordings with the same load, as if they were one recording.

    `effort.scale` and `effort.offset` of the settings do not change the effort, which is that of
    the driver. Raises as `calibrate_recordings`.
    """
    read = [_read(bag, settings) for bag in bags]
    holds: list[Hold] = []
    for one in read:
        if one.arm.joint_names != read[0].arm.joint_names:
            raise _different_joints(one, read[0])
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
        tuple(f'{bag.name}: {line}' for line in (*read.losses, *read.remarks)))


def _different_joints(one: RecordedHolds, other: RecordedHolds) -> InvalidInputError:
    return InvalidInputError(
        f'{one.bags[0].name} has the joints {list(one.arm.joint_names)}, expected those of '
        f'{other.bags[0].name}: {list(other.arm.joint_names)}')
