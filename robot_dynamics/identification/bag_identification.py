# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Identification from recordings on disk: the steps of `pipeline` run as tasks.

Each recording is read three times: for its information with the load of the URDF, for its
information with the load of the first model, and for the test. The caller passes the function that
runs the tasks: in this process, in several processes or on a cluster.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from robot_dynamics.analysis.batch import Outcome, Settings, Task, TaskOutcome
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.identification.pipeline import Identification, identify_recordings
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.steps import EvaluatedRecording, Evaluation, Reduction
from robot_dynamics.identification.tasks import (
    evaluate_task,
    IdentificationSettings,
    IdentificationTask,
    reduce_task,
)
from robot_dynamics.model.arm import ArmModel


class TaskRunner(Protocol):
    """Runs a task on recordings, such as `batch.run_tasks`."""

    def __call__(
        self, function: Task[Settings, Outcome], bags: Sequence[Path], settings: Settings, /,
    ) -> list[TaskOutcome[Outcome]]:
        """Return an outcome for each recording, in their order."""


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
        return self._results(self._run(
            reduce_task, self.left, IdentificationTask(self._settings, step)))

    def evaluate(self, step: Evaluation) -> list[EvaluatedRecording]:
        """Return the tests of the models on each recording; raise RecordingError if all fail."""
        return self._results(self._run(
            evaluate_task, self.left, IdentificationTask(self._settings, step)))

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
