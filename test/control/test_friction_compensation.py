# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The velocity at which computed torque compensates friction: of the reference, or measured."""

import numpy as np
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
GAINS = make_gains(NAMES)
VISCOUS, COULOMB, LOAD = 2.0, 4.0, 0.1
SECOND = 1_000_000_000


def answer(arm: ArmModel, mode: str, q: list[float], v: list[float]) -> ControlOutput:
    """Return the answer to a state while a reference rests at (1, −1)."""
    one = Controller(arm, ControllerOptions(GAINS, friction_compensation=mode))
    one.update(SECOND, np.zeros(2), np.zeros(2))
    one.follow(make_trajectory(
        NAMES, (0.001,), [[1.0, -1.0]], [[0.0, 0.0]], [[0.0, 0.0]], NAMES), 0)
    return one.update(2 * SECOND, np.array(q), np.array(v))


def compensated(mode: str, q: list[float], v: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the friction that is compensated, and the effort of the rigid bodies, (2,) each."""
    friction = make_friction(NAMES, viscous=[VISCOUS], coulomb=[COULOMB], load_coefficient=[LOAD])
    effort = answer(ARM.with_friction(friction), mode, q, v).computed_torque
    rigid = answer(ARM.with_friction(make_friction(NAMES)), mode, q, v).computed_torque
    return effort - rigid, rigid


def friction_at(velocity: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return viscous, dry and load-dependent friction of joints that move."""
    return np.asarray(
        VISCOUS * velocity + np.sign(velocity) * (COULOMB + LOAD * np.abs(load)))


Q, V = [0.5, -0.2], [-0.7, 1.1]  # the reference is ahead; the joints move away from it


def test_no_friction_is_compensated() -> None:
    friction, _ = compensated('none', Q, V)
    assert friction.tolist() == [0.0, 0.0]


def test_around_rest_friction_of_the_reference_has_no_step() -> None:
    steps = []
    for mode, still in (('reference', [1.0, -1.0]), ('measured', [1.0, -1.0])):
        speed = 1e-5
        q = np.array(still) - speed * GAINS.kd / GAINS.kp  # v_r = speed
        friction, _ = compensated(mode, q.tolist(), [speed, speed])
        steps.append(np.abs(friction))
    assert (steps[0] < 0.01 * COULOMB).all()
    assert (steps[1] >= COULOMB).all()
