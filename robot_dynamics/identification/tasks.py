# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The steps of an identification as tasks: read a recording on disk, and run one step on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from robot_dynamics.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics.analysis.bag_analysis import joint_effort
from robot_dynamics.analysis.motion_filter import filter_motion
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.steps import (
    ArmMotion,
    evaluate_recording,
    EvaluatedRecording,
    Evaluation,
    recording_facts,
    reduce_recording,
    Reduction,
)
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.payload_check import check_payloads
from robot_dynamics.model.rigid_body import RigidBody

Step = TypeVar('Step', Reduction, Evaluation)


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


@dataclass(frozen=True)
class IdentificationTask(Generic[Step]):
    """A step to run on recordings, and the settings with which they are read."""

    settings: IdentificationSettings
    step: Step


def read_motion(bag: Path, settings: IdentificationSettings) -> ArmMotion:
    """
    Return the filtered motion of a recording, with the effort at the joints.

    Raises the errors of `read_for_arm` and `filter_motion`, and RecordingError if there is no
    effort.
    """
    read = read_for_arm(bag, settings.analysis)
    arm = settings.arm(read.arm.joint_names, bag.name)
    motion = filter_motion(read.series, settings.analysis.cutoff_hz)
    zero = np.zeros_like(motion.position)
    gravity = RigidBody(arm).inverse_dynamics_batch(motion.position, zero, zero)
    effort, remark = joint_effort(motion, gravity, read.arm, settings.analysis.parameters)
    if effort is None:
        raise RecordingError('the recording has no effort, expected the measured effort')
    remarks = (*read.remarks, remark) if remark else read.remarks
    return ArmMotion(
        arm, replace(motion, effort=effort), recording_facts(motion, read.losses, remarks))


def reduce_task(bag: Path, task: IdentificationTask[Reduction]) -> QrInformation:
    """Return the information in a recording; raise like `read_motion` and `reduce_recording`."""
    return reduce_recording(
        read_motion(bag, task.settings), task.settings.train_fraction, task.step)


def evaluate_task(bag: Path, task: IdentificationTask[Evaluation]) -> EvaluatedRecording:
    """Return the tests of models on a recording; raise the errors of `read_motion`."""
    return evaluate_recording(
        read_motion(bag, task.settings), task.settings.train_fraction, task.step)
