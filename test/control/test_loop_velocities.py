# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control loop with wrong velocities, which are not used, and frozen joints, in lock-step."""

from bristled_arm import BristledArm, Case
from lock_step_loop import directions, FIRST_STAMP, frozen, LockStep, MS, Sensor, smooth_arm, Trace
from loop_motions import arm_named, in_motion, place, Q, rests
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.model.arm import load_arm
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.planar.urdf import default_arm_urdf


def sign(j: int) -> Sensor:
    return lambda q, v: (q, np.where(np.arange(len(v)) == j, -v, v))


def judge(one: LockStep, trace: Trace, goal: FloatArray) -> None:
    """Check that the motion has reached its goal as with true velocities."""
    ratio = float((np.abs(trace.v) / one.arm.limits.velocity).max())
    print(f'peak {ratio:.2f} of the velocity limit, {np.abs(one.q - goal).max():.2g} rad away')
    assert ratio <= 1.2
    assert rests(trace)
    assert one.q == pytest.approx(goal, abs=1e-3)
    assert one.loop.supervisor.fault is None
    assert one.loop.goals.interruption == ''
    assert one.dropped == 0


joints = [
    ('default', 0, 100.0), ('ur10', 1, 500.0), ('panda', 3, 100.0), *(
        pytest.param(name, j, rate, marks=pytest.mark.soak)
        for name in ('ur5', 'ur10', 'panda') for j in range(6) for rate in (500.0, 100.0))]


@pytest.mark.parametrize(('name', 'rate', 'wrong'), [
    ('default', 500.0, np.zeros_like), ('default', 100.0, np.degrees),
    ('ur10', 100.0, np.zeros_like), ('panda', 500.0, np.degrees),
    ('panda', 500.0, lambda v: 0.0 * v + 0.5), ('default', 100.0, lambda v: 0.0 * v + 0.5)])
def test_a_motion_with_wrong_velocities_at_all_joints_reaches_its_goal(name, rate, wrong):
    one = in_motion(name, rate=rate, delay=4)
    one.sensor = lambda q, v: (q, wrong(v))
    judge(one, one.run(3.5), place(name) + directions(len(one.q)))
    assert one.loop.gate.doubtful.all()


@pytest.mark.parametrize(('name', 'j', 'rate'), joints)
def test_a_motion_with_a_velocity_of_the_wrong_sign_reaches_its_goal(name, j, rate):
    one = in_motion(name, rate=rate, delay=4)
    one.sensor = sign(j)
    judge(one, one.run(3.5), place(name) + directions(len(one.q)))
    assert np.flatnonzero(one.loop.gate.doubtful).tolist() == [j]


@pytest.mark.parametrize(('factor', 'delay'), [(0.0, 8), (-1.0, 0)])
def test_a_velocity_that_is_wrong_from_the_first_motion_on_does_not_drive_the_arm_away(
        factor, delay):
    one = LockStep(arm_named('default'), q=np.zeros(2), delay=delay)
    one.run(0.1)
    goal = 0.05 * directions(2)
    one.follow(goal)
    one.sensor = lambda q, v: (q, factor * v)
    trace = one.run(3.0)
    assert trace.speed.max() < 0.1 * one.arm.limits.velocity.min()
    judge(one, trace, goal)


@pytest.mark.parametrize(('name', 'j', 'rate'), joints)
def test_a_joint_whose_sample_is_frozen_is_a_fault(name, j, rate):
    """With friction of which the loop knows, and on all but the default arm unknown rotors."""
    one = BristledArm(
        smooth_arm(name), Case(name, int(rate), 4, 1e-3, 1.0, name != 'default'), q=place(name))
    one.run(0.1)
    one.follow(one.q + directions(len(one.q)))
    one.run(0.5)
    one.sensor = frozen(j)
    trace = one.run(1.0)
    ratio = float((np.abs(trace.v) / one.arm.limits.velocity).max())
    named_after = trace.mode.index(Mode.FAULT)
    print(f'peak {ratio:.2f} of the limit, named after {named_after} ms')
    assert ratio <= 3.0
    assert named_after <= 100
    assert one.loop.supervisor.fault.name == 'frozen_joint'
    assert set(trace.mode[named_after:]) == {Mode.FAULT}


@pytest.mark.parametrize('j', [0, 2])
@pytest.mark.parametrize('name', ['panda', 'xarm7'])
def test_a_joint_does_not_oscillate_beside_a_frozen_one_with_a_parallel_axis(name, j):
    """Without friction; damped with the inertia of both, it reached 4 to 29 times its limit."""
    one = LockStep(smooth_arm(name), rate=125.0, delay=8)
    if name == 'panda':
        one.q = np.array([0.0, -0.3, 0.0, -1.8, 0.0, 1.7, 0.0])
    one.run(0.3)
    one.follow(one.q + 0.2 * directions(7))
    one.run(0.5)
    one.sensor = frozen(j)
    ratio = float((np.abs(one.run(0.7).v) / one.arm.limits.velocity).max())
    assert one.loop.supervisor.fault.name == 'frozen_joint'
    assert ratio < 0.5


def test_a_state_that_repeats_as_a_whole_in_motion_is_no_state():
    """The reaction of the timeout follows within 50 ms; it ends when a position changes."""
    one = in_motion()
    alive, kept = one.sensor, (one.q, one.v)
    one.sensor = lambda q, v: kept
    trace = one.run(0.5)
    supervisor = one.loop.supervisor
    assert 48 <= trace.mode.index(Mode.FAULT) <= 72  # the watchdog looks every 20 ms
    assert supervisor.fault.name == 'state_timeout'
    assert trace.speed.max() < 2.0 * np.abs(kept[1]).max()
    one.sensor = alive
    trace = one.run(2.0)
    assert trace.mode.index(Mode.RUNNING) <= 60
    assert rests(trace)


def test_one_noisy_velocity_above_the_limit_is_no_fault_and_motion_above_it_is():
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    fast, supervisor = 1.5 * one.arm.limits.velocity, one.loop.supervisor
    for k in range(5):
        one.loop.answer(FIRST_STAMP + (one.k + 2 * k) * MS, one.q + 0.002 * k * fast, fast)
        assert k or supervisor.fault is None
    assert supervisor.fault.name == 'overspeed'


def test_a_joint_that_is_frozen_at_rest_stays_a_fault():
    """Its fault ends when the sample changes; with friction the arm is held until then."""
    one = BristledArm(smooth_arm('default'), Case('default', 500, 0, 1e-3), q=Q)
    one.sensor = frozen(1)
    one.run(0.3)
    one.follow(Q + 0.5 * directions(2))
    trace = one.run(2.0)
    supervisor = one.loop.supervisor
    assert supervisor.fault.name == 'frozen_joint'
    assert supervisor.fault_count == 1
    assert all(mode is Mode.FAULT for mode in trace.mode[trace.mode.index(Mode.FAULT):])
    assert not np.isnan(trace.effort[-10:]).all()
    assert trace.last(1.0).speed.max() < 0.1


def test_states_without_velocities_are_dropped_if_they_are_required():
    one = ControlLoop.of_arm(load_arm(default_arm_urdf()))
    limits, q = one.supervisor.limiter.limits, np.array([0.8, 0.5])
    one.set_options(one.controller.options, limits, SafetyOptions(requires_velocities=True))
    with pytest.raises(ImplausibleStateError, match='require_measured_velocities'):
        one.answer(FIRST_STAMP, q, None)
    assert one.answer(FIRST_STAMP + MS, q, 0.0 * q).effort is not None
