# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a measured state to efforts, without ROS: modes, limits, references, payloads."""

from collections import Counter
import threading
import time

from children import LONG
from controller_bench import (
    ARM,
    gravity_with,
    LOAD,
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


# --- threads -------------------------------------------------------------------------------------

def test_changes_from_another_thread_never_mix():
    """While one thread replaces loads and modes, each effort is that of one of the two loads."""
    controller = make_controller()
    allowed = [gravity_with([]), gravity_with([LOAD])]
    stop = threading.Event()

    def change() -> None:
        while not stop.is_set():
            controller.set_payloads([LOAD], 0.0, lambda _: None)
            controller.set_options(options(command='gravity_compensation'))
            controller.set_payloads([], 0.0, lambda _: None)
            controller.set_options(options())

    thread = threading.Thread(target=change)
    thread.start()
    seen: Counter[int] = Counter()
    deadline = time.monotonic() + LONG
    try:
        while min(seen[0], seen[1]) < 500 and time.monotonic() < deadline:
            effort = update(controller, NOW + seen.total(), Q, ZERO).command
            far = [np.abs(effort - one).max() for one in allowed]
            assert min(far) < 1e-9
            seen[int(np.argmin(far))] += 1
    finally:
        stop.set()
        thread.join()
    assert min(seen[0], seen[1]) >= 500
