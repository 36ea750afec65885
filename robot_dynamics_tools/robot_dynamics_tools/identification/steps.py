# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The steps of an identification that process samples: functions of one motion, with small results.

Results of several recordings combine exactly (`qr_information`, `ModelTest`), so that the steps
may run on the recordings in any order and process.

The residual of a model on samples that were not used for training is given relative to the effort,
RMS to RMS. It is computed twice: along the motion, with presliding hysteresis, and sample by
sample, like an answer of the node to a single state. If no samples are left for a test, every
cross-validation fold is predicted by models that are fitted to the other folds, with the
structures and the regularization of all folds. The residual is then slightly too small, because
these were selected with the same folds.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.tools.command_line import writing
from robot_dynamics_tools.analysis.contradictions import corrected
from robot_dynamics_tools.analysis.motion_filter import FilteredMotion
from robot_dynamics_tools.analysis.sample_files import motion_columns, write_csv
from robot_dynamics_tools.identification.model_selection import fit_models, FittedModels
from robot_dynamics_tools.identification.qr_information import QrInformation
from robot_dynamics_tools.identification.regression import model_effort, reduce_motion, train_count
from robot_dynamics_tools.identification.regularized_fit import Fit, grams_of, without_memory

SHOWN = 3000
"""Largest number of samples of a recording that are plotted, and determine the noise."""


@dataclass(frozen=True, eq=False)
class ModelTest:
    """
    Sums of squares over samples, each (n,): of a model's residual, and of the effort itself.

    `train` and `test` are along the motion, `test_by_sample` is sample by sample; `train_effort`
    and `test_effort` are those of the measured effort; `samples` are the counts (training, test).
    """

    train: FloatArray
    test: FloatArray
    test_by_sample: FloatArray
    train_effort: FloatArray
    test_effort: FloatArray
    samples: tuple[int, int]

    def relative(self, which: str = 'test') -> FloatArray:
        """Return RMS of residual / RMS of effort, (n,), for 'train', 'test', …; NaN if empty."""
        effort = self.train_effort if which == 'train' else self.test_effort
        squares: FloatArray = getattr(self, which)
        return np.sqrt(np.divide(
            squares, effort, out=np.full_like(squares, np.nan), where=effort > 0.0))

    def rms(self) -> FloatArray:
        """Return the RMS of the residual on the test samples, (n,) [N·m] or [N]."""
        return np.sqrt(self.test / max(self.samples[1], 1))


def evaluate_motion(
    arm: ArmModel, motion: FilteredMotion, train_fraction: float, models: Mapping[str, Fit],
) -> dict[str, ModelTest]:
    """Return the test of each model on the samples of one recording."""
    effort, count = motion.measured_effort, train_count(motion, train_fraction)
    tests = {}
    for name, fit in models.items():
        along, single = (effort - modelled for modelled in model_effort(arm, motion, fit))
        tests[name] = ModelTest(
            _squares(along[:count]), _squares(along[count:]), _squares(single[count:]),
            _squares(effort[:count]), _squares(effort[count:]), (count, len(effort) - count))
    return tests


def merge_tests(tests: Sequence[ModelTest]) -> ModelTest:
    """Return the combined test of a model on several recordings."""
    squares = ('train', 'test', 'test_by_sample', 'train_effort', 'test_effort')
    train, test = zip(*(each.samples for each in tests))
    return ModelTest(
        **{name: np.sum([getattr(each, name) for each in tests], axis=0) for name in squares},
        samples=(sum(train), sum(test)))


def _squares(values: FloatArray) -> FloatArray:
    return np.asarray(np.sum(values**2, axis=0))


def cross_validated_tests(
    information: QrInformation, models: FittedModels, trained: Mapping[str, ModelTest],
) -> dict[str, ModelTest]:
    """Return the tests with the residual of the folds; `trained` are those of the training."""
    fitted = [fit_models(
        information.all_but(i), models.problem, models.validated,
        models.by_name['urdf'].parameters).by_name
        for i in information.folds]
    blocks = [grams_of(information.block(i)) for i in information.folds]
    effort = np.sum([grams[:, -1, -1] for grams in blocks], axis=0)
    count = int(information.rows[::2].sum())
    tests = {}
    for name, test in trained.items():
        along = sum(fits[name].squares(grams) for fits, grams in zip(fitted, blocks))
        single = sum(
            without_memory(fits[name]).squares(grams) for fits, grams in zip(fitted, blocks))
        tests[name] = ModelTest(
            test.train, np.asarray(along), np.asarray(single), test.train_effort, effort,
            (test.samples[0], count))
    return tests


