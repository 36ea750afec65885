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
Identification of an arm from recordings: the whole way, step by step.

Each step that touches samples is a function of one recording alone (`reduce_motion`,
`evaluate_motion`), whose results are small and merge exactly, so that recordings may be worked on
one by one, or side by side in many processes; what lies between (`fit_model`, `describe`) takes a
second or two, whatever their number.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.analysis.motion_filter import FilteredMotion
from robot_dynamics.identification.consistent_fit import consistent_fit
from robot_dynamics.identification.friction_regressor import FrictionStructure
from robot_dynamics.identification.holdout import evaluate_motion, merge_tests, ModelTest
from robot_dynamics.identification.model_selection import choose_model, ModelChoice
from robot_dynamics.identification.qr_information import merge, QrInformation
from robot_dynamics.identification.regression import bare_arm, reduce_motion
from robot_dynamics.identification.regularized_fit import (
    Fit,
    make_prior,
    Prior,
    PULL_OF_URDF,
    solve_bounded,
)
from robot_dynamics.identification.uncertainty import estimate_parameters, ParameterEstimate
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.base_parameters import BaseParameters, find_base_parameters
from robot_dynamics.model.regressor import (
    inertial_parameters,
    parameter_names,
    random_states,
    TorqueRegressor,
)
from robot_dynamics.model.rigid_body import RigidBody

TRAIN_FRACTION = 0.6
_STATES = 60


@dataclass(frozen=True, eq=False)
class FittedModels:
    """
    Models of one arm, fitted to the same samples, and how they were chosen.

    `urdf` has the bodies of the URDF and no friction, `friction` the bodies of the URDF and
    friction that was fitted, `base` the pulled base parameters, `consistent` the physically
    consistent set.
    """

    choice: ModelChoice
    urdf: Fit
    friction: Fit
    base: Fit
    consistent: Fit

    @property
    def by_name(self) -> dict[str, Fit]:
        return {'urdf': self.urdf, 'urdf and friction': self.friction, 'base': self.base,
                'consistent': self.consistent}


@dataclass(frozen=True, eq=False)
class Identification:
    """What recordings tell of an arm: the models, the base parameters, and how good they are."""

    arm: ArmModel
    models: FittedModels
    base: BaseParameters
    estimate: ParameterEstimate
    information: QrInformation
    tests: dict[str, ModelTest]


def prior_of(arm: ArmModel) -> Prior:
    """Return what the arm's URDF says before any recording."""
    bare = bare_arm(arm)
    body = RigidBody(bare)
    inertia = np.mean([
        np.diag(body.mass_matrix(q)) for q in random_states(bare, _STATES)[0]], axis=0)
    return make_prior(inertial_parameters(bare), inertia)


def base_parameters_of(arm: ArmModel) -> BaseParameters:
    """Return the base parameters of the arm's bodies and the reflected inertia of its rotors."""
    q, v, a = random_states(arm, _STATES)
    m, n = q.shape
    rotors = np.zeros((m, n, n))
    rotors[:, np.arange(n), np.arange(n)] = a
    X = np.concatenate([TorqueRegressor(arm)(q, v, a), rotors], axis=2)
    names = (*parameter_names(arm), *(f'Ia({joint})' for joint in arm.joint_names))
    return find_base_parameters(X.reshape(m * n, -1), names)


def fit_model(
    arm: ArmModel, information: QrInformation,
    first: Sequence[FrictionStructure] | None = None,
) -> FittedModels:
    """Return the models that the information of all recordings gives."""
    prior = prior_of(arm)
    choice = choose_model(information, prior, first)
    factors = information.together()
    n = len(information.joint_names)
    base = solve_bounded(factors, choice.structures, choice.weights, prior, choice.pull)
    friction = solve_bounded(factors, choice.structures, choice.weights, prior, PULL_OF_URDF)
    consistent = consistent_fit(
        factors, choice.structures, choice.weights, prior, choice.pull, base)
    urdf = Fit(inertial_parameters(bare_arm(arm)), np.zeros_like(base.joint_values[:n]),
               choice.structures)
    return FittedModels(choice, urdf, friction, base, consistent)


def describe(arm: ArmModel, models: FittedModels, information: QrInformation) -> (
        tuple[BaseParameters, ParameterEstimate]):
    """Return the base parameters and what the information says of them, with deviations."""
    base = base_parameters_of(bare_arm(arm))
    return base, estimate_parameters(
        information, base, prior_of(arm), models.choice.structures)


def identify(
    arm: ArmModel, motions: Sequence[FilteredMotion], train_fraction: float = TRAIN_FRACTION,
) -> Identification:
    """
    Return the identification of an arm from recordings of its joints, in its order.

    The first share of each recording's samples is trained with, the rest tested with. Raises
    RecordingError where one has no effort, InvalidInputError where it has too few samples. Needs
    scipy.
    """
    first = merge([reduce_motion(arm, motion, train_fraction) for motion in motions])
    begun = fit_model(arm, first)
    information = merge([
        reduce_motion(arm, motion, train_fraction, begun.base) for motion in motions])
    models = fit_model(arm, information, begun.choice.structures)
    base, estimate = describe(arm, models, information)
    tests = merge_tests([
        evaluate_motion(arm, motion, train_fraction, models.by_name) for motion in motions])
    return Identification(arm, models, base, estimate, information, tests)

