# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The steps of an identification that process samples: functions of one motion, with small results.

Results of several recordings combine exactly (`qr_information`, `holdout`), so that the steps may
run on the recordings in any order and process.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from robot_dynamics.analysis.motion_filter import FilteredMotion
from robot_dynamics.analysis.sample_files import motion_columns
from robot_dynamics.arrays import FloatArray
from robot_dynamics.identification.holdout import evaluate_motion, ModelTest
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.regression import (
    model_effort,
    parts_of,
    reduce_motion,
)
from robot_dynamics.identification.regularized_fit import Fit
from robot_dynamics.model.arm import ArmModel

SHOWN = 3000
"""Largest number of samples of a recording that are plotted."""


@dataclass(frozen=True)
class RecordingFacts:
    """The facts that are reported about a recording in addition to its figures."""

    rate_hz: float
    cutoff_hz: float
    cutoff_reason: str
    losses: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """A filtered motion of an arm with its payloads, joints in the order of the arm."""

    arm: ArmModel
    motion: FilteredMotion
    facts: RecordingFacts


@dataclass(frozen=True, eq=False)
class Reduction:
    """
    How to reduce the training samples of a recording.

    `reference` is the model of a first pass, `drive_gain` (n,) the joint effort per unit of
    recorded effort. With `keeps_payload` the effort of the payloads is a column instead
    of a part of the effort that is subtracted.
    """

    reference: Fit | None = None
    drive_gain: FloatArray | None = None
    keeps_payload: bool = False


@dataclass(frozen=True, eq=False)
class Evaluation:
    """
    Models by name to test on a recording; the effort of the model `shown` is plotted.

    With `keeps_samples`, the samples of the test part are returned with the effort of this model.
    """

    models: Mapping[str, Fit]
    shown: str
    drive_gain: FloatArray | None = None
    keeps_samples: bool = False


@dataclass(frozen=True, eq=False)
class EffortSeries:
    """
    Measured and modelled effort over time, decimated for a plot: (m,) [s] and (m, n).

    `test_from` is the time of the first test sample [s], NaN if all samples are for training.
    """

    times: FloatArray
    velocity: FloatArray
    measured: FloatArray
    model: FloatArray
    test_from: float


@dataclass(frozen=True, eq=False)
class EvaluatedRecording:
    """
    The tests of the models on a recording, by name, and the facts about the recording.

    `samples` are the columns of the samples of the test part, with the effort of the model shown.
    """

    facts: RecordingFacts
    tests: dict[str, ModelTest]
    shown: EffortSeries
    samples: dict[str, FloatArray] | None = None


def recording_facts(
    motion: FilteredMotion, losses: tuple[str, ...] = (), remarks: tuple[str, ...] = (),
) -> RecordingFacts:
    """Return the facts about a filtered motion, with the losses and remarks of its recording."""
    if motion.differentiated:
        remarks = (*remarks, 'recorded velocity is inconsistent with the position, and is not '
                             f'used, for {", ".join(motion.differentiated)}')
    return RecordingFacts(
        motion.sample_rate_hz, motion.cutoff_hz, motion.cutoff_reason, losses, remarks)


def reduce_recording(
    recording: ArmMotion, train_fraction: float, step: Reduction,
) -> QrInformation:
    """
    Return the information in the training samples of a recording.

    Raises RecordingError without effort, InvalidInputError with too few samples.
    """
    motion = _with_gain(recording.motion, step.drive_gain)
    return reduce_motion(
        recording.arm, motion, train_fraction, step.reference, step.keeps_payload)


def evaluate_recording(
    recording: ArmMotion, train_fraction: float, step: Evaluation,
) -> EvaluatedRecording:
    """Return the tests of models on a recording."""
    motion = _with_gain(recording.motion, step.drive_gain)
    assert motion.effort is not None
    every = max(1, int(np.ceil(len(motion.effort) / SHOWN)))
    model, _ = model_effort(recording.arm, motion, step.models[step.shown])
    first = parts_of(motion, train_fraction).test.start
    efforts = {'measured': motion.effort, 'model': model, 'residual': motion.effort - model}
    samples = {name: column[first:] for name, column in motion_columns(
        recording.arm, motion, efforts).items()}
    test_from = float(motion.times[first]) if first < len(motion.times) else float('nan')
    return EvaluatedRecording(
        recording.facts, evaluate_motion(recording.arm, motion, train_fraction, step.models),
        EffortSeries(motion.times[::every], motion.velocity[::every], motion.effort[::every],
                     model[::every], test_from),
        samples if step.keeps_samples else None)


def _with_gain(motion: FilteredMotion, drive_gain: FloatArray | None) -> FilteredMotion:
    if motion.effort is None or drive_gain is None:
        return motion
    return replace(motion, effort=motion.effort * drive_gain)


def write_samples(
    tables: Sequence[dict[str, FloatArray] | None], names: Sequence[str], directory: Path,
) -> list[Path]:
    """Write one CSV file per table, named after its recording, and return their paths."""
    paths = []
    for number, (table, name) in enumerate(zip(tables, names)):
        if table is None:
            continue
        same = f'_{number}' if names.count(name) > 1 else ''
        paths.append(directory / f'test_samples_{name}{same}.csv')
        np.savetxt(
            paths[-1], np.column_stack(list(table.values())), fmt='%.9g', delimiter=',',
            header=','.join(table), comments='', encoding='utf-8')
    return paths
