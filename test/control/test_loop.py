# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control loop with its default parameters and a simulated arm, in lock-step.

The arms have no friction, which would hide drift and damp oscillations.
"""

from collections.abc import Callable
from functools import cache

from lock_step_loop import (
    directions,
    FIRST_STAMP,
    frozen,
    LockStep,
    middle,
    MS,
    Sensor,
    smooth_arm,
    Trace,
)
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.control.safety.supervisor import BRAKING_TIME, Fault, Mode, SafetyOptions
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

Q = np.array([0.8, 0.5])
AT_REST = 1e-3
"""[rad/s]"""


@cache
def arm_named(name: str) -> ArmModel:
    return smooth_arm(name)


def place(name: str) -> FloatArray:
    return Q if name == 'default' else middle(arm_named(name))


def loaded(mass: float, name: str = 'default', link: str = 'tool0') -> ArmModel:
    return arm_named(name).with_payloads([make_payload(link, mass)])


def in_motion(name: str = 'default', way: float = 1.0, after: float = 0.5, **more: float) -> (
        LockStep):
    """Return an arm in a motion of all joints at about half of their velocity limits."""
    one = LockStep(arm_named(name), q=place(name), **more)  # type: ignore[arg-type]
    one.run(0.1)
    one.follow(one.q + way * directions(len(one.q)))
    assert one.run(after).speed[-1] > 0.5
    return one


def rests(trace: Trace) -> bool:
    return bool(trace.last(0.3).speed.max() < AT_REST)


def with_command(one: LockStep, command: str) -> None:
    """Set `command` as the node does, with unchanged other options."""
    options, supervisor = one.loop.controller.options, one.loop.supervisor
    one.loop.set_options(
        ControllerOptions(**{**vars(options), 'command': command}),
        supervisor.limiter.limits, supervisor.options)


# --- the start -----------------------------------------------------------------------------------

@pytest.mark.parametrize('name', ['default', 'ur10', 'panda'])
@pytest.mark.parametrize('rate', [500.0, 100.0])
def test_the_arm_is_held_from_the_first_state(name: str, rate: float) -> None:
    one = LockStep(arm_named(name), q=place(name), rate=rate, delay=4)
    trace = one.run(2.0)
    assert np.abs(trace.q - place(name)).max() < 1e-6
    assert one.loop.reference.position == pytest.approx(place(name))
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize(('rate', 'largest'), [(500.0, 0.1), (125.0, 0.1), (50.0, 0.3)])
@pytest.mark.parametrize('delay', [0, 8])
def test_an_unknown_load_moves_the_arm_by_no_more_than_the_sag(
    rate: float, largest: float, delay: int,
) -> None:
    """Slow states have lower gains, and half of them until the quality of the states is known."""
    one = LockStep(arm_named('default'), true_arm=loaded(0.5), q=Q, rate=rate, delay=delay)
    trace = one.run(4.0)
    assert np.abs(trace.q - Q).max() < largest
    assert np.abs(one.q - Q).max() < 0.1
    assert rests(trace)
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize('delay', [0, 8])
@pytest.mark.parametrize(('load', 'largest'), [(3.0, 0.2), (4.0, 0.25)])
def test_the_sag_under_a_heavy_unknown_load_is_that_of_the_gains(
    load: float, largest: float, delay: int,
) -> None:
    """No softening by the size of the error: plain PD feedback sags by 0.16 and 0.21 rad."""
    one = LockStep(arm_named('default'), true_arm=loaded(load), q=Q, rate=125.0, delay=delay)
    trace = one.run(6.0)
    print(f'sag {np.abs(trace.q[-1] - Q).max():.3f}, at most {np.abs(trace.q - Q).max():.3f}')
    assert np.abs(trace.q[-1] - Q).max() <= largest
    # The load falls until the feedback has caught it; an unlimited effort leaves 0.26 rad of 4 kg.
    assert np.abs(trace.q - Q).max() <= 1.2 * largest
    assert rests(trace)
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize('speed', [0.6, 1.0, 1.5, 2.0])
@pytest.mark.parametrize('delay', [0, 4, 8])
def test_a_hit_starts_no_oscillation(delay: int, speed: float) -> None:
    """The first joint of a stretched UR5 is heavy: the rate limit delays its effort."""
    one = LockStep(arm_named('ur5'), q=np.zeros(6), rate=500.0, delay=delay)
    one.run(1.0)
    one.v = one.v + np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    trace = one.run(2.5)
    assert rests(trace)
    assert np.abs(one.q).max() < 1e-3
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize('name', ['default', 'ur10', 'panda'])
@pytest.mark.parametrize('rate', [500.0, 100.0])
@pytest.mark.parametrize('speed', [0.3, -0.6])
def test_an_arm_that_moves_at_the_start_is_stopped(name: str, rate: float, speed: float) -> None:
    v = speed * directions(len(place(name)))
    one = LockStep(arm_named(name), q=place(name), v=v, rate=rate, delay=4)
    trace = one.run(3.0)
    assert trace.speed.max() < 1.25 * abs(speed)
    assert np.abs(trace.q - place(name)).max() < 0.4 * abs(speed)
    assert rests(trace)
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize('command', ['gravity_compensation', 'none'])
def test_other_commands_do_not_hold(command: str) -> None:
    one = LockStep(arm_named('default'), q=Q, command=command)
    trace = one.run(0.2)
    assert one.loop.reference is None
    assert np.isnan(trace.effort).all() == (command == 'none')


# --- the end -------------------------------------------------------------------------------------

ENDS: dict[str, Callable[[LockStep], None]] = {
    'deactivate': lambda one: one.loop.deactivate(one.now),
    'command: none': lambda one: with_command(one, 'none'),
}
ends = pytest.mark.parametrize('end', ENDS)


@ends
@pytest.mark.parametrize('name', ['default', 'ur10', 'panda'])
@pytest.mark.parametrize('rate', [500.0, 100.0])
def test_a_moving_arm_stops_before_the_effort_is_ramped_to_zero(
    end: str, name: str, rate: float,
) -> None:
    one = in_motion(name, rate=rate, delay=4)
    most = np.abs(one.v).max()
    ENDS[end](one)
    assert one.loop.supervisor.mode is Mode.BRAKING
    trace = one.run(5.0)
    ramp = trace.mode.index(Mode.STOPPING)
    assert ramp < 1000 * BRAKING_TIME
    assert trace.speed[:ramp].max() < 1.1 * most
    assert trace.speed[ramp] < 0.05
    assert one.loop.supervisor.mode is Mode.INACTIVE
    assert np.isnan(trace.effort[-100:]).all()
    efforts = trace.effort[~np.isnan(trace.effort).any(axis=1)]
    assert efforts[-1].tolist() == [0.0] * len(one.q)
    assert one.loop.supervisor.fault is None
    assert (one.loop.controller.options.command == 'none') == (end == 'command: none')


@ends
def test_an_arm_at_rest_need_not_stop_for_long(end: str) -> None:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.5)
    ENDS[end](one)
    assert one.run(3.0).mode.index(Mode.STOPPING) < 250


@ends
def test_a_stop_that_does_not_succeed_ends_with_the_ramp(end: str) -> None:
    """The environment shakes the arm, which never rests."""
    one = in_motion()
    one.push = lambda t: 60.0 * np.sin(np.array([9.0, 12.0]) * t)
    ENDS[end](one)
    trace = one.run(BRAKING_TIME + 1.5)
    ramp = trace.mode.index(Mode.STOPPING)
    assert 1e-3 * ramp == pytest.approx(BRAKING_TIME, abs=0.06)
    assert set(trace.mode[:ramp]) == {Mode.BRAKING}
    assert one.loop.supervisor.mode is Mode.INACTIVE


def test_an_arm_that_swings_is_not_at_rest_when_it_returns() -> None:
    """It is where it was 100 ms before, at each comparison."""
    loop, q = ControlLoop.of_arm(arm_named('default')), Q.copy()
    for k in range(1000):
        phase = 2.0 * np.pi * k / 50
        v = 0.01 * 2.0 * np.pi / 0.1 * np.cos(phase) * np.ones(2)
        loop.answer(FIRST_STAMP + 2 * k * MS, q + 0.01 * np.sin(phase), v)
        if k == 250:
            loop.deactivate(1e-9 * (FIRST_STAMP + 2 * k * MS))
        assert k < 250 or loop.supervisor.mode is Mode.BRAKING


def test_an_arm_that_begins_to_move_is_not_at_rest() -> None:
    """It has moved little in 100 ms, and is as fast as at the end of a fall of 30 ms."""
    loop, q, v = ControlLoop.of_arm(arm_named('default')), Q.copy(), np.zeros(2)
    for k in range(100):
        if k == 5:
            loop.deactivate(1e-9 * (FIRST_STAMP + 2 * k * MS))
        if k > 40:
            v = np.full(2, 2.0 * 0.002 * (k - 40))
        loop.answer(FIRST_STAMP + 2 * k * MS, q + 0.25 * v**2, v)
        assert k < 5 or loop.supervisor.mode is Mode.BRAKING


@ends
def test_without_states_the_ramp_begins_at_once(end: str) -> None:
    one = in_motion()
    one.sensor = None
    ENDS[end](one)
    trace = one.run(2.0)
    assert trace.mode.index(Mode.STOPPING) < 100
    assert one.loop.supervisor.mode is Mode.INACTIVE


def test_during_the_stop_no_reference_is_accepted_and_nothing_else_stops() -> None:
    one = in_motion()
    one.loop.deactivate(one.now)
    one.run(0.1)
    for command in ('node is not active', 'command ends'):
        with pytest.raises(TrajectoryError, match=command):
            one.follow(Q)
        assert 'nothing to stop' in one.loop.stop()
        one.loop.is_active = True  # as for `command: none`
    assert one.loop.supervisor.mode is Mode.BRAKING
    assert one.loop.interruption == 'the node was deactivated'


@pytest.mark.parametrize('after', [0.05, 0.4])
def test_the_end_of_the_command_can_be_cancelled_during_the_stop(after: float) -> None:
    one = in_motion()
    with_command(one, 'none')
    one.run(after)
    assert one.loop.supervisor.mode is Mode.BRAKING
    with_command(one, 'computed_torque')
    assert one.loop.supervisor.mode is Mode.RUNNING
    trace = one.run(3.0)
    assert set(trace.mode) == {Mode.RUNNING}
    assert rests(trace)
    assert not np.isnan(trace.effort[::2]).any()
    one.follow(Q)
    assert one.run(4.0).q[-1] == pytest.approx(Q, abs=1e-4)


def test_after_the_end_the_command_begins_again_with_a_hold() -> None:
    one = in_motion()
    with_command(one, 'none')
    one.run(4.0)
    one.v = np.zeros(2)  # brakes
    one.q = Q.copy()
    one._effort = None
    with_command(one, 'computed_torque')
    trace = one.run(1.0)
    assert one.loop.supervisor.mode is Mode.RUNNING
    assert np.abs(trace.q - Q).max() < 1e-3


@pytest.mark.parametrize('name', ['default', 'ur10'])
def test_a_fault_during_the_stop_damps_the_arm_until_it_rests(name: str) -> None:
    one = in_motion(name)
    one.loop.deactivate(one.now)
    one.run(0.02)
    one.loop.fail(one.now, Fault('external_effort', 'words', recovery=25))
    trace = one.run(4.5)
    ramp = trace.mode.index(Mode.STOPPING)
    assert trace.speed[ramp] < 0.05
    assert one.loop.supervisor.mode is Mode.INACTIVE


# --- faults --------------------------------------------------------------------------------------

@pytest.mark.parametrize('name', ['default', 'ur10', 'panda'])
@pytest.mark.parametrize('cause', ['fault', 'pause of the states'])
def test_after_a_fault_the_arm_stops_and_is_held(name: str, cause: str) -> None:
    one = in_motion(name)
    goal = one.q + 0.2
    if cause == 'fault':
        one.loop.fail(one.now, Fault('external_effort', 'words', recovery=25))
        with pytest.raises(TrajectoryError, match='fault external_effort: words'):
            one.follow(goal)
        assert one.loop.reference is None
        assert 'fault external_effort' in one.loop.interruption
    else:
        sensor, one.sensor = one.sensor, None
        one.run(0.12)
        one.sensor = sensor
    trace = one.run(4.0)
    assert one.loop.supervisor.fault_count == 1 or cause != 'fault'
    # Without states nothing brakes an arm in motion; near its limits, the Panda has been 1.6 times
    # as fast as permitted afterwards.
    assert (np.abs(trace.v) <= (1.2 if cause == 'fault' else 1.8) * one.arm.limits.velocity).all()
    assert rests(trace)
    reference = one.loop.reference
    assert reference.position == pytest.approx(one.q, abs=1e-3)
    one.follow(goal)
    assert one.run(4.0).q[-1] == pytest.approx(goal, abs=1e-3)
    assert one.loop.interruption == ''


def test_a_latched_fault_holds_the_arm_and_waits_for_a_reset() -> None:
    one = in_motion()
    one.loop.fail(one.now, Fault('broken', 'words', latched=True))
    trace = one.run(2.0)
    assert one.loop.supervisor.mode is Mode.FAULT
    assert trace.speed[-1] < 0.1  # damped, without a position
    assert one.loop.reset() == (True, 'reset broken: words')
    assert rests(one.run(2.0))
    assert one.loop.reference is not None


def next_loop(before: ControlLoop, arm: ArmModel) -> ControlLoop:
    limits, old = arm.limits, before.supervisor
    return ControlLoop(
        Controller(arm, before.controller.options if (
            arm.joint_names == before.controller.arm.joint_names) else ControllerOptions(
                ControlLoop.of_arm(arm).controller.options.gains)),
        EffortLimits(
            limits.lower, limits.upper, limits.velocity, 0.01,
            old.limiter.limits.rate if arm.joint_names == before.controller.arm.joint_names
            else 1000.0),
        old.options, before=before)


@pytest.mark.parametrize('is_same', [True, False])
def test_a_latched_fault_continues_in_the_loop_of_the_next_model(is_same: bool) -> None:
    one = in_motion()
    one.loop.fail(one.now, Fault('broken', 'words', latched=True))
    one.run(0.1)
    other = load_arm(planar_arm_urdf([3.0], [1.0], [0.5], [0.1]))
    loop = next_loop(one.loop, loaded(1.0) if is_same else other)
    assert loop.is_active
    assert loop.supervisor.mode is Mode.FAULT
    assert loop.supervisor.is_latched
    q = one.q if is_same else np.array([0.3])
    answer = loop.answer(FIRST_STAMP + (one.k + 1) * MS, q, 0.0 * q)
    assert (answer.effort is None) == (not is_same)  # other joints have had no effort
    assert 'broken' in loop.obstacle
    assert loop.reset()[0]
    loop.answer(FIRST_STAMP + (one.k + 3) * MS, q, 0.0 * q)
    assert loop.supervisor.mode is Mode.RUNNING


def test_the_next_model_of_the_same_joints_continues_without_a_step() -> None:
    one = in_motion()
    before = one.run(0.01).effort
    last = before[~np.isnan(before).any(axis=1)][-1]
    loop = one.loop = next_loop(one.loop, loaded(1.0))
    answer = loop.answer(FIRST_STAMP + one.k * MS, one.q, one.v)
    assert np.abs(answer.effort - last).max() <= 1500.0 * 0.002 + 1e-9
    one.k += 2
    assert rests(one.run(4.0))  # from the measured state


# --- measured velocities -------------------------------------------------------------------------

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


wrong_arms = pytest.mark.parametrize('name', ['default', 'ur5', 'ur10', 'panda'])
wrong_rates = pytest.mark.parametrize('rate', [500.0, 100.0])
joints = pytest.mark.parametrize(('name', 'j'), [
    ('default', 0), ('default', 1), *(
        pytest.param(name, j, marks=() if j in (0, 1, 3) else pytest.mark.soak)
        for name in ('ur5', 'ur10', 'panda') for j in range(6))])


@wrong_arms
@wrong_rates
@pytest.mark.parametrize('sensor', [zeros, in_degrees], ids=['zeros', 'degrees'])
def test_velocities_that_are_wrong_at_all_joints_stop_the_arm(
    name: str, rate: float, sensor: Sensor,
) -> None:
    one = in_motion(name, rate=rate, delay=4)
    one.sensor = sensor
    trace = one.run(4.0)
    judge(one, trace)
    assert one.loop.notice
    assert one.loop.interruption


@wrong_rates
@joints
def test_a_velocity_with_the_wrong_sign_stops_the_arm(name: str, rate: float, j: int) -> None:
    one = in_motion(name, rate=rate, delay=4)
    one.sensor = sign(j)
    judge(one, one.run(4.0))
    assert one.loop.supervisor.fault is None or one.loop.supervisor.fault.name == 'overspeed'


@pytest.mark.parametrize('rate', [500.0, 250.0])
@pytest.mark.parametrize('j', [3, 5])
def test_light_joints_whose_velocity_jumps_by_its_unit_are_not_accelerated(
    rate: float, j: int,
) -> None:
    """The first wrong velocity is found before it is answered."""
    one = LockStep(arm_named('kinova'), q=place('kinova'), rate=rate, delay=8)
    one.run(0.1)
    one.follow(one.q + directions(len(one.q)))
    assert one.run(1.0).speed[-1] > 0.3
    one.sensor = lambda q, v: (q, np.where(np.arange(len(v)) == j, np.degrees(v), v))
    judge(one, one.run(4.0))
    assert 'degrees instead of radians' in one.loop.notice


@wrong_rates
@joints
def test_a_joint_whose_sample_is_frozen_is_a_fault(name: str, rate: float, j: int) -> None:
    """It ends when the joint is measured again, and the arm is held."""
    one = in_motion(name, rate=rate, delay=4)
    alive, one.sensor = one.sensor, frozen(j)
    trace = one.run(1.0)
    ratio = float((np.abs(trace.v) / one.arm.limits.velocity).max())
    print(f'peak {ratio:.2f} of the limit, drift {trace.last(0.3).speed.max():.2g} rad/s')
    assert ratio <= 1.2
    assert one.loop.supervisor.fault.name == 'frozen_joint'
    assert one.loop.supervisor.mode is Mode.FAULT
    one.sensor = alive
    judge(one, one.run(3.0))
    assert one.loop.supervisor.mode is Mode.RUNNING


@wrong_rates
def test_what_holds_the_other_joints_does_not_accelerate_a_frozen_joint(rate: float) -> None:
    """The feedback of a joint that sticks asks for accelerations that do not happen."""
    one = LockStep(arm_named('default'), q=Q, rate=rate)
    one.push = lambda t: np.array([-20.0, 0.0]) * np.clip(one.v[0] / 0.01, -1.0, 1.0)
    one.run(0.1)
    one.follow(Q + 0.6 * directions(2))
    one.run(0.2)
    one.sensor = frozen(1)
    trace = one.run(0.8)
    assert one.loop.supervisor.fault is not None
    assert one.loop.supervisor.fault.name == 'frozen_joint'
    print(f'at most {trace.speed.max():.2g} rad/s')
    assert (np.abs(trace.v) <= 1.2 * one.arm.limits.velocity).all()


def test_one_noisy_velocity_above_the_limit_is_no_fault_and_motion_above_it_is() -> None:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    fast, supervisor = 1.5 * one.arm.limits.velocity, one.loop.supervisor
    for k in range(5):
        one.loop.answer(FIRST_STAMP + (one.k + 2 * k) * MS, one.q + 0.002 * k * fast, fast)
        assert k or supervisor.fault is None
    assert supervisor.fault is not None
    assert supervisor.fault.name == 'overspeed'


def test_a_joint_that_is_frozen_at_rest_stays_a_fault() -> None:
    """Its fault ends when the sample changes, not when its reference ends."""
    one = LockStep(arm_named('default'), q=Q)
    one.sensor = frozen(1)
    one.run(0.3)
    one.follow(Q + 0.5 * directions(2))
    trace = one.run(2.5)
    supervisor = one.loop.supervisor
    assert supervisor.fault is not None
    assert supervisor.fault.name == 'frozen_joint'
    assert supervisor.mode is Mode.FAULT
    assert supervisor.fault_count == 1
    assert supervisor.limiter.last is None  # the fault action has ended: brakes hold the arm
    assert all(mode is Mode.FAULT for mode in trace.mode[trace.mode.index(Mode.FAULT):])


@pytest.mark.parametrize('delay', [0, 4, 8])
@pytest.mark.parametrize('factor', [0.0, -1.0])
def test_an_arm_that_a_wrong_velocity_has_driven_away_stops_where_it_is(
    factor: float, delay: int,
) -> None:
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


@wrong_rates
def test_velocities_that_are_always_zero_from_the_start_do_no_harm(rate: float) -> None:
    """The positions are those of an encoder, and repeat at rest."""
    one = LockStep(arm_named('default'), true_arm=loaded(2.0), q=Q, rate=rate, delay=4)
    one.sensor = lambda q, v: (1e-4 * np.round(q / 1e-4), 0.0 * v)
    trace = one.run(6.0)
    print(f'at the end {trace.last(1.0).speed.max():.3g} rad/s, {one.q - Q} rad away')
    assert np.abs(trace.q - Q).max() < 0.35
    assert trace.last(1.0).speed.max() < 0.05


def test_true_velocities_are_not_doubted_during_motions_and_stops() -> None:
    for name in ('default', 'ur10', 'panda'):
        one = in_motion(name, rate=250.0, delay=4)
        one.loop.stop()
        assert one.loop.interruption == '~/stop was called'
        assert rests(one.run(3.0))
        assert one.loop.consistency.reason == ''
        assert one.loop.notice == ''
        assert one.loop.supervisor.fault is None


# --- streams, stops and states -------------------------------------------------------------------

def test_a_stream_that_pauses_ends_with_a_stop() -> None:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    for k in range(1, 30):
        one.loop.follow(make_trajectory(
            one.arm.joint_names, [0.0], [(Q + 0.4 * 0.02 * k).tolist()], [[0.4, 0.4]], (),
            one.arm.joint_names))
        last = one.run(0.02)
    assert last.speed[-1] > 0.3
    assert one.loop.paused_streams == 0
    trace = one.run(2.0)
    assert one.loop.paused_streams == 1
    assert 'paused' in one.loop.interruption
    assert 'paused' in one.loop.notice
    assert rests(trace)
    assert trace.speed.max() < 1.1 * last.speed[-1]


def test_a_stop_in_a_fault_is_a_hold_after_it() -> None:
    one = in_motion()
    one.loop.fail(one.now, Fault('external_effort', 'words', recovery=25))
    assert one.loop.stop() == (
        'the arm will stop and hold its position after the fault external_effort: words')
    assert rests(one.run(3.0))


def test_states_that_restart_end_the_reference_and_the_arm_is_held() -> None:
    """A simulator, for example, places the arm somewhere else."""
    one = in_motion()
    one.q = one.q + 0.7
    trace = one.run(3.0)
    assert one.loop.restarts == {'jump': 1}
    assert one.loop.interruption == 'joint states restarted: jump'
    assert rests(trace)
    assert np.abs(trace.q - trace.q[0]).max() < 0.5


@pytest.mark.parametrize('shift', [-20_000, 20_000])
def test_stamps_that_jump_restart_the_states_too(shift: int) -> None:
    one = in_motion()
    for _ in range(1000):
        stamp = FIRST_STAMP + (one.k + shift) * MS
        effort = one.loop.answer(stamp, one.q, one.v, stamp, FIRST_STAMP + one.k * MS).effort
        assert effort is not None
        for _ in range(2):
            one._move(effort)
            one.k += 1
    assert one.loop.restarts.total() <= 1
    assert np.abs(one.v).max() < AT_REST


def test_a_repeated_state_gets_the_last_effort_again() -> None:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    stamp = FIRST_STAMP + one.k * MS
    first = one.loop.answer(stamp, Q, 0.0 * Q)
    again = one.loop.answer(stamp, Q, 0.0 * Q)
    assert again.effort is first.effort
    assert not again.verdict.is_new


def test_two_publishers_that_contradict_each_other_are_a_fault() -> None:
    """Their states are dropped, and the arm is held."""
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    for _ in range(20):
        with pytest.raises(ImplausibleStateError):
            one.loop.answer(
                FIRST_STAMP + one.k * MS + 1, Q + 2.0, 0.0 * Q,
                has_several_publishers=lambda: True)
        one.run(0.004)
    supervisor = one.loop.supervisor
    assert supervisor.mode is Mode.FAULT
    assert supervisor.fault.name == 'several_publishers'
    assert supervisor.fault_count == 1
    assert np.abs(one.q - Q).max() < 1e-6
    one.run(0.5)
    assert supervisor.mode is Mode.RUNNING


class Fragile(ControlLaw):
    """Gravity compensation that fails if `is_broken`."""

    is_broken = False

    def effort(self, state: LawInput) -> FloatArray:
        return state.gravity * (np.nan if self.is_broken else 1.0)


def test_a_state_without_a_finite_effort_is_a_latched_fault() -> None:
    law = Fragile()
    one = LockStep(arm_named('default'), law, q=Q)
    one.run(0.1)
    law.is_broken = True
    with pytest.raises(NonFiniteEffortError):
        one.run(0.01)
    supervisor = one.loop.supervisor
    assert supervisor.is_latched
    assert supervisor.fault.name == 'non_finite'
    law.is_broken = False
    one.run(0.2)
    assert supervisor.mode is Mode.FAULT
    assert one.loop.reset()[0]
    one.run(0.1)
    assert supervisor.mode is Mode.RUNNING


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('v', [1e3, 1e6])
def test_absurd_velocities_are_not_used(v: float) -> None:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    sensor, one.sensor = one.sensor, lambda q, _: (q, np.array([v, -v]))
    one.run(0.5)
    one.sensor = sensor
    trace = one.run(1.0)
    assert np.abs(trace.q - Q).max() < 0.1
    assert rests(trace)


@pytest.mark.parametrize('max_age', [0.0, 0.3])
def test_the_age_of_a_state_has_a_limit(max_age: float) -> None:
    one = LockStep(arm_named('default'), q=Q)
    one.loop.set_monitor_age(max_age)
    one.run(0.1)
    with pytest.raises(InvalidInputError, match='expected at least 0'):
        one.loop.set_monitor_age(-0.1)
    stamp = FIRST_STAMP + one.k * MS
    if max_age:
        with pytest.raises(ImplausibleStateError, match='old'):
            one.loop.answer(stamp, Q, 0.0 * Q, stamp + 400 * MS)
    else:
        assert one.loop.answer(stamp, Q, 0.0 * Q, stamp + 400 * MS).effort is not None


def test_an_inactive_loop_answers_without_an_effort() -> None:
    loop = ControlLoop.of_arm(arm_named('default'))
    inactive = ControlLoop(
        loop.controller, loop.supervisor.limiter.limits, SafetyOptions())
    answer = inactive.answer(FIRST_STAMP, Q, 0.0 * Q)
    assert answer.effort is None
    assert answer.output.command is not None  # what would be commanded
    with pytest.raises(TrajectoryError, match='the node is not active'):
        inactive.follow(make_trajectory(
            loop.controller.arm.joint_names, [0.0], [Q], (), (), loop.controller.arm.joint_names))
