# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Arms whose model has other masses and friction than the arm, by a known uncertainty."""

from dataclasses import replace

from arm_motions import with_inertial_parameters
import numpy as np
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.model.regressor import inertial_parameters, parameter_names
from robots import arm_without_gripper, effort_limit

ARMS = ('default', 'ur10', 'panda', 'z1', 'xarm7', 'kinova')
RATE = 250.0
MASS, FRICTION = 0.1, 0.2
"""Relative deviations of the mass of each link, and of each friction coefficient."""
DRY, VISCOUS, NOISE = 0.02, 0.02, 0.005
"""Dry friction, viscous friction at the velocity limit, and noise, by the effort limit."""
ROTOR = 0.003
"""Reflected rotor inertia by the effort limit [s²]."""
BAND = 5.0
"""Band [Hz] in which the uncertainty states the noise, which is white."""
SPEED = 2.0
"""[rad/s] of joints without a velocity limit."""


def model_arm(name: str) -> ArmModel:
    """Return the model: an arm with friction and the uncertainty of its masses and friction."""
    arm = arm_without_gripper(name)
    limit = effort_limit(arm)
    speed = np.where(np.isfinite(arm.limits.velocity) & (arm.limits.velocity > 0.0),
                     arm.limits.velocity, SPEED)
    arm = arm.with_reflected_inertia(ROTOR * limit)
    dry, viscous = DRY * limit, VISCOUS * limit / speed
    arm = arm.with_friction(make_friction(arm.joint_names, viscous, dry))
    bodies = inertial_parameters(arm).reshape(-1, 10)
    names = [*parameter_names(arm),
             *(f'{kind}({joint})' for kind in ('viscous', 'coulomb') for joint in arm.joint_names)]
    size = len(names)
    root = np.zeros((size, len(bodies) + 2 * arm.joint_count))
    for i, phi in enumerate(bodies):
        root[10 * i:10 * i + 10, i] = MASS * phi
    friction = np.arange(2 * arm.joint_count)
    root[10 * len(bodies) + friction, len(bodies) + friction] = FRICTION * np.concatenate(
        [viscous, dry])
    covariance = root @ root.T
    noise = NOISE * limit * (2.0 * BAND / RATE)**0.5
    return replace(arm, uncertainty=make_uncertainty(
        arm, names, covariance[np.tril_indices(size)], noise, BAND,
        friction_deviation=dry / 3**0.5, friction_velocity=[0.04]))


def true_arm(model: ArmModel, rng: np.random.Generator) -> ArmModel:
    """Return an arm that differs from the model by the model's uncertainty."""
    bodies = inertial_parameters(model).reshape(-1, 10)
    scale = 1.0 + MASS * rng.normal(size=(len(bodies), 1))
    friction = [np.maximum(1.0 + FRICTION * rng.normal(size=model.joint_count), 0.0) * each
                for each in (model.friction.viscous, model.friction.coulomb)]
    arm = with_inertial_parameters(model, (scale * bodies).ravel())
    return arm.with_friction(make_friction(arm.joint_names, *friction))
