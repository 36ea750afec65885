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

import numpy as np
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.payload_check import check_payloads
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.bag_analysis import with_joint_effort
from robot_dynamics_tools.analysis.batch import Task, TaskOutcome
from robot_dynamics_tools.analysis.motion_filter import filter_motion
from robot_dynamics_tools.identification import pipeline, steps
from robot_dynamics_tools.identification.friction_regressor import LEAST_TRAVEL, scales_of


@dataclass(frozen=True)
class IdentificationSettings:
    """
    Options of reading recordings, the fraction for training, and the payloads of the arm.

    Each of the `payloads` has the name of the file of its recording, '' for all recordings.
    """

    analysis: AnalysisSettings
    train_fraction: float
    payloads: tuple[tuple[str, Payload], ...] = ()

    def arm(self, joint_names: Sequence[str], recording: str | None = None) -> ArmModel:
        """
        Return the arm of these joints, with parameters and payloads, in a recording of this name.

        Raises InvalidInputError for a payload that the arm cannot carry.
        """
        arm = arm_from_parameters(self.analysis.urdf, self.analysis.parameters, joint_names)
        payloads = [payload for name, payload in self.payloads if name in ('', recording)]
        check_payloads(arm, payloads)
        return arm.with_payloads(payloads)


def read_motion(bag: Path, settings: IdentificationSettings) -> steps.FilteredArmMotion:
    """
    Return the filtered motion of a recording, with the effort at the joints.

    Raises the errors of `read_for_arm` and `filter_motion`, and RecordingError if there is no
    effort, or no motion.
    """
    read = read_for_arm(bag, settings.analysis)
    arm = settings.arm(read.arm.joint_names, bag.name)
    if read.series.position is not None and (np.ptp(read.series.position, axis=0) < (
            LEAST_TRAVEL * scales_of(arm.joint_kinds))).all():
        raise RecordingError(
            f'the recording is at rest: no joint moves by {LEAST_TRAVEL:g} rad, expected a motion')
    read.check_effort()
    motion = filter_motion(read.series, settings.analysis.cutoff_hz)
    motion, remark = with_joint_effort(motion, arm, settings.analysis.parameters)
    remarks = (*read.remarks, remark) if remark else read.remarks
    return steps.prepared_motion(arm, motion, settings.train_fraction, remarks)


def run_step(bag: Path, task: tuple[IdentificationSettings, steps.Step]) -> Any:
    """Return the result of a step on a recording; raise like `read_motion` and the step."""
    settings, step = task
    return step(read_motion(bag, settings))


TaskRunner = Callable[[Task[Any, Any], Sequence[Path], Any], list[TaskOutcome[Any]]]
"""Runs a task on recordings with settings, such as `batch.run_tasks`."""


@dataclass(frozen=True, eq=False)
class BagIdentification:
    """
    An identification, and the files of its recordings.

    `bags` are the recordings of `identification.recordings`, `failed` are the other recordings
    with their errors. With `seeks_stiffness`, the gains are the stiffness of position drives.
    """

    identification: pipeline.Identification
    bags: tuple[Path, ...]
    failed: tuple[tuple[Path, str], ...]
    seeks_stiffness: bool = False


def identify_bags(
    bags: Sequence[Path], settings: IdentificationSettings, run: TaskRunner,
    effort_is_current: bool | None = None, on_stage: Callable[[str], None] = lambda _: None,
    keeps_samples: bool = False, dry_run: bool = False,
) -> BagIdentification | pipeline.Observability:
    """
    Return the identification of an arm from recordings on disk, like `identify_recordings`.

    With `dry_run`, return only what a first pass determines. A recording that fails in a step is
    excluded from the later steps. Raises RecordingError if all fail, and the errors of
    `identify_recordings`.
    """
    left, failed = list(bags), dict[Path, str]()

    def results(step: steps.Step) -> list[Any]:
        nonlocal left
        outcomes = run(run_step, left, (settings, step))
        done = [(each.bag, each.result) for each in outcomes if each.result is not None]
        left = [bag for bag, _ in done]
        failed.update((each.bag, each.error) for each in outcomes if each.result is None)
        if not left:
            raise RecordingError('no recording can be used: ' + '; '.join(
                f'{bag.name}: {error}' for bag, error in failed.items()))
        return [result for _, result in done]

    recordings = pipeline.Recordings(settings.arm, results)
    found = pipeline.observability(recordings, effort_is_current) if dry_run else (
        pipeline.identify_recordings(recordings, effort_is_current, on_stage, keeps_samples))
    return BagIdentification(
        found, tuple(left), tuple(failed.items()), settings.analysis.seeks_stiffness) if (
            isinstance(found, pipeline.Identification)) else found