@dataclass(frozen=True, eq=False)
class FilteredArmMotion:
    """
    A filtered motion of an arm with its payloads, joints in the order of the arm.

    The first `train_fraction` of its samples is for training. `contradictions` are likely causes
    why it contradicts the URDF.
    """

    arm: ArmModel
    motion: FilteredMotion
    train_fraction: float
    remarks: tuple[str, ...]
    contradictions: tuple[str, ...]

    def with_gain(self, drive_gain: FloatArray | None) -> FilteredMotion:
        """Return the motion, its effort multiplied by the gains of the drives (n,)."""
        return self.motion if drive_gain is None else self.motion.with_efforts(
            lambda effort: effort * drive_gain)


Step = Callable[[FilteredArmMotion], Any]
"""A step of the identification, which processes one recording."""


def reduce_recording(
    recording: FilteredArmMotion, reference: Fit | None = None,
    drive_gain: FloatArray | None = None, keeps_payload: bool = False,
) -> QrInformation:
    """
    Return the information in the training samples of a recording.

    `reference` is the model of a first pass, `drive_gain` (n,) the joint effort per unit of
    recorded effort. With `keeps_payload` the effort of the payloads is a column instead
    of a part of the effort that is subtracted. Raises RecordingError without effort,
    InvalidInputError with too few samples.
    """
    return reduce_motion(recording.arm, recording.with_gain(drive_gain),
                         recording.train_fraction, reference, keeps_payload)


@dataclass(frozen=True, eq=False)
class EvaluatedRecording:
    """
    The tests of the models on a recording, by name.

    `motion` is decimated to at most SHOWN samples, at which the consistent model has the effort
    `model` along the motion, and `single` sample by sample, (m, n). `test_from` is the time of the
    first test sample [s], NaN if all samples are for training. `samples` are the columns of all
    samples of the test part, with the effort of this model. `remarks` and `contradictions` are
    those of `FilteredArmMotion`.
    """

    motion: FilteredMotion
    model: FloatArray
    single: FloatArray
    test_from: float
    tests: dict[str, ModelTest]
    remarks: tuple[str, ...]
    contradictions: tuple[str, ...]
    samples: dict[str, FloatArray] | None = None


def evaluate_recording(
    recording: FilteredArmMotion, models: Mapping[str, Fit], drive_gain: FloatArray | None = None,
    keeps_samples: bool = False,
) -> EvaluatedRecording:
    """Return the tests of models on a recording, with its samples if `keeps_samples`."""
    arm, motion = recording.arm, recording.with_gain(drive_gain)
    effort, first = motion.measured_effort, train_count(motion, recording.train_fraction)
    model, single = model_effort(arm, motion, models['consistent'])
    part = slice(None, None, max(1, int(np.ceil(len(effort) / SHOWN))))
    return EvaluatedRecording(
        motion.at(part), model[part], single[part],
        float(motion.times[first]) if first < len(effort) else np.nan,
        evaluate_motion(arm, motion, recording.train_fraction, models), recording.remarks,
        recording.contradictions if drive_gain is None else corrected(arm, motion)[1],
        {name: column[first:] for name, column in motion_columns(arm, motion, {
            'measured': effort, 'model': model, 'residual': effort - model}).items()}
        if keeps_samples else None)


def prepared_motion(
    arm: ArmModel, motion: FilteredMotion, train_fraction: float, remarks: tuple[str, ...] = (),
) -> FilteredArmMotion:
    """Return a motion of an arm, without a delay of its effort, and the facts about it."""
    if motion.differentiated:
        remarks = (*remarks, 'recorded velocity is inconsistent with the position, and is not '
                             f'used, for {", ".join(motion.differentiated)}')
    motion, causes = corrected(arm, motion)
    return FilteredArmMotion(arm, motion, train_fraction, remarks, causes)


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
        with writing(paths[-1]) as new:
            write_csv(table, new)
    return paths
