# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Identification from recordings on disk: the steps of `identification`, as tasks.

Every recording is read three times: for what it says by the URDF's load, for what it says by that
of the first model, and for the test. What is between takes seconds. Whoever runs the tasks, one by
one, in processes or on a cluster, is given as a function.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.analysis.batch import Task, TaskOutcome
from robot_dynamics.analysis.result_store import Result
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.identification.drive_gains import drive_gains, DriveGains
from robot_dynamics.identification.holdout import merge_tests
from robot_dynamics.identification.pipeline import describe, fit_model, Identification
from robot_dynamics.identification.qr_information import merge, QrInformation
from robot_dynamics.identification.tasks import (
    arm_of,
    evaluate_task,
    fit_as_data,
    information_of,
    reduce_task,
    tests_of,
)
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import inertial_parameters

Runner = Callable[[Task, Sequence[Path], Mapping[str, Any]], list[TaskOutcome]]
"""Runs a task on recordings, with a configuration."""
STAGES = ('what the recordings say', 'model', 'what they say beside it', 'better model', 'test')


@dataclass(frozen=True, eq=False)
class BagIdentification:
    """
    An identification, and what it was made of.

    `used` are the recordings with what was said of each, `failed` the others with their errors.
    `gains` are those of the drives where the effort was taken for a current, and `seeming_gains`
    those that effort would have as one.
    """

    identification: Identification
    used: tuple[Result, ...]
    bags: tuple[Path, ...]
    failed: tuple[tuple[Path, str], ...]
    gains: DriveGains | None
    seeming_gains: DriveGains


def identify_bags(
    bags: Sequence[Path], configuration: Mapping[str, Any], run: Runner,
    effort_is_current: bool | None = None, on_stage: Callable[[str], None] = lambda _: None,
) -> BagIdentification:
    """
    Return the identification of an arm from recordings; `configuration` as for the tasks.

    `effort_is_current` None takes effort for currents where the gains of joints differ. `on_stage`
    hears of each of STAGES before it begins. Recordings that fail are left out. Raises
    RecordingError where all fail, InvalidInputError where their joints differ, or no drive's gain
    can be told.
    """
    on_stage(STAGES[0])
    failed: dict[Path, str] = {}
    left = list(bags)

    def results(task: Task, **more: Any) -> list[Result]:
        outcomes = run(task, left, {**configuration, **more})
        failed.update({outcome.bag: outcome.error for outcome in outcomes
                       if outcome.result is None})
        left[:] = [outcome.bag for outcome in outcomes if outcome.result is not None]
        if not left:
            raise RecordingError('no recording can be used: ' + '; '.join(
                f'{bag.name}: {error}' for bag, error in failed.items()))
        return [outcome.result for outcome in outcomes if outcome.result is not None]

    gains: DriveGains | None = None
    more: dict[str, Any] = {}
    first: list[Result] = []
    if effort_is_current is None:
        first = results(reduce_task)
        arm = arm_of(configuration, first[0]['joint_names'])
        bare = inertial_parameters(arm.with_payloads(()))
        effort_is_current = drive_gains(_merged(first), bare).differ
    if effort_is_current:
        raw = results(reduce_task, keeps_payload=True)
        arm = arm_of(configuration, raw[0]['joint_names'])
        gains = drive_gains(_merged(raw), inertial_parameters(arm))
        _check_gains(gains, arm)
        more['drive_gain'] = np.where(gains.is_known, gains.gain, 1.0).tolist()
    if not first or more:
        first = results(reduce_task, **more)
    arm = arm_of(configuration, first[0]['joint_names'])
    on_stage(STAGES[1])
    information = _merged(first)
    seeming = drive_gains(information, inertial_parameters(arm.with_payloads(())))
    begun = fit_model(arm, information)
    on_stage(STAGES[2])
    second = results(reduce_task, reference=fit_as_data(begun.base), **more)
    on_stage(STAGES[3])
    information = _merged(second)
    models = fit_model(arm, information, begun.choice.structures)
    base, estimate = describe(arm, models, information)
    on_stage(STAGES[4])
    fits = {name: fit_as_data(fit) for name, fit in models.by_name.items()}
    used = results(evaluate_task, models=fits, shown='consistent', **more)
    tests = merge_tests([tests_of(result, list(fits)) for result in used])
    return BagIdentification(
        Identification(arm, models, base, estimate, information, tests), tuple(used),
        tuple(left), tuple(failed.items()), gains, seeming)


def _merged(results: Sequence[Result]) -> QrInformation:
    return merge([information_of(result) for result in results])


def _check_gains(gains: DriveGains, arm: ArmModel) -> None:
    if not gains.is_known.any():
        raise InvalidInputError(
            f'the gain of no drive of {list(arm.joint_names)} can be told from effort as '
            'current, expected a motion in which the joints bear loads well above friction')
