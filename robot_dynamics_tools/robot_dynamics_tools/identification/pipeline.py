# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Identification of an arm from recordings: the sequence of all steps.

`identify_recordings` runs the steps. Steps that process samples (`steps`) run on each recording
separately, in memory (`identify`) or on files (`bag_identification`). The steps between them take
one or two seconds for any number of recordings.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model import regressor
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics_tools.analysis.motion_filter import FilteredMotion
from robot_dynamics_tools.base_parameters import BaseParameters, find_base_parameters
from robot_dynamics_tools.identification import model_selection, recording_agreement, steps
from robot_dynamics_tools.identification.drive_gains import (
    drive_gains,
    GainEstimate,
    other_unit,
)
from robot_dynamics_tools.identification.friction_regressor import FrictionStructure
from robot_dynamics_tools.identification.qr_information import merge, QrInformation
from robot_dynamics_tools.identification.regularized_fit import make_prior, Prior
from robot_dynamics_tools.identification.uncertainty import estimate_parameters, ParameterEstimate

TRAIN_FRACTION = 0.6
STAGES = ('information', 'model', 'information with the model', 'improved model', 'test')
_STATES = 60


@dataclass(frozen=True, eq=False)
class Observability:
    """
    What recordings determine: the fitted models, and the base parameters.

    `gains` are the gains of the drives if the effort was interpreted as a current.
    """

    arm: ArmModel
    information: QrInformation
    gains: GainEstimate | None
    models: model_selection.FittedModels
    estimate: ParameterEstimate


@dataclass(frozen=True, eq=False)
class Identification(Observability):
    """
    The result of an identification: what it determined, and the tests of the models.

    `seeming_gains` are the gains that would result if the effort were interpreted as a current.
    `recordings` are the tested recordings. With `is_cross_validated`, no samples were left for the
    test, and `tests` have the residual on the cross-validation folds. `difference` (b,) is that of
    the bodies of the consistent set from the URDF (`recording_agreement`).
    """

    base: BaseParameters
    tests: dict[str, steps.ModelTest]
    seeming_gains: GainEstimate
    recordings: tuple[steps.EvaluatedRecording, ...]
    difference: FloatArray
    is_cross_validated: bool = False


class Recordings(NamedTuple):
    """
    Recordings of one arm; the steps run on each recording separately.

    `arm` returns the arm of these joints with its payloads, `run` the result of a step on each
    recording.
    """

    arm: Callable[[Sequence[str]], ArmModel]
    run: Callable[[steps.Step], list[Any]]

    def information(self, **options: Any) -> list[QrInformation]:
        """Return the information in each recording, with options of `reduce_recording`."""
        return self.run(partial(steps.reduce_recording, **options))


def observability(recordings: Recordings, effort_is_current: bool | None) -> Observability:
    """Return what the recordings determine, from one pass; raise like `identify_recordings`."""
    first, gains = _first_pass(recordings, effort_is_current)
    arm = recordings.arm(first.joint_names)
    models, base = fit_model(arm, first), base_parameters_of(arm.with_payloads(()))
    return Observability(
        arm, first, gains, models, estimate_parameters(first, base, models.problem))


def prior_of(arm: ArmModel) -> Prior:
    """Return the prior model, from the arm's URDF."""
    bare = arm.with_payloads(())
    body = RigidBody(bare)
    inertia = np.mean([
        np.diag(body.mass_matrix(q)) for q in regressor.random_states(bare, _STATES)[0]], axis=0)
    return make_prior(regressor.inertial_parameters(bare), inertia, arm.limits.velocity)


def base_parameters_of(arm: ArmModel, gravities: Sequence[Sequence[float]] = ()) -> BaseParameters:
    """
    Return the base parameters of the arm's bodies and the reflected inertia of its rotors.

    `gravities` (3,) [m/s²] are several vectors of gravity, empty for that of the arm.
    """
    q, v, a = regressor.random_states(arm, _STATES)
    rotors = a[:, :, np.newaxis] * np.eye(arm.joint_count)
    X = np.concatenate([
        np.concatenate([regressor.TorqueRegressor(each)(q, v, a), rotors], axis=2)
        for each in [arm.with_gravity(gravity) for gravity in gravities] or [arm]])
    names = (*regressor.parameter_names(arm), *(f'Ia({joint})' for joint in arm.joint_names))
    return find_base_parameters(X.reshape(-1, X.shape[2]), names)


def fit_model(
    arm: ArmModel, information: QrInformation,
    first: Sequence[FrictionStructure] | None = None,
) -> model_selection.FittedModels:
    """Return the models that are fitted to the information of all recordings."""
    return model_selection.fit_models(
        information.together(), *model_selection.choose_model(information, prior_of(arm), first),
        regressor.inertial_parameters(arm.with_payloads(())))


