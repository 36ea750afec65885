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
The steps of an identification that touch a recording, as tasks: one recording, small results.

What goes in is what JSON can write, and what comes back are arrays and words, so that it can be
kept, sent from another process, and merged with that of other recordings (`bag_tasks`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics.analysis.bag_analysis import joint_effort
from robot_dynamics.analysis.batch import Configuration
from robot_dynamics.analysis.motion_filter import filter_motion, FilteredMotion
from robot_dynamics.analysis.result_store import Result
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.identification.friction_regressor import FrictionStructure
from robot_dynamics.identification.holdout import evaluate_motion, ModelTest
from robot_dynamics.identification.qr_information import QrInformation
from robot_dynamics.identification.regression import column_names, model_effort, reduce_motion
from robot_dynamics.identification.regularized_fit import Fit
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.rigid_body import RigidBody
from robot_dynamics.validation import FloatArray

SHOWN = 3000
"""Samples of a recording that are drawn, at most."""
_TEST_SUMS = ('train', 'test', 'test_by_sample', 'train_effort', 'test_effort')


def identify_configuration(
    settings: AnalysisSettings, train_fraction: float, payloads: Sequence[Payload] = (),
) -> dict[str, Any]:
    """Return what all tasks need to know."""
    return {
        'urdf': settings.urdf, 'topic': settings.topic,
        'joint_map': [list(pair) for pair in settings.joint_map], 'cutoff_hz': settings.cutoff_hz,
        'parameters': dict(settings.parameters), 'train_fraction': train_fraction,
        'payloads': [
            [payload.link, payload.mass, payload.com.tolist(), payload.inertia.tolist()]
            for payload in payloads]}


def read_motion(bag: Path, configuration: Configuration) -> (
        tuple[ArmModel, FilteredMotion, Result]):
    """
    Return the arm with its payloads, the filtered motion, and what is to be said of a recording.

    The effort is that at the joints. Raises RobotDynamicsError as `read_for_arm` and
    `filter_motion`, and RecordingError where there is no effort.
    """
    settings = AnalysisSettings(
        configuration['urdf'], configuration['topic'],
        tuple((a, b) for a, b in configuration['joint_map']), configuration['cutoff_hz'],
        configuration['parameters'])
    read = read_for_arm(bag, settings)
    arm = arm_of(configuration, read.arm.joint_names)
    motion = filter_motion(read.series, settings.cutoff_hz)
    zero = np.zeros_like(motion.position)
    gravity = RigidBody(arm).inverse_dynamics_batch(motion.position, zero, zero)
    effort, remark = joint_effort(motion, gravity, read.arm, settings.parameters)
    if effort is None:
        raise RecordingError('the recording has no effort, expected the measured effort')
    if configuration.get('drive_gain') is not None:
        effort = effort * np.array(configuration['drive_gain'])
    about: Result = {
        'arm': arm.name, 'joint_names': list(arm.joint_names),
        'joint_kinds': list(arm.joint_kinds), 'samples': len(motion.stamps_ns),
        'rate_hz': motion.sample_rate_hz, 'cutoff_hz': motion.cutoff_hz,
        'cutoff_reason': motion.cutoff_reason, 'losses': list(read.losses),
        'remarks': [*read.remarks, *([remark] if remark else []), *(
            [f'recorded velocity is no derivative of the position, and is not used, of '
             f'{", ".join(motion.differentiated)}'] if motion.differentiated else [])]}
    return arm, replace(motion, effort=effort), about


def arm_of(configuration: Configuration, joint_names: Sequence[str]) -> ArmModel:
    """Return the arm of these joints, with parameters and payloads."""
    arm = arm_from_parameters(
        configuration['urdf'], configuration['parameters'], joint_names)
    return arm.with_payloads([
        Payload(link, mass, np.array(com), np.array(inertia))
        for link, mass, com, inertia in configuration['payloads']])


def reduce_task(bag: Path, configuration: Configuration) -> Result:
    """
    Return the information in a recording.

    `configuration['reference']` is a fit, or None; with `keeps_payload` the effort is taken as it
    is, and what a payload takes is not subtracted.
    """
    arm, motion, about = read_motion(bag, configuration)
    if configuration.get('keeps_payload'):
        arm = arm.with_payloads(())
    reference = configuration.get('reference')
    information = reduce_motion(
        arm, motion, configuration['train_fraction'],
        None if reference is None else fit_from(reference))
    return {**about, 'factors': information.factors, 'rows': information.rows,
            'correlation': information.correlation, 'columns': list(column_names(arm))}


def information_of(result: Result) -> QrInformation:
    """Return the information that `reduce_task` found."""
    return QrInformation(
        tuple(result['joint_names']), tuple(result['columns']), np.asarray(result['factors']),
        np.asarray(result['rows']), np.asarray(result['correlation']))


def evaluate_task(bag: Path, configuration: Configuration) -> Result:
    """Return how well `configuration['models']`, fits by name, predict a recording."""
    arm, motion, about = read_motion(bag, configuration)
    models = {name: fit_from(fit) for name, fit in configuration['models'].items()}
    result = dict(about)
    tests = evaluate_motion(arm, motion, configuration['train_fraction'], models)
    for name, test in tests.items():
        for field in _TEST_SUMS:
            result[f'{name}/{field}'] = getattr(test, field)
        result[f'{name}/samples'] = list(test.samples)
    if configuration.get('shown'):
        result |= _series(arm, motion, models[configuration['shown']])
    return result




def tests_of(result: Result, names: Sequence[str]) -> dict[str, ModelTest]:
    """Return the tests that `evaluate_task` made, of the models with these names."""
    def test(name: str) -> ModelTest:
        train, test, by_sample, train_effort, test_effort = (
            np.asarray(result[f'{name}/{field}']) for field in _TEST_SUMS)
        first, last = result[f'{name}/samples']
        return ModelTest(
            train, test, by_sample, train_effort, test_effort, (int(first), int(last)))

    return {name: test(name) for name in names}


def _series(arm: ArmModel, motion: FilteredMotion, fit: Fit) -> Result:
    """Return measured and model effort over time, thinned out for a picture."""
    assert motion.effort is not None
    step = max(1, int(np.ceil(len(motion.effort) / SHOWN)))
    return {'times': motion.times[::step], 'velocity': motion.velocity[::step],
            'measured': motion.effort[::step],
            'model': model_effort(arm, motion, fit)[0][::step]}


def fit_as_data(fit: Fit) -> dict[str, Any]:
    """Return a fit as JSON can write it."""
    return {
        'parameters': fit.parameters.tolist(), 'joint_values': fit.joint_values.tolist(),
        'structures': [list(structure) for structure in fit.structures]}


def fit_from(data: Mapping[str, Any]) -> Fit:
    """Return the fit that `fit_as_data` wrote."""
    values: FloatArray = np.array(data['joint_values'])
    return Fit(
        np.array(data['parameters']), values,
        tuple(FrictionStructure(*structure) for structure in data['structures']))
