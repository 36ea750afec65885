# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Arms whose model has other masses and friction than the arm, by a known uncertainty."""

from dataclasses import replace
from typing import NamedTuple

from arm_motions import with_inertial_parameters
from lock_step_loop import FIRST_STAMP
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.model.external_wrench import Wrenches
from robot_dynamics.model.regressor import inertial_parameters, parameter_names
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
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
        friction_deviation=dry / 3**0.5, friction_velocity=[0.02]))


def true_arm(model: ArmModel, rng: np.random.Generator) -> ArmModel:
    """Return an arm that differs from the model by the model's uncertainty."""
    bodies = inertial_parameters(model).reshape(-1, 10)
    scale = 1.0 + MASS * rng.normal(size=(len(bodies), 1))
    friction = [np.maximum(1.0 + FRICTION * rng.normal(size=model.joint_count), 0.0) * each
                for each in (model.friction.viscous, model.friction.coulomb)]
    arm = with_inertial_parameters(model, (scale * bodies).ravel())
    return arm.with_friction(make_friction(arm.joint_names, *friction))


class Sample(NamedTuple):
    """A measured state; `effort` has noise."""

    q: FloatArray
    v: FloatArray
    effort: FloatArray


class WrongModel:
    """The loop of `dynamics` in lock-step with an arm that is not exactly its model."""

    def __init__(self, model: ArmModel, rng: np.random.Generator) -> None:
        self.model, self.rng = model, rng
        lower, upper = (np.clip(each, -2.5, 2.5) for each in (
            model.limits.lower, model.limits.upper))
        self.low, self.high = lower + 0.25 * (upper - lower), upper - 0.25 * (upper - lower)
        self.loop = ControlLoop.of_arm(model)
        self.plant = ArmSimulation(true_arm(model, rng), self.goal())
        self.plant.release()
        self.noise = model.uncertainty.noise(0.5 * RATE, 1.0 / RATE)
        self.k = 0
        self.step()

    def goal(self) -> FloatArray:
        """Return a random position."""
        return np.asarray(self.rng.uniform(self.low, self.high))

    def follow(self, q: FloatArray) -> None:
        """Go to a position."""
        names = self.model.joint_names
        self.loop.follow(make_trajectory(names, [0.0], [q.tolist()], (), (), names))

    @property
    def is_running(self) -> bool:
        """Whether there is no fault, such as a push beyond the velocity limit."""
        return self.loop.supervisor.mode is Mode.RUNNING

    def step(self, wrenches: Wrenches = ()) -> Sample:
        """Return the next measured state, after its effort has acted until then."""
        q, v = self.plant.state
        stamp = FIRST_STAMP + round(1e9 * self.k / RATE)
        effort = self.loop.answer(stamp, q, v).effort
        self.k += 1
        q, v = self.plant.step(effort, 1.0 / RATE, wrenches)
        return Sample(q, v, effort + self.noise * self.rng.normal(size=len(q)))
