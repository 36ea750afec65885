# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Identification from recordings on disk: the steps of `pipeline` run as tasks.

A task reads a recording and runs one step on it. Each recording is read three times: for its
information with the load of the URDF, for its information with the load of the first model, and
for the test. The caller passes the function that runs the tasks: in this process, in several
processes or on a cluster.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot_dynamics.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics.analysis.bag_analysis import with_joint_effort
from robot_dynamics.analysis.batch import Outcome, Task, TaskOutcome
from robot_dynamics.analysis.motion_filter import filter_motion
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.identification.pipeline import Identification, identify_recordings
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.steps import (
    evaluate_recording,
    EvaluatedRecording,
    Evaluation,
    FilteredArmMotion,
    recording_facts,
    reduce_recording,
    Reduction,
)
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.payload_check import check_payloads


@dataclass(frozen=True)
class IdentificationSettings:
    """
    Options of reading recordings, the fraction for training, and the payloads of the arm.

    `recording_payloads` are payloads in only one recording, with the name of its file.
    """

    analysis: AnalysisSettings
    train_fraction: float
    payloads: tuple[Payload, ...] = ()
    recording_payloads: tuple[tuple[str, Payload], ...] = ()

    def arm(self, joint_names: Sequence[str], recording: str | None = None) -> ArmModel:
        """
        Return the arm of these joints, with parameters and payloads, in a recording of this name.

        Raises InvalidInputError for a payload that the arm cannot carry.
        """
        arm = arm_from_parameters(self.analysis.urdf, self.analysis.parameters, joint_names)
        payloads = [*self.payloads, *(
            payload for name, payload in self.recording_payloads if name == recording)]
        check_payloads(arm, payloads)
        return arm.with_payloads(payloads)


def read_motion(bag: Path, settings: IdentificationSettings) -> FilteredArmMotion:
    """
    Return the filtered motion of a recording, with the effort at the joints.

    Raises the errors of `read_for_arm` and `filter_motion`, and RecordingError if there is no
    effort.
    """
    read = read_for_arm(bag, settings.analysis)
    arm = settings.arm(read.arm.joint_names, bag.name)
    motion = filter_motion(read.series, settings.analysis.cutoff_hz)
    motion, remark = with_joint_effort(motion, arm, settings.analysis.parameters)
    remarks = (*read.remarks, remark) if remark else read.remarks
    return FilteredArmMotion(arm, motion, recording_facts(motion, read.losses, remarks))


def reduce_task(bag: Path, task: tuple[IdentificationSettings, Reduction]) -> QrInformation:
    """Return the information in a recording; raise like `read_motion` and `reduce_recording`."""
    settings, step = task
    return reduce_recording(read_motion(bag, settings), settings.train_fraction, step)


def evaluate_task(
    bag: Path, task: tuple[IdentificationSettings, Evaluation],
) -> EvaluatedRecording:
    """Return the tests of models on a recording; raise the errors of `read_motion`."""
    settings, step = task
    return evaluate_recording(read_motion(bag, settings), settings.train_fraction, step)


TaskRunner = Callable[[Task[Any, Any], Sequence[Path], Any], list[TaskOutcome[Any]]]
"""Runs a task on recordings with settings, such as `batch.run_tasks`."""


@dataclass(frozen=True, eq=False)
class BagIdentification:
    """
    An identification, and the files of its recordings.

    `bags` are the recordings of `identification.recordings`, `failed` are the other recordings
    with their errors.
    """

    identification: Identification
    bags: tuple[Path, ...]
    failed: tuple[tuple[Path, str], ...]


class BagRecordings:
    """Recordings on disk; a recording that fails in a step is excluded from the later steps."""

    def __init__(
        self, bags: Sequence[Path], settings: IdentificationSettings, run: TaskRunner,
    ) -> None:
        self.left = list(bags)
        self.failed: dict[Path, str] = {}
        self._settings, self._run = settings, run

    def arm(self, joint_names: Sequence[str]) -> ArmModel:
        """Return the arm of these joints."""
        return self._settings.arm(joint_names)

    def reduce(self, step: Reduction) -> list[QrInformation]:
        """Return the information in each recording; raise RecordingError if all fail."""
        return self._results(self._run(reduce_task, self.left, (self._settings, step)))

    def evaluate(self, step: Evaluation) -> list[EvaluatedRecording]:
        """Return the tests of the models on each recording; raise RecordingError if all fail."""
        return self._results(self._run(evaluate_task, self.left, (self._settings, step)))

    def _results(self, outcomes: Sequence[TaskOutcome[Outcome]]) -> list[Outcome]:
        self.failed.update({
            outcome.bag: outcome.error for outcome in outcomes if outcome.result is None})
        self.left = [outcome.bag for outcome in outcomes if outcome.result is not None]
        if not self.left:
            raise RecordingError('no recording can be used: ' + '; '.join(
                f'{bag.name}: {error}' for bag, error in self.failed.items()))
        return [outcome.result for outcome in outcomes if outcome.result is not None]


def identify_bags(
    bags: Sequence[Path], settings: IdentificationSettings, run: TaskRunner,
    effort_is_current: bool | None = None, on_stage: Callable[[str], None] = lambda _: None,
    keeps_samples: bool = False,
) -> BagIdentification:
    """
    Return the identification of an arm from recordings on disk, like `identify_recordings`.

    Recordings that fail are excluded. Raises RecordingError if all fail, and the errors of
    `identify_recordings`.
    """
    recordings = BagRecordings(bags, settings, run)
    identification = identify_recordings(
        recordings, effort_is_current, on_stage, keeps_samples)
    return BagIdentification(
        identification, tuple(recordings.left), tuple(recordings.failed.items()))
