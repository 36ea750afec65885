# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The end of a reference and the command after it, on real nodes with default parameters.

After each interruption the effort stays near the gravity torque of the measured position,
independent of the reference before the interruption and of messages sent during it.
"""

import re

from fault_bench import figure_of, G, Q
from fault_stimuli import follow, move_by_hand, RATE, Swing, wait_effort
from fault_table import fault, fault_cases
from interruption_bench import check_held, ELSEWHERE, gravity, GROUP, HELD, LIMIT, wait_rejected
from lifecycle_bench import ACTIVATE, DEACTIVATE
import numpy as np
import pytest
from rclpy.parameter import Parameter
from robot_dynamics.control.safety.effort_limiter import LONGEST_STEP
from ros_harness import wait_until
from std_srvs.srv import Trigger

SWING = 43.0
"""Angular frequency of an arm that is too fast [rad/s]."""

# --- trajectories that are sent while no reference can be followed ------------------------------

@fault(GROUP, 'a trajectory and a set-point during a timeout of the joint states',
       f'rejected with the fault as the reason; after recovery {HELD}')
def test_an_outage(arm):
    arm.driver.be_quiet()
    arm.wait_state_timeout()
    status = arm.next_status('reference')
    assert status.message.startswith('ended early: fault state_timeout: no valid joint state')
    wait_rejected(arm, 'no reference can be followed now: fault state_timeout')
    arm.wait_silent()  # the fault action has ended
    arm.efforts.clear()
    arm.driver.q = list(ELSEWHERE)  # the node has no data on the motion during the outage
    arm.driver.go_on()
    check_held(arm, ELSEWHERE)
    assert arm.next_status('reference').message.startswith('ended early: ')
    follow(arm, ELSEWHERE)  # a later set-point is followed


@fault(GROUP, 'a trajectory and a set-point during the fault `position_limit`',
       f'rejected with the fault as the reason; during the fault and after it {HELD}')
def test_a_position_limit(arm):
    arm.set_parameters(command='gravity_compensation')  # allows to move the arm by hand
    beyond = [LIMIT + 0.02, Q[1]]
    move_by_hand(arm, beyond)
    assert "position of 'joint1' is 2.5" in arm.wait_fault('position_limit').message
    wait_rejected(arm, 'no reference can be followed now: fault position_limit')
    arm.efforts.clear()
    check_held(arm, beyond)
    inside = [LIMIT - 0.1, Q[1]]
    move_by_hand(arm, inside)
    arm.wait_running()
    arm.wait_steady(gravity(inside))  # the effort leaves that of the fault at a limited rate
    arm.efforts.clear()
    check_held(arm, inside)
    arm.set_parameters(command='computed_torque')
    arm.efforts.clear()
    check_held(arm, inside)


# --- an arm that is moved by hand ----------------------------------------------------------------

@fault(GROUP, 'deactivation; the arm is moved by hand; activation',
       f'a trajectory sent in between is rejected; after activation {HELD}')
def test_deactivation(arm):
    assert arm.change(DEACTIVATE)
    assert arm.next_status('reference').message == 'ended early: the node was deactivated'
    move_by_hand(arm, ELSEWHERE)
    wait_rejected(arm, 'no reference can be followed now: the node is not active')
    arm.efforts.clear()
    assert arm.change(ACTIVATE)
    assert arm.efforts.wait_for().effort == pytest.approx(gravity(ELSEWHERE), abs=1e-6)
    check_held(arm, ELSEWHERE)


@pytest.mark.parametrize('command', [
    pytest.param(command, marks=fault(
        GROUP, f'`command: {command}`; the arm is moved by hand; `command: computed_torque`',
        f'a trajectory sent in between is rejected; afterwards {HELD}'))
    for command in ('gravity_compensation', 'none')])
def test_another_command(arm, command):
    arm.set_parameters(command=command)
    ended = f'ended early: command was set to {command!r}'
    assert arm.next_status('reference').message == ended
    if command == 'none':
        arm.wait_silent()
    move_by_hand(arm, ELSEWHERE)
    wait_rejected(arm, f"command is '{command}', expected 'cartesian_impedance'")
    if command != 'none':
        arm.efforts.clear()
        wait_effort(arm, gravity(ELSEWHERE))
    arm.efforts.clear()
    arm.set_parameters(command='computed_torque')
    check_held(arm, ELSEWHERE)
    assert arm.next_status('reference').message == ended  # until the next reference
    follow(arm, ELSEWHERE)


# --- faults --------------------------------------------------------------------------------------

@fault_cases(
    'v', GROUP, 'joint velocities of {} while a reference is followed',
    'fault `overspeed` that names joint and velocity; g(q) with damping, finite and within '
    'the limits; ends automatically; after the third, references wait for `~/reset_fault`', (
        ('13 rad/s, 1.3 times the limit', [13.0, 0.0]),
        ('-20 and 20 rad/s', [-20.0, 20.0])))
def test_overspeed(arm, v):
    before = arm.known('command', 'faults: overspeed')
    arm.efforts.clear()
    arm.driver.change = Swing(Q, np.divide(v, SWING).tolist(), SWING)
    status = arm.wait_fault('overspeed')
    assert "velocity of 'joint" in status.message
    assert 'expected at most 1.2 times' in status.message
    assert '(overspeed_factor)' in status.message
    assert figure_of(status, 'faults: overspeed') > before  # again, if the status is late
    # damping against the motion of joint1, and never zero
    arm.efforts.wait_for(lambda message: abs(message.effort[0] - G[0]) > 50.0)
    arm.wait_message('reference', 'ended early: fault overspeed: .*')
    arm.wait_message('command', '.*waits for ~/reset_fault')
    arm.driver.go_on()
    wait_rejected(arm, 'no reference can be followed now: fault overspeed: ')
    response = arm.client.call(Trigger, arm.name('reset_fault'))
    assert response.success
    assert response.message.startswith("reset overspeed: velocity of 'joint")
    arm.wait_running()
    follow(arm, Q)
    wait_until(
        lambda: np.allclose(arm.efforts.messages[-1].effort, G, atol=1e-6), 'the gravity torque')
    arm.check_efforts()
    assert all((np.abs(m.effort) <= [150.0, 60.0]).all() for m in arm.efforts.messages)


@fault(GROUP, 'an arm that does not follow its reference',
       'fault `following_error` that names joint and distance; the arm is held at its '
       'measured position; the reference has ended')
def test_a_following_error(arm):
    before = arm.known('command', 'faults: following_error')
    arm.set_parameters(following_error_limit=[0.05])
    arm.efforts.clear()
    arm.set_point([Q[0] + 0.2, Q[1]])  # the driver reports that the arm stays
    arm.wait_figure('command', 'faults: following_error', before + 1)
    status = arm.wait_message('reference', 'ended early: .*')
    assert re.match(
        r"ended early: fault following_error: position of 'joint1' is 0\..* from its reference, "
        r'expected at most 0\.05 \(following_error_limit\)', status.message)
    arm.wait_running()
    wait_until(
        lambda: np.allclose(arm.efforts.messages[-1].effort, G, atol=1e-6), 'the gravity torque')
    assert (arm.efforts.steps() <= RATE * LONGEST_STEP + 1e-6).all()
    arm.efforts.clear()
    check_held(arm, Q)
    assert arm.figure('command', 'faults: following_error') == before + 1
    unset = Parameter('following_error_limit', Parameter.Type.DOUBLE_ARRAY, [])
    arm.set_parameters(following_error_limit=unset)
