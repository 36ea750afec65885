# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control loop with wrong velocities and frozen joints, in lock-step."""

from lock_step_loop import directions, FIRST_STAMP, frozen, LockStep, MS, Sensor, Trace
from loop_motions import arm_named, in_motion, loaded, place, Q, rests
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.safety.supervisor import Mode


def sign(j: int) -> Sensor:
    def sensor(q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        v = v.copy()
        v[j] = -v[j]
        return q, v
    return sensor


def zeros(q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    return q, 0.0 * v


def in_degrees(q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    return q, np.degrees(v)


def judge(one: LockStep, trace: Trace) -> None:
    ratio = float((np.abs(trace.v) / one.arm.limits.velocity).max())
    supervisor = one.loop.supervisor
    print(f'peak {ratio:.2f} of the velocity limit, at the end {trace.speed[-1]:.2g} rad/s, '
          f'{supervisor.fault_count} faults, the last: {supervisor.fault}')
    assert ratio <= 1.2
    assert rests(trace)


joints = pytest.mark.parametrize(('name', 'j', 'rate'), [
    ('default', 0, 100.0), ('ur10', 1, 500.0), ('panda', 3, 100.0), *(
        pytest.param(name, j, rate, marks=pytest.mark.soak)
        for name in ('ur5', 'ur10', 'panda') for j in range(6) for rate in (500.0, 100.0))])


@pytest.mark.parametrize(('name', 'rate', 'sensor'), [
    ('default', 500.0, zeros), ('default', 100.0, in_degrees), ('ur10', 100.0, zeros),
    ('panda', 500.0, in_degrees)])
def test_velocities_that_are_wrong_at_all_joints_stop_the_arm(name, rate, sensor):
    one = in_motion(name, rate=rate, delay=4)
    one.sensor = sensor
    trace = one.run(3.0)
    judge(one, trace)
    assert one.loop.goals.notice
    assert one.loop.goals.interruption


@joints
def test_a_velocity_with_the_wrong_sign_stops_the_arm(name, j, rate):
    one = in_motion(name, rate=rate, delay=4)
    one.sensor = sign(j)
    judge(one, one.run(3.0))
    assert one.loop.supervisor.fault is None or one.loop.supervisor.fault.name == 'overspeed'


@pytest.mark.parametrize('j', [3, 5])
def test_light_joints_whose_velocity_jumps_by_its_unit_are_not_accelerated(j):
    """The first wrong velocity is found before it is answered."""
    one = LockStep(arm_named('kinova'), q=place('kinova'), rate=250.0, delay=8)
    one.run(0.1)
    one.follow(one.q + directions(len(one.q)))
    assert one.run(1.0).speed[-1] > 0.3
    one.sensor = lambda q, v: (q, np.where(np.arange(len(v)) == j, np.degrees(v), v))
    judge(one, one.run(4.0))
    assert 'degrees instead of radians' in one.loop.goals.notice


@joints
def test_a_joint_whose_sample_is_frozen_is_a_fault(name, j, rate):
    """It ends when the joint has been measured 25 times again, and the arm is held."""
    one = in_motion(name, rate=rate, delay=4)
    alive, one.sensor = one.sensor, frozen(j)
    trace = one.run(1.0)
    ratio = float((np.abs(trace.v) / one.arm.limits.velocity).max())
    print(f'peak {ratio:.2f} of the limit, drift {trace.last(0.3).speed.max():.2g} rad/s')
    assert ratio <= 1.2
    assert one.loop.supervisor.fault.name == 'frozen_joint'
    assert one.loop.supervisor.mode is Mode.FAULT
    one.sensor = alive
    trace = one.run(2.5)
    judge(one, trace)
    assert 23.0 <= 1e-3 * rate * trace.mode.index(Mode.RUNNING) <= 40.0


def test_one_noisy_velocity_above_the_limit_is_no_fault_and_motion_above_it_is():
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    fast, supervisor = 1.5 * one.arm.limits.velocity, one.loop.supervisor
    for k in range(5):
        one.loop.answer(FIRST_STAMP + (one.k + 2 * k) * MS, one.q + 0.002 * k * fast, fast)
        assert k or supervisor.fault is None
    assert supervisor.fault.name == 'overspeed'


def test_a_joint_that_is_frozen_at_rest_stays_a_fault():
    """Its fault ends when the sample changes, not when its reference ends."""
    one = LockStep(arm_named('default'), q=Q)
    one.sensor = frozen(1)
    one.run(0.3)
    one.follow(Q + 0.5 * directions(2))
    trace = one.run(2.5)
    supervisor = one.loop.supervisor
    assert supervisor.fault.name == 'frozen_joint'
    assert supervisor.mode is Mode.FAULT
    assert supervisor.fault_count == 1
    assert supervisor.limiter.last is None  # the fault action has ended: brakes hold the arm
    assert all(mode is Mode.FAULT for mode in trace.mode[trace.mode.index(Mode.FAULT):])


@pytest.mark.parametrize(('factor', 'delay'), [(0.0, 8), (-1.0, 0)])
def test_an_arm_that_a_wrong_velocity_has_driven_away_stops_where_it_is(factor, delay):
    """It is not pulled back to the reference, from which it is far away by then."""
    one = LockStep(arm_named('default'), q=np.zeros(2), delay=delay)
    one.run(0.1)
    one.follow(0.05 * directions(2))
    one.run(0.05)
    one.sensor = lambda q, v: (q, factor * v)
    trace = one.run(3.0)
    assert trace.speed.max() < 0.4 * one.arm.limits.velocity.min()
    assert rests(trace)
    assert one.loop.supervisor.fault is None


def test_velocities_that_are_always_zero_from_the_start_do_no_harm():
    """The positions are those of an encoder, and repeat at rest."""
    one = LockStep(arm_named('default'), true_arm=loaded(2.0), q=Q, rate=100.0, delay=4)
    one.sensor = lambda q, v: (1e-4 * np.round(q / 1e-4), 0.0 * v)
    trace = one.run(6.0)
    print(f'at the end {trace.last(1.0).speed.max():.3g} rad/s, {one.q - Q} rad away')
    assert np.abs(trace.q - Q).max() < 0.35
    assert trace.last(1.0).speed.max() < 0.05


def test_true_velocities_are_not_doubted_during_motions_and_stops():
    for name in ('default', 'panda'):
        one = in_motion(name, rate=250.0, delay=4)
        one.loop.stop()
        assert one.loop.goals.interruption == '~/stop was called'
        assert rests(one.run(2.0))
        assert one.loop.signals.consistency.reason == ''
        assert one.loop.goals.notice == ''
        assert one.loop.supervisor.fault is None