def identify(
    arm: ArmModel, motions: Sequence[FilteredMotion], train_fraction: float = TRAIN_FRACTION,
    effort_is_current: bool | None = False,
) -> Identification:
    """
    Return the identification of an arm from motions of its joints, in its order.

    The first fraction of the samples of each motion is used for training, the rest for the test.
    Raises RecordingError if a motion has no effort, InvalidInputError if it has too few samples,
    and the errors of `identify_recordings`. Needs scipy.
    """
    recorded = [steps.prepared_motion(arm, motion, train_fraction) for motion in motions]
    return identify_recordings(Recordings(
        lambda _: arm, lambda step: [step(each) for each in recorded]), effort_is_current)


def identify_recordings(
    recordings: Recordings, effort_is_current: bool | None,
    on_stage: Callable[[str], None] = lambda _: None, keeps_samples: bool = False,
) -> Identification:
    """
    Return the identification of an arm from recordings.

    With `keeps_samples`, its recordings have the samples of the test part.

    If `effort_is_current` is None, efforts are interpreted as currents if the gains of most joints
    differ. `on_stage` is called with each of STAGES before it begins. Raises InvalidInputError if
    the joints of recordings differ, if no drive gain is identifiable, for torques of the opposite
    sign, and without `effort_is_current` for efforts in an unknown unit.
    """
    on_stage(STAGES[0])
    first, gains = _first_pass(recordings, effort_is_current)
    arm = recordings.arm(first.joint_names)
    scale = None if gains is None else gains.scale
    on_stage(STAGES[1])
    seeming = drive_gains(first, prior_of(arm))
    begun = fit_model(arm, first)
    on_stage(STAGES[2])
    parts = recordings.information(reference=begun.by_name['base'], drive_gain=scale)
    information = merge(parts)
    on_stage(STAGES[3])
    models = fit_model(arm, information, begun.problem.structures)
    base = base_parameters_of(arm.with_payloads(()))
    estimate = estimate_parameters(information, base, models.problem)
    odd = recording_agreement.contradicting_recordings(parts, models.problem)
    on_stage(STAGES[4])
    evaluated: list[steps.EvaluatedRecording] = recordings.run(partial(
        steps.evaluate_recording, models=models.by_name, drive_gain=scale,
        keeps_samples=keeps_samples))
    for i, text in odd.items():
        evaluated[i] = replace(
            evaluated[i], contradictions=(*evaluated[i].contradictions, text))
    tests = {name: steps.merge_tests([recording.tests[name] for recording in evaluated])
             for name in models.by_name}
    is_cross_validated = tests['base'].samples[1] == 0
    if is_cross_validated:
        tests = steps.cross_validated_tests(information, models, tests)
    return Identification(
        arm, information, gains, models, estimate, base, tests, seeming, tuple(evaluated),
        recording_agreement.difference_from_urdf(models.consistent, models.problem.prior),
        is_cross_validated)


def _first_pass(
    recordings: Recordings, effort_is_current: bool | None,
) -> tuple[QrInformation, GainEstimate | None]:
    """Return the information with the load of the URDF, and gains if the effort is a current."""
    if not effort_is_current:
        first = merge(recordings.information())
        arm = recordings.arm(first.joint_names)
        gains = drive_gains(first, prior_of(arm))
        if effort_is_current is False or not gains.differ:
            _check_torque(arm, gains, effort_is_current)
            return first, None
    raw = merge(recordings.information(keeps_payload=True))
    arm = recordings.arm(raw.joint_names)
    gains = drive_gains(raw, prior_of(arm))
    if not gains.is_known.any():
        raise InvalidInputError(
            f'no drive gain of {list(arm.joint_names)} is identifiable from effort as current, '
            'expected a motion in which the joints bear loads well above friction')
    return merge(recordings.information(drive_gain=gains.scale)), gains


def _check_torque(arm: ArmModel, gains: GainEstimate, effort_is_current: bool | None) -> None:
    """Raise InvalidInputError for efforts of the opposite sign, or in an unknown unit."""
    if effort_is_current is None and gains.is_off.any():
        raise InvalidInputError(
            f'{other_unit(arm.joint_names, gains)}; if it is a torque, and the masses of the URDF '
            'are wrong, use --effort torque')
    is_reversed = gains.is_known & gains.is_reversed
    if is_reversed.any():
        listed = [name for name, is_so in zip(arm.joint_names, is_reversed) if is_so]
        raise InvalidInputError(
            f'the effort has the opposite sign at {", ".join(listed)}, expected that of the '
            'motion: set effort.report_scale of these joints to -1 (--parameters), or reverse '
            'their axes in the URDF')
