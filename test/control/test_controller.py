# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a measured state to efforts, without ROS: modes, limits, references, payloads."""


from controller_bench import (
    ARM,
    make_controller,
    NAMES,
    NOW,
    options,
    Q,
    set_point,
    update,
    V,
    ZERO,
)
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm_dynamics import ArmDynamics

# --- the equation of motion ----------------------------------------------------------------------

@pytest.mark.parametrize('compensates', [(), ('friction',)])
@pytest.mark.parametrize('scale', [[1.0], [2.0, 0.5]])
def test_the_equation_of_motion_is_in_units_of_the_command(compensates, scale):
    """It has the friction that is compensated, minus what the drives of the robot add."""
    drive = make_effort_calibration(NAMES, scale)
    arm = (ARM if drive is None else ARM.with_drive(drive)).with_friction(
        make_friction(NAMES, viscous=[3.0, 2.0]))
    controller = Controller(arm, options(
        effort_convention=EffortConvention(robot_compensates=compensates)))
    update(controller, NOW, Q, V)
    controller.follow(set_point(Q.tolist(), V.tolist()), 0)
    output = update(controller, NOW, Q, V)
    M, h = output.motion_equation(Q, V)
    a, s, body = np.array([2.0, -3.0]), np.array(scale), ArmDynamics(arm).rigid_body
    friction = output.law.friction
    assert friction == pytest.approx([1.5, 0.6])
    tau = body.inverse_dynamics(Q, V, a) - body.gravity(Q) + friction
    assert M @ a + h == pytest.approx((tau - s * friction * len(compensates)) / s)


# --- missing velocity, bad states ----------------------------------------------------------------

@pytest.mark.parametrize('mode', ['gravity_compensation', 'none'])
def test_another_command_ends_the_reference(mode):
    controller = make_controller()
    update(controller, NOW, Q, ZERO)
    controller.follow(set_point([1.0, 0.2]), 0)
    controller.set_options(options(command=mode))
    controller.set_options(options())
    output = update(controller, NOW, Q, ZERO)
    assert output.reference is None
    assert output.command.tolist() == output.holding_effort().tolist()
