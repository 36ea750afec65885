# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The end of a reference and the command after it, on real nodes with default parameters.

After each interruption the effort stays near the gravity torque of the measured position,
independent of the reference before the interruption and of messages sent during it.
"""

from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, figure_of, G, Q
from fault_stimuli import altered, overflow, RATE, Swing, wait_states
from fault_table import fault
from interruption_bench import (
    check_held,
    ELSEWHERE,
    follow,
    gravity,
    GROUP,
    HELD,
    LIMIT,
    move_by_hand,
    wait_rejected,
)
from lifecycle_bench import ACTIVATE, DEACTIVATE
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from rclpy.parameter import Parameter
from robot_dynamics.control.effort_limiter import LONGEST_STEP
from ros_harness import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

SWING = 43.0
"""Angular frequency of an arm that is too fast [rad/s]."""

# --- trajectories that are sent while no reference can be followed ------------------------------

@fault(GROUP, 'a trajectory and a set-point during a timeout of the joint states',
       f'rejected with the fault as the reason; after recovery {HELD}')
def test_an_outage(arm: FaultBench) -> None:
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
def test_a_position_limit(arm: FaultBench) -> None:
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
    arm.efforts.clear()
    check_held(arm, inside)
    arm.set_parameters(command='computed_torque')
    arm.efforts.clear()
    check_held(arm, inside)


@fault(GROUP, 'a trajectory and a set-point before `~/reset_fault` of a latched fault',
       f'rejected with the fault as the reason; before the reset and after it {HELD}')
def test_a_latched_fault(arm: FaultBench) -> None:
    arm.set_parameters(soften_gains=False)  # so that the measured velocity is used unchanged
    overflow(arm)
    arm.driver.go_on()
    wait_states(arm, 5)
    wait_rejected(arm, 'no reference can be followed now: fault non_finite')
    arm.efforts.clear()
    arm.efforts.wait_for(lambda message: np.allclose(message.effort, G, atol=1e-6))
    arm.efforts.clear()
    check_held(arm, Q)
    response = arm.client.call(Trigger, arm.name('reset_fault'))
    assert response.success, response.message
    check_held(arm, Q, len(arm.efforts.messages) + 200)
    arm.wait_status('command', lambda status: status.level != DiagnosticStatus.ERROR)


# --- an arm that is moved by hand ----------------------------------------------------------------

def change_state(bench: FaultBench, transition: int) -> None:
    """Make a transition of the lifecycle."""
    response = bench.client.call(ChangeState, bench.name('change_state'), ChangeState.Request(
        transition=Transition(id=transition)))
    assert response.success


@fault(GROUP, 'deactivation; the arm is moved by hand; activation',
       f'a trajectory sent in between is rejected; after activation {HELD}')
def test_deactivation(arm: FaultBench) -> None:
    change_state(arm, DEACTIVATE)
    assert arm.next_status('reference').message == 'ended early: the node was deactivated'
    move_by_hand(arm, ELSEWHERE)
    wait_rejected(arm, 'no reference can be followed now: the node is not active')
    arm.efforts.clear()
    change_state(arm, ACTIVATE)
    assert arm.efforts.wait_for().effort == pytest.approx(gravity(ELSEWHERE), abs=1e-6)
    check_held(arm, ELSEWHERE)


@pytest.mark.parametrize('command', [
    pytest.param(command, marks=fault(
        GROUP, f'`command: {command}`; the arm is moved by hand; `command: computed_torque`',
        f'a trajectory sent in between is rejected; afterwards {HELD}'))
    for command in ('gravity_compensation', 'none')])
def test_another_command(arm: FaultBench, command: str) -> None:
    arm.set_parameters(command=command)
    ended = f'ended early: command was set to {command!r}'
    assert arm.next_status('reference').message == ended
    if command == 'none':
        arm.wait_silent()
    move_by_hand(arm, ELSEWHERE)
    wait_rejected(arm, f"command is '{command}', expected 'computed_torque'")
    if command != 'none':
        arm.efforts.clear()
        arm.efforts.wait_for(
            lambda message: np.allclose(message.effort, gravity(ELSEWHERE), atol=1e-6))
    arm.efforts.clear()
    arm.set_parameters(command='computed_torque')
    check_held(arm, ELSEWHERE)
    assert arm.next_status('reference').message == ended  # until the next reference
    follow(arm, ELSEWHERE)


@fault(GROUP, '`require_measured_velocities`: velocities are missing; the arm is moved by hand; '
       'velocities return',
       f'a trajectory sent in between is rejected; afterwards {HELD}')
def test_velocities_that_are_absent(arm: FaultBench) -> None:
    arm.set_parameters(require_measured_velocities=True)
    arm.driver.change = altered(velocity=[])
    arm.wait_status('reference', lambda status: (
        status.message == 'ended early: the joint states have no velocity'))
    move_by_hand(arm, ELSEWHERE, has_velocity=False)
    wait_rejected(arm, 'no joint state with velocities has been received')
    arm.efforts.clear()
    arm.efforts.wait_for(
        lambda message: np.allclose(message.effort, gravity(ELSEWHERE), atol=1e-6))
    arm.efforts.clear()
    arm.driver.go_on()
    with arm.client.collect(JointState, arm.name('reference')) as references:
        reference = references.wait_for()  # velocities are present again: the position is held
    assert reference.position == pytest.approx(ELSEWHERE, abs=1e-9)
    check_held(arm, ELSEWHERE)
    arm.set_parameters(require_measured_velocities=False)


# --- faults --------------------------------------------------------------------------------------

@fault(GROUP, '`~/reset_fault` while the cause of a fault persists',
       '`success` false; the message names the fault and its cause')
def test_a_reset_while_the_cause_persists(arm: FaultBench) -> None:
    def refusal() -> str:
        response = arm.client.call(Trigger, arm.name('reset_fault'))
        assert not response.success
        return str(response.message)

    assert refusal() == 'there is no fault'
    arm.driver.be_quiet()
    arm.wait_state_timeout()
    message = refusal()
    assert message.startswith('state_timeout persists: no valid joint state for 0.3 s')
    assert message.endswith('it ends automatically after 1 valid joint states')
    arm.driver.go_on()
    arm.wait_running()

    arm.set_parameters(command='gravity_compensation')
    move_by_hand(arm, [Q[0], -LIMIT - 0.05])
    arm.wait_fault('position_limit')
    message = refusal()
    assert message.startswith("position_limit persists: position of 'joint2' is -2.5")
    assert message.endswith('it ends automatically after 5 valid joint states')
    move_by_hand(arm, Q)
    arm.wait_running()

    arm.set_parameters(command='computed_torque', soften_gains=False)
    follow(arm, Q)
    overflow(arm)
    assert refusal().startswith('non_finite persists: the efforts at position [0.785')
    arm.driver.go_on()
    wait_states(arm, 20)
    response = arm.client.call(Trigger, arm.name('reset_fault'))
    assert response.success
    assert response.message.startswith('reset non_finite: ')


@pytest.mark.parametrize('v', [
    pytest.param(v, marks=fault(
        GROUP, f'joint velocities of {words} while a reference is followed',
        'fault `overspeed` that names joint and velocity; g(q) with damping, finite and within '
        'the limits; ends automatically'))
    for words, v in (('13 rad/s, 1.3 times the limit', [13.0, 0.0]),
                     ('-20 and 20 rad/s', [-20.0, 20.0]))])
def test_overspeed(arm: FaultBench, v: list[float]) -> None:
    before = arm.known('command', 'faults: overspeed')
    arm.efforts.clear()
    arm.driver.change = Swing(Q, np.divide(v, SWING).tolist(), SWING)
    status = arm.wait_fault('overspeed')
    assert "velocity of 'joint" in status.message
    assert 'expected at most 1.2 times' in status.message
    assert '(overspeed_factor)' in status.message
    assert figure_of(status, 'faults: overspeed') == before + 1
    # damping against the motion of joint1, and never zero
    arm.efforts.wait_for(lambda message: abs(message.effort[0] - G[0]) > 50.0)
    arm.wait_status('reference', lambda status: (
        status.message.startswith('ended early: fault overspeed: ')))
    arm.driver.go_on()
    arm.wait_running()
    wait_until(
        lambda: np.allclose(arm.efforts.messages[-1].effort, G, atol=1e-6), 'the gravity torque')
    arm.check_efforts()
    assert all((np.abs(m.effort) <= [150.0, 60.0]).all() for m in arm.efforts.messages)


@fault(GROUP, 'an arm that does not follow its reference',
       'fault `following_error` that names joint and distance; the arm is held at its '
       'measured position; the reference has ended')
def test_a_following_error(arm: FaultBench) -> None:
    before = arm.known('command', 'faults: following_error')
    arm.set_parameters(following_error_limit=[0.05])
    arm.efforts.clear()
    arm.set_point([Q[0] + 0.2, Q[1]])  # the driver reports that the arm stays
    arm.wait_status('command', lambda status: (
        figure_of(status, 'faults: following_error') == before + 1))
    status = arm.wait_status(
        'reference', lambda status: status.message.startswith('ended early: '))
    assert status.message.startswith(
        "ended early: fault following_error: position of 'joint1' is 0.")
    assert 'from its reference, expected at most 0.05 (following_error_limit)' in status.message
    arm.wait_running()
    wait_until(
        lambda: np.allclose(arm.efforts.messages[-1].effort, G, atol=1e-6), 'the gravity torque')
    assert (arm.efforts.steps() <= RATE * LONGEST_STEP + 1e-6).all()
    arm.efforts.clear()
    check_held(arm, Q)
    assert arm.figure('command', 'faults: following_error') == before + 1
    unset = Parameter('following_error_limit', Parameter.Type.DOUBLE_ARRAY, [])
    arm.set_parameters(following_error_limit=unset)


@fault(GROUP, 'velocities of ±1.7·10³⁰⁸ rad/s without a reference',
       'reported; commands are finite and within the limits')
def test_velocities_beyond_numbers(arm: FaultBench) -> None:
    arm.set_parameters(command='gravity_compensation')
    arm.efforts.clear()
    arm.driver.v = [1.7e308, -1.7e308]
    arm.wait_status('joint states', lambda status: (
        'not finite' in status.message or 'velocity of' in status.message))
    arm.efforts.wait_count(len(arm.efforts.messages) + 20)
    arm.check_efforts()
    assert all((np.abs(m.effort) <= [150.0, 60.0]).all() for m in arm.efforts.messages)
    arm.driver.v = [0.0, 0.0]
    arm.check_alive()
