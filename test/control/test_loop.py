# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control loop with its default parameters and a simulated arm, in lock-step.

The arms have no friction, which would hide drift and damp oscillations. A state that arrives
again, as from a simulation in lock-step that waits, changes nothing.
"""

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import directions, FIRST_STAMP, LockStep, MS, smooth_arm
from loop_motions import arm_named, in_motion, loaded, place, Q, rests
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point

# --- the start -----------------------------------------------------------------------------------

@pytest.mark.parametrize(('delay', 'speed'), [(0, 2.0), (8, 0.6), (8, 2.0)])
def test_a_hit_starts_no_oscillation(delay, speed):
    """The first joint of a stretched UR5 is heavy: the rate limit delays its effort."""
    one = LockStep(arm_named('ur5'), q=np.zeros(6), rate=500.0, delay=delay)
    one.run(0.5)
    one.v = one.v + np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    trace = one.run(2.5)
    assert rests(trace)
    assert np.abs(one.q).max() < 1e-3
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize(('name', 'rate', 'speed'), [
    ('default', 500.0, 0.3), ('ur10', 100.0, -0.6), ('panda', 100.0, 0.3)])
def test_an_arm_that_moves_at_the_start_is_stopped(name, rate, speed):
    v = speed * directions(len(place(name)))
    one = LockStep(arm_named(name), q=place(name), v=v, rate=rate, delay=4)
    trace = one.run(2.0)
    assert trace.speed.max() < 1.25 * abs(speed)
    assert np.abs(trace.q - place(name)).max() < 0.4 * abs(speed)
    assert rests(trace)
    assert one.loop.supervisor.fault is None


# --- faults --------------------------------------------------------------------------------------

@pytest.mark.parametrize(('name', 'cause'), [
    ('default', 'fault'), ('ur10', 'pause of the states'), ('panda', 'fault')])
def test_after_a_fault_the_arm_stops_and_is_held(name, cause):
    one = in_motion(name)
    goal = one.q + 0.2
    if cause == 'fault':
        one.loop.end(one.now, Ending.by(Fault('external_effort', 'words', recovery=25)))
        with pytest.raises(TrajectoryError, match='fault external_effort: words'):
            one.follow(goal)
        assert one.loop.reference is None
        assert 'fault external_effort' in one.loop.goals.interruption
    else:
        sensor, one.sensor = one.sensor, None
        one.run(0.12)
        one.sensor = sensor
    trace = one.run(3.0)
    assert one.loop.supervisor.fault_count == 1 or cause != 'fault'
    assert (np.abs(trace.v) <= 1.2 * one.arm.limits.velocity).all()
    assert rests(trace)
    assert one.loop.reference.position == pytest.approx(one.q, abs=1e-3)
    one.follow(goal)
    assert one.run(2.5).q[-1] == pytest.approx(goal, abs=1e-3)
    assert one.loop.goals.interruption == ''


def test_the_status_forgets_a_fault_after_its_reset():
    one = in_motion('default')
    one.loop.end(one.now, Ending.by(Fault('position', 'joint1 is at 9 rad', latched=True)))
    one.run(1.0)
    assert 'joint1 is at 9 rad' in one.loop.goals.interruption
    assert one.loop.reset() == (True, 'reset position: joint1 is at 9 rad')
    assert one.loop.goals.interruption == ''


def next_loop(before: ControlLoop, arm: ArmModel) -> ControlLoop:
    limits, old = arm.limits, before.supervisor
    return ControlLoop(
        Controller(arm, before.controller.options if (
            arm.joint_names == before.controller.arm.joint_names) else ControllerOptions(
                ControlLoop.of_arm(arm).controller.options.gains)),
        EffortLimits(
            limits.lower, limits.upper, limits.velocity,
            old.limiter.limits.rate if arm.joint_names == before.controller.arm.joint_names
            else 1000.0),
        old.options, before=before)


@pytest.mark.parametrize('is_same', [True, False])
def test_a_latched_fault_continues_in_the_loop_of_the_next_model(is_same):
    one = in_motion()
    one.loop.end(one.now, Ending.by(Fault('broken', 'words', latched=True)))
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


def test_the_next_model_of_the_same_joints_continues_without_a_step():
    one = in_motion()
    before = one.run(0.01).effort
    last = before[~np.isnan(before).any(axis=1)][-1]
    loop = one.loop = next_loop(one.loop, loaded(1.0))
    answer = loop.answer(FIRST_STAMP + one.k * MS, one.q, one.v)
    assert np.abs(answer.effort - last).max() <= 1500.0 * 0.002 + 1e-9
    one.k += 2
    assert rests(one.run(4.0))  # from the measured state


# --- streams, stops and states -------------------------------------------------------------------

def test_a_stop_in_a_fault_is_a_hold_after_it():
    one = in_motion()
    one.loop.end(one.now, Ending.by(Fault('external_effort', 'words', recovery=25)))
    assert one.loop.stop() == (
        'the arm will stop and hold its position after the fault external_effort: words')
    assert rests(one.run(3.0))


def test_states_that_restart_end_the_reference_and_the_arm_is_held():
    """A simulator, for example, places the arm somewhere else."""
    one = in_motion()
    one.q = one.q + 0.7
    trace = one.run(3.0)
    assert one.loop.restarts == {'jump': 1}
    assert one.loop.goals.interruption == 'joint states restarted: jump'
    assert rests(trace)
    assert np.abs(trace.q - trace.q[0]).max() < 0.5


class Fragile(ControlLaw):
    """Gravity compensation that fails if `is_broken`."""

    is_broken = False

    def effort(self, state: LawInput) -> FloatArray:
        return state.gravity * (np.nan if self.is_broken else 1.0)


def test_a_state_without_a_finite_effort_is_a_latched_fault():
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


def test_an_inactive_loop_answers_without_an_effort():
    loop = ControlLoop.of_arm(arm_named('default'))
    inactive = ControlLoop(loop.controller, loop.supervisor.limiter.limits, SafetyOptions())
    answer = inactive.answer(FIRST_STAMP, Q, 0.0 * Q)
    assert answer.effort is None
    assert answer.output.command is not None  # what would be commanded
    with pytest.raises(TrajectoryError, match='the node is not active'):
        inactive.follow(make_trajectory(loop.controller.arm.joint_names, [0.0], [Q]))


# --- answers -------------------------------------------------------------------------------------

def state(one: LockStep, v: FloatArray | None = None) -> LoopAnswer:
    """Return the answer to the next state at the position of the arm."""
    answer = one.loop.answer(FIRST_STAMP + one.k * MS, one.q, one.v if v is None else v)
    one.k += 2
    return answer


def at_rest() -> LockStep:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    assert one.loop.goals.interruption == ''
    return one


def test_an_effort_has_the_names_of_the_limits_that_change_it():
    one = at_rest()
    answer = state(one)
    assert answer.limits == ()
    assert answer.verdict.dt == pytest.approx(0.002)
    one.loop.supervisor.limiter.last = np.array([100.0, -11.0])
    assert state(one).limits == ('effort rate',)


def test_the_pause_of_a_stream_is_measured_by_the_steady_clock():
    one = at_rest()
    names, loop = one.arm.joint_names, one.loop

    def send(k: int) -> None:
        loop.follow(make_trajectory(names, [0.0], [Q + 0.004 * k], [[0.2, 0.2]]))

    stamp = FIRST_STAMP + 100 * MS
    for k in range(1, 11):
        stamp += 20 * MS
        loop.answer(stamp, Q + 0.004 * k, one.v + 0.2, stamp, stamp)
        send(k)
    steady = stamp
    for k in range(10):  # simulated time is slow
        stamp, steady = stamp + MS, steady + 20 * MS
        loop.answer(stamp, Q + 0.04 + 2e-4 * k, one.v + 0.2, stamp, steady)
    assert loop.goals.paused_streams == 1


def test_a_clock_of_the_driver_that_is_set_back_interrupts_the_motion_with_the_sixth_state():
    one = in_motion()
    stamp, h, shift = FIRST_STAMP + one.k * MS, 2 * MS, 100 * MS
    for k in range(1, 6):
        with pytest.raises(ImplausibleStateError, match='it is not used'):
            one.loop.answer(stamp + k * h - shift, one.q, one.v, stamp + k * h, stamp + k * h)
    assert one.loop.goals.interruption == ''
    answer = one.loop.answer(stamp + 6 * h - shift, one.q, one.v, stamp + 6 * h, stamp + 6 * h)
    assert answer.verdict.restart == 'stamp went back'
    assert one.loop.goals.interruption == 'joint states restarted: stamp went back'


def test_a_noisy_velocity_of_an_arm_at_rest_does_not_delay_the_end():
    one, rng = at_rest(), np.random.default_rng(1)
    one.loop.deactivate(one.now)
    for _ in range(125):
        state(one, rng.normal(0.0, 0.03, 2))
    assert one.loop.supervisor.mode is Mode.INACTIVE


ARM = smooth_arm('default')
PERIOD = 10
"""[ms]"""


def efforts(
    seed: int, count: int, repeats: dict[int, int], goal_at: int, moves: bool,
) -> list[tuple[float, ...] | None]:
    """
    Return the efforts for `count` noisy states; state k arrives 1 + repeats[k] times.

    The steady clock and that of the computer pass at random between two arrivals, the stamps are
    those of simulated time.
    """
    rng, clock = np.random.default_rng(seed), np.random.default_rng(seed + len(repeats))
    loop, steady, found = ControlLoop.of_arm(ARM), 0, []
    loop.is_heard = False  # these states do not follow the commands
    q, v = np.array([0.8, 0.5]), np.array([0.3, -0.2]) if moves else np.zeros(2)
    for k in range(count):
        if k == goal_at:
            loop.follow(quintic_point_to_point(ARM.joint_names, [0.8, 0.5], [1.0, 0.7], 1.0))
        q = q + 1e-3 * PERIOD * v
        noise = rng.normal(0.0, 1e-4, 2), rng.normal(0.0, 1e-3, 2)
        for _ in range(1 + repeats.get(k, 0)):
            steady += int(clock.integers(1, 10)) * MS
            effort = loop.answer(
                (k + 1) * PERIOD * MS, q + noise[0], v + noise[1],
                FIRST_STAMP + steady, steady).effort
        found.append(None if effort is None else tuple(effort.tolist()))
    return found


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**31), repeats=st.dictionaries(
        st.integers(0, 14), st.integers(1, 3), max_size=4),
    goal_at=st.integers(1, 20), moves=st.booleans())
def test_repeated_states_change_no_effort(seed, repeats, goal_at, moves):
    assert efforts(seed, 15, repeats, goal_at, moves) == efforts(seed, 15, {}, goal_at, moves)
