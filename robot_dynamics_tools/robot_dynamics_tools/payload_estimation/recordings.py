# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Estimation of what is attached to a link from recordings on disk."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from robot_dynamics.exceptions import RecordingError, RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics_tools.analysis import motion_filter
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.bag_analysis import with_joint_effort
from robot_dynamics_tools.analysis.contradictions import corrected
from robot_dynamics_tools.payload_estimation.estimator import PayloadEstimator
from robot_dynamics_tools.payload_estimation.result import PayloadEstimate

CUTOFF = 5.0
"""Default cut-off frequency [Hz] of the filter, which suits holds and slow motions."""
SAMPLES_PER_PERIOD = 10.0
"""Used samples per period of the cut-off frequency."""


@dataclass(frozen=True, eq=False)
class RecordedPayload:
    """
    An estimate, and the recordings that it is based on.

    `remarks` are those of the recordings, `failed` are the other recordings with their errors.
    """

    estimate: PayloadEstimate
    bags: tuple[Path, ...]
    remarks: tuple[str, ...]
    failed: tuple[tuple[Path, str], ...]


def estimate_from_bags(
    bags: Sequence[Path], link: str, settings: AnalysisSettings,
    when_read: Callable[[], object] = lambda: None, scale_deviation: float | None = None,
) -> RecordedPayload:
    """
    Return the estimate of the body on `link` from all recordings together.

    `when_read` is called after each recording, `scale_deviation` is that of `PayloadEstimator`.
    Recordings that fail are excluded. Raises
    RecordingError if all fail, InvalidInputError for a wrong link or parameter, and ModelError.
    """
    arm_from_parameters(settings.urdf, settings.parameters, ()).link_frame(link, 'link')
    estimator: PayloadEstimator | None = None
    used: list[Path] = []
    remarks: list[str] = []
    failed: list[tuple[Path, str]] = []
    for bag in bags:
        try:
            recorded, motion, found = _read(bag, settings)
            estimator = estimator or PayloadEstimator(
                recorded, link, motion.cutoff_hz, scale_deviation)
            if recorded.joint_names != estimator.arm.joint_names:
                raise RecordingError(
                    f'the recording has the joints {list(recorded.joint_names)}, expected those '
                    f'of the first one, {list(estimator.arm.joint_names)}')
            add_motion(estimator, motion)
            used.append(bag)
            remarks += found
        except RobotDynamicsError as error:
            failed.append((bag, str(error)))
        when_read()
    if estimator is None or not used:
        raise RecordingError('no recording can be used: ' + '; '.join(
            f'{bag.name}: {error}' for bag, error in failed))
    return RecordedPayload(
        estimator.estimate(), tuple(used), tuple(dict.fromkeys(remarks)), tuple(failed))


def _read(
    bag: Path, settings: AnalysisSettings,
) -> tuple[ArmModel, motion_filter.FilteredMotion, tuple[str, ...]]:
    """Return the arm, the filtered motion with joint effort, and remarks."""
    read = read_for_arm(bag, settings)
    read.check_effort()
    cutoff = settings.cutoff_hz
    motion = motion_filter.filter_motion_below(read.series, CUTOFF) if cutoff is None else (
        motion_filter.filter_motion(read.series, cutoff))
    motion, remark = with_joint_effort(motion, read.arm, settings.parameters)
    motion, causes = corrected(read.arm, motion, has_load=True)
    return read.arm, motion, tuple(filter(None, (*read.remarks, remark, *causes)))


def add_motion(estimator: PayloadEstimator, motion: motion_filter.FilteredMotion) -> None:
    """Add the usable samples of a motion, as many per second as the filter leaves."""
    every = max(int(motion.sample_rate_hz / (SAMPLES_PER_PERIOD * motion.cutoff_hz)), 1)
    for number in np.unique(motion.segment):
        rows = np.flatnonzero((motion.segment == number) & motion.usable)[::every]
        estimator.restart()
        estimator.add(motion.times[rows], *motion.state(rows), motion.measured_effort[rows])
