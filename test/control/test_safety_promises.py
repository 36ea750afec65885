# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Every number that docs/safety.md promises, in the order of the page, as a literal.

A default loop is driven just below and just above each bound, so that a change of the number
fails. Nothing here is imported from the product to compare the product with it. Numbers of
docs/command.md and docs/control_laws.md on which a user relies follow. The last test finds a
number of docs/safety.md that is not in `STATED`.
"""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
import math
import os
from pathlib import Path
import re
import signal
import time
from typing import Any

from bristled_arm import BristledArm, Case
from lock_step_loop import directions, FIRST_STAMP, LockStep, MS, smooth_arm, STEP
from loop_motions import arm_named, in_motion, loaded, Q, rests
import numpy as np
from one_joint_arm import arm_of, inertial
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.model import ArmModel, load_arm
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

DOCS = Path(__file__).parents[2] / 'docs'
LIMITED = load_arm(arm_of(link=inertial(mass=2.0, xyz='0.3 0 0')))
"""One joint: ±2 rad, 100 N·m, 2 rad/s, g(0) = −5.886 N·m, 0.28 kg·m²."""
WEIGHT = 2.0 * 9.81 * 0.3
RATE = np.array([1500.0, 600.0])
"""[N·m/s] of the default arm: its effort limits, 150 and 60 N·m, in 0.1 s."""


class Given(ControlLaw):
    """The hold torque and a given effort."""

    extra: FloatArray | float = 0.0

    def effort(self, state: LawInput) -> FloatArray:
        return state.gravity + self.extra


class Fed:
    """A loop that gets states from the test, and is asked for efforts at any time."""

    def __init__(self, arm: ArmModel = LIMITED, q: Sequence[float] = (0.0,), **options: Any):
        safety = options.pop('safety', {})
        self.loop = ControlLoop.of_arm(arm, options.pop('law', None), **options)
        supervisor = self.loop.supervisor
        self.loop.set_options(
            self.loop.controller.options, supervisor.limiter.limits,
            replace(supervisor.options, **safety))
        self.q, self.ns = np.array(q), FIRST_STAMP
        self.supervisor = supervisor

    @property
    def now(self) -> float:
        return 1e-9 * self.ns

    def state(self, v: Sequence[float] | float = 0.0, after: float = 0.002) -> FloatArray | None:
        """Pass the next state, at a velocity since the last one; return the effort."""
        self.ns += round(1e9 * after)
        self.q = self.q + after * np.multiply(v, np.ones_like(self.q))
        return self.loop.answer(self.ns, self.q, v * np.ones_like(self.q)).effort

    def states(self, count: int, v: float = 0.0, after: float = 0.002) -> 'Fed':
        for _ in range(count):
            self.state(v, after)
        return self

    def ticks(self, seconds: float, step: float = 0.001) -> FloatArray:
        """Return the efforts (k, n) each `step` after the last state, NaN without one."""
        efforts = [self.loop.tick(self.now + step * k) for k in range(1, round(seconds / step))]
        return np.array([np.full_like(self.q, np.nan) if e is None else e for e in efforts])

    @property
    def fault(self) -> str:
        """The name of the active fault, or ''."""
        mode, fault = self.supervisor.mode, self.supervisor.fault
        return fault.name if fault is not None and mode is Mode.FAULT else ''


# --- What the node does --------------------------------------------------------------------------

@pytest.mark.parametrize(('passed', 'counted'), [
    (0.002, 0.002), (0.049, 0.049), (0.051, 0.05), (0.2, 0.05)])
def test_rate_of_change(passed, counted):
    """The rate limit is by default the effort limit in 0.1 s; of the time 0.05 s count."""
    law = Given()
    one = Fed(arm_named('default'), Q, law=law, safety={'state_timeout': 1.0})
    before = one.states(200).state()
    law.extra = 0.07 * RATE
    assert one.state(after=passed) - before == pytest.approx(counted * RATE, rel=1e-9)


@pytest.mark.parametrize(('rate', 'scale'), [(100.0, 0.9345), (30.3, 0.496)])
def test_gains_for_8_ms(rate, scale):
    """Feedback: 0.5 rad of phase for half a period and 8 ms, at the crossover of 41.2 rad/s."""
    one = LockStep(arm_named('default'), q=Q, rate=rate)
    one.run(1.5)
    gains = one.loop.controller.gains
    assert gains.least == pytest.approx(scale, rel=2e-3)
    assert gains.reference_scale == pytest.approx(scale, rel=2e-3)


@pytest.mark.parametrize(('effort', 'most'), [(100, (1.0, 5.0, 100.0)), (8, (1.0, 3.77, 75.4))])
def test_references_stay_within_velocity_acceleration_and_jerk(effort, most):
    """
    Half of the velocity limit of 2 rad/s, reached in 0.2 s, and its acceleration in 0.05 s.

    With 8 N·m: half of what gravity leaves, 2.11 N·m, over 0.28 kg·m² (trajectories.md).
    """
    limit = f'<limit lower="-2" upper="2" effort="{effort}" velocity="2"/>'
    one = Fed(load_arm(arm_of(inertial(mass=2.0, xyz='0.3 0 0'), limit)), [-0.9]).states(200)
    one.loop.follow(make_trajectory(('hinge',), [0.0], [[0.9]]))
    motion = one.loop.controller.trajectory
    v, a = (np.array([motion.sample(one.ns + k * MS)[order][0] for k in range(3000)])
            for order in (1, 2))
    assert (v.max(), a.max(), np.diff(a).max() / 1e-3) == pytest.approx(most, rel=0.02)


@pytest.mark.parametrize('given', [0.6, 1.4])
def test_wrong_friction(given):
    """Dry friction given 0.6 to 1.4 times: the arm comes to rest."""
    one = BristledArm(smooth_arm('default'), Case('default', 100, 8, 5e-3, given))
    one.run(0.1)
    goal = one.q + 0.1 * directions(2)
    one.follow(goal)
    assert one.run(1.5).last(0.4).speed.max() < 1e-3
    assert np.abs(one.q - goal).max() < 0.03


@pytest.mark.parametrize(('passed', 'fault'), [(0.0499, ''), (0.0501, 'state_timeout')])
def test_a_gap_up_to_the_state_timeout_continues_the_motion(passed, fault):
    """The default of state_timeout is 0.05 s."""
    one = Fed().states(10)
    one.loop.tick(one.now + passed)
    assert one.fault == fault


@pytest.mark.parametrize(('speed', 'count', 'fault'), [
    (0.021, 25, ''), (0.021, 26, 'frozen_joint'), (0.019, 100, '')])
def test_a_joint_whose_position_repeats_in_motion_is_frozen_after_50_ms(speed, count, fault):
    """command.md: although it moved at 0.02 rad/s before."""
    one = Fed(arm_named('default'), Q).states(2, 0.001).states(20, speed)
    for _ in range(count):
        one.state([speed, 0.0])
    assert one.fault == fault


@pytest.mark.parametrize(('share', 'ends'), [(0.099, False), (0.101, True)])
def test_an_arm_with_a_frozen_joint_is_held_while_the_others_rest(share, ends):
    """command.md: up to 0.1 of the velocity limit from 0.5 s after the fault; else a ramp."""
    one = Fed(arm_named('default'), Q).states(150).states(2, 0.001).states(20, 0.3)
    one.state([0.3, 0.0])
    efforts = [one.state([10.0 * share, 0.0]) for _ in range(700)]
    assert one.fault == 'frozen_joint'
    gone = [effort is None for effort in efforts]
    assert any(gone) == ends
    if ends:  # the ramp of 0.5 s included
        assert 0.002 * gone.index(True) == pytest.approx(0.05 + 0.5 + 0.5, abs=0.01)


def test_a_following_error_is_that_of_300_ms_at_the_velocity_limit():
    """Following error: 0.3 s at the velocity limit."""
    one = Fed().states(150).states(298, 1.0)  # 0.596 rad; the limit is 2 rad/s
    assert one.supervisor.fault is None
    assert one.states(4, 1.0).supervisor.fault.name == 'following_error'


@pytest.mark.parametrize(('share', 'fault'), [(1.19, ''), (1.21, 'overspeed')])
def test_overspeed_is_1_2_times_the_velocity_limit(share, fault):
    assert Fed().states(5).states(10, 2.0 * share).fault == fault


@pytest.mark.parametrize(('beyond', 'fault'), [(0.0086, ''), (0.0088, 'position_limit')])
def test_the_position_limit_tolerance_is_half_a_degree(beyond, fault):
    """The tolerance is 0.0087 rad; five good states end the fault."""
    one = Fed(q=[1.99]).states(5).states(20, (0.01 + beyond) / 0.04)
    assert one.fault == fault
    if fault:
        assert one.states(4, -0.05).fault == fault
        assert one.states(1).fault == ''


@pytest.mark.parametrize(('q', 'extra'), [(1.9895, 10.0), (1.9905, 0.0)])
def test_no_acceleration_within_10_mrad_of_a_position_limit(q, extra):
    """Limits ahead: no acceleration toward a position limit, the margin is 0.01 rad."""
    law = Given()
    one = Fed(q=[q], law=law).states(20)
    before = one.state()
    law.extra = 10.0
    assert one.states(20).state() - before == pytest.approx([extra])


@pytest.mark.parametrize(('v', 'extra'), [(1.99, 10.0), (2.01, 0.0)])
def test_no_acceleration_above_the_velocity_limit(v, extra):
    law = Given()
    one = Fed(q=[-1.0], law=law).states(20).states(40, v)
    law.extra = 10.0
    effort = one.states(10, v).state(v)
    assert effort - 2.0 * 9.81 * 0.3 * -math.cos(one.q[0]) == pytest.approx([extra], abs=0.01)


def test_stop_at_the_end():
    """End of the command: the arm stops and is held, within 2.5 s; here it never rests."""
    one = in_motion()
    one.push = lambda t: 60.0 * np.sin(np.array([9.0, 12.0]) * t)
    one.loop.deactivate(one.now)
    end = STEP * one.run(2.6).mode.index(Mode.INACTIVE)
    assert end == pytest.approx(2.5, abs=0.003)


@pytest.mark.parametrize(('creep', 'rests'), [(0.0185, True), (0.0215, False)])
def test_an_arm_rests_that_moves_by_less_than_2_mrad_in_100_ms(creep, rests):
    """command.md: no joint has moved by more than 0.002 rad in 0.1 s."""
    one = Fed().states(100)
    one.loop.deactivate(one.now)
    begin = one.now
    while one.supervisor.mode is Mode.BRAKING:
        one.state(creep)
        one.loop.tick(one.now)
    assert one.now - begin == pytest.approx(0.104 if rests else 2.5, abs=0.1)


# --- In a fault ----------------------------------------------------------------------------------

def test_without_states_the_hold_torque_lasts_1_s_and_the_ramp_half_a_second():
    """hold_gravity_then_ramp (default): floats for hold_time, then sinks during ramp_time."""
    one = Fed().states(100)
    effort = one.ticks(2.0)[:, 0]
    published = np.flatnonzero(~np.isnan(effort))
    assert STEP * (1 + published[0]) == pytest.approx(0.051, abs=2e-3)  # state_timeout
    held = np.flatnonzero(np.abs(effort - effort[published[0]]) < 1e-9)
    assert effort[published[0]] == pytest.approx(WEIGHT * -1.0, rel=1e-3)
    assert STEP * (1 + held[-1]) == pytest.approx(1.051, abs=3e-3)
    assert STEP * (1 + published[-1]) == pytest.approx(1.551, abs=3e-3)
    assert effort[1300] == pytest.approx(0.5 * effort[1000], rel=0.01)
    assert effort[published[-1]] == 0.0


def test_without_a_ramp_time_the_effort_limit_ends_in_100_ms():
    """command.md: with ramp_time 0.0 by default 0.1 s from the effort limit to zero."""
    law = Given()
    one = Fed(law=law, safety={'ramp_time': 0.0, 'fault_action': 'ramp_to_zero'}).states(5)
    law.extra = 200.0
    assert one.states(100).state() == pytest.approx([100.0])
    effort = one.ticks(0.3)[:, 0]
    assert STEP * (1 + np.flatnonzero(effort == 0.0)[0]) == pytest.approx(0.1, abs=3e-3)


@pytest.mark.parametrize(('count', 'last', 'waits', 'damped'), [
    (2, 1.0, False, False), (3, 9.9, True, False), (3, 10.1, False, False),
    (5, 1.0, True, False), (6, 1.0, True, True)])
def test_three_faults(count, last, waits, damped):
    """Three faults; command.md: within 10 s, and three more of the arm that is held."""
    one = Fed(safety={'state_timeout': 30.0}).states(5)
    for k in range(count):
        if k == count - 1:
            one.state(after=last)
        one.loop.end(one.now, Ending.by(Fault('overspeed', 'words')))
        one.states(2)
    assert (one.loop.obstacle != '') == waits
    assert (one.states(500).fault != '') == damped
    assert one.loop.reset()[0] == waits
    one.state()
    assert one.loop.obstacle == ''


# --- What you must do ----------------------------------------------------------------------------

def test_time_to_end():
    """The stop takes up to 2.5 s: keep ramp_time and effort / effort_rate_limit below 2 s."""
    assert Fed(safety={'ramp_time': 2.0}).states(5).supervisor.time_to_stop == 4.5


@pytest.mark.parametrize(('fraction', 'extra', 'expected'), [
    (0.5, 90.0, 50.0), (0.5, -90.0, -50.0), (0.01, -90.0, -WEIGHT), (0.01, 90.0, 1.0)])
def test_effort_limit_fraction(fraction, extra, expected):
    """effort_limit_fraction 0.5; a low scale does not drop the arm, here 1 N·m."""
    law = Given()
    one = Fed(law=law, effort_limit_fraction=fraction).states(5)
    law.extra = extra
    assert one.states(100).state() == pytest.approx([expected])


def test_small_set_point():
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    one.follow(Q + 0.05)
    assert rests(one.run(2.0))
    assert one.q == pytest.approx(Q + 0.05, abs=1e-4)


# --- command.md ----------------------------------------------------------------------------------

def test_the_defaults_of_the_feedback():
    """control_laws.md: ω = 20 rad/s and ζ = 1; command.md: damping in a fault is half of K_d."""
    one = Fed().states(300)
    before, moment, v = one.state(), 0.28, 0.01
    one.q = one.q + 1e-5
    assert (one.state() - before) / moment == pytest.approx([-400.0 * 1e-5], rel=0.02)
    one.q = one.q - 1e-5
    before = one.states(20).state()
    effort = one.loop.answer(one.ns + 2 * MS, one.q, np.array([v])).effort
    assert (effort - before) / moment == pytest.approx([-40.0 * v], rel=0.05)
    one = Fed().states(300)
    before = one.state()
    one.loop.end(one.now, Ending.by(Fault('trouble', 'words', recovery=99)))
    effort = one.loop.answer(one.ns + 2 * MS, one.q, np.array([v])).effort
    assert (effort - before) / moment == pytest.approx([-20.0 * v], rel=0.02)


@pytest.mark.parametrize(('age', 'reason'), [(0.199, ''), (0.201, 'old'), (-0.201, 'future')])
def test_states_of_another_age_than_200_ms_are_dropped(age, reason):
    """command.md: state_max_age is 0.2 s."""
    one = Fed().states(5)
    clock = one.ns + round(1e9 * age)
    with pytest.raises(ImplausibleStateError, match=reason) if reason else nullcontext():
        one.loop.answer(one.ns + MS, one.q, np.zeros(1), clock + MS)


def test_a_contradiction_of_publishers_ends_after_100_valid_states():
    one = Fed().states(5)
    for _ in range(3):
        one.states(1)
        with pytest.raises(ImplausibleStateError):
            one.loop.answer(
                one.ns + 1, one.q + 1.0, np.zeros(1), has_several_publishers=lambda: True)
    assert one.fault == 'several_publishers'
    assert one.states(99).fault == 'several_publishers'
    assert one.states(1).fault == ''


def test_a_frozen_joint_recovers_after_25_states_that_change():
    one = Fed(arm_named('default'), Q).states(150).states(2, 0.001).states(20, 0.3)
    for _ in range(30):
        one.state([0.3, 0.0])
    assert one.fault == 'frozen_joint'
    assert one.states(24, 0.3).fault == 'frozen_joint'
    assert one.states(1, 0.3).fault == ''


@pytest.mark.parametrize(('count', 'passed', 'ends'), [
    (4, 1.0, False), (5, 0.098, False), (5, 0.102, True)])
def test_five_set_points_within_100_ms_form_a_stream_that_times_out(count, passed, ends):
    """command.md: reference_timeout is 0.1 s; fewer set-points never time out."""
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    for k in range(count):
        one.run(0.02)
        one.follow(Q + 0.01 * (k + 1))
    one.run(passed)
    assert one.loop.goals.paused_streams == ends


@pytest.mark.parametrize(('factor', 'is_consistent'), [
    (1.3, True), (0.7, True), (0.68, False)])
def test_the_scale_of_a_velocity_may_be_wrong_by_30_percent(factor, is_consistent):
    """command.md: 30 % of the displacement and 0.003 rad, with a time constant of 0.1 s."""
    one = Fed(arm_named('default'), Q)
    for _ in range(300):
        one.ns += 2 * MS
        one.q = one.q + 0.002 * np.array([4.0, 4.0])
        one.loop.answer(one.ns, one.q, factor * np.array([4.0, 4.0]))
    assert one.loop.gate.doubtful.any() != is_consistent


# --- control_laws.md -----------------------------------------------------------------------------

@pytest.mark.parametrize(('load', 'rate', 'steady', 'largest'), [
    (1.0, 125.0, 0.052, 0.056), (4.0, 125.0, 0.215, 0.263)])
def test_the_sag_under_an_unknown_load(load, rate, steady, largest):
    """control_laws.md: errors of the second joint, held at 0.3 rad at both joints."""
    q = np.array([0.3, 0.3])
    one = LockStep(arm_named('default'), true_arm=loaded(load), q=q, rate=rate)
    error = np.abs(one.run(5.0).q - q).max(axis=1)
    assert error[-1] == pytest.approx(steady, rel=0.02)
    assert error.max() == pytest.approx(largest, rel=0.02)


# --- nodes ---------------------------------------------------------------------------------------

DEFAULTS = {
    'command': 'computed_torque', 'effort_limit_fraction': 1.0,
    'effort_rate_limit': 0.0, 'end_action': 'hold_then_silence', 'external_effort_limit': [],
    'fault_action': 'hold_gravity_then_ramp', 'following_error_limit': [], 'hold_time': 1.0,
    'infeasible_trajectory': 'reject',
    'ramp_time': 0.5, 'reference_timeout': 0.1,
    'state_max_age': 0.2, 'state_timeout': 0.05}
"""The guarantees hold with default parameters."""


def test_the_node_has_the_defaults_of_the_loop():
    parameters = pytest.importorskip('robot_dynamics.ros.dynamics.parameters')
    values = {spec.name: spec.default for spec in parameters.SPECS}
    assert {name: values[name] for name in DEFAULTS} == DEFAULTS
    loop = ControlLoop.of_arm(LIMITED)
    supervisor = loop.supervisor
    options = replace(parameters.options_from(values, LIMITED), parameters={})
    assert repr(options) == repr(loop.controller.options)
    assert parameters.safety_options(values) == supervisor.options
    limits = parameters.effort_limits(values, LIMITED)
    for name in ('lower', 'upper', 'velocity', 'rate', 'effort'):
        assert np.array_equal(getattr(limits, name), getattr(supervisor.limiter.limits, name))


def test_a_fault_action_publishes_every_2_ms():
    """command.md: without valid states fault_action, every 2 ms."""
    bench = pytest.importorskip('stepped_node')
    with bench.stepped_node() as one:
        path = one.node._path
        path.loop.end(time.monotonic(), Ending.by(Fault('trouble', 'words')))
        with path.command._changed:
            assert path.command._tick() == 0.002


def test_requests_may_take_1_gib_beyond_the_memory_at_the_start(monkeypatch):
    running, asked = pytest.importorskip('robot_dynamics.ros.running'), []
    monkeypatch.setattr(running.resource, 'setrlimit', lambda _, limits: asked.append(limits[0]))
    has = int(re.search(r'VmData:\s*(\d+)', Path('/proc/self/status').read_text())[1])
    running.limit_memory()
    assert asked[0] - 1024 * has == pytest.approx(1_073_741_824, rel=0.05)


def test_a_signal_ends_the_command_with_zeros(client):
    """With `ramp_to_zero`; here without further joint states."""
    harness = pytest.importorskip('ros_harness')
    kind = pytest.importorskip('sensor_msgs.msg').JointState
    with client.collect(kind, '/ends/effort_command') as commands:
        node = harness.NodeProcess(
            harness.DYNAMICS, {**harness.UNHURRIED, 'end_action': 'ramp_to_zero'},
            namespace='/ends').start()
        states = client.publisher(kind, '/ends/joint_states')
        state = kind(name=['joint1', 'joint2'], position=[0.8, 0.5], velocity=[0.0, 0.0])
        client.ask(states, state, commands, lambda message: message.effort[0] != 0.0)
        os.kill(node.pid, signal.SIGTERM)
        commands.wait_for(lambda message: not any(message.effort))
        assert node.wait() == 0, node.log
        assert not any(commands.messages[-1].effort)


# --- the page ------------------------------------------------------------------------------------

STATED: dict[str, Any] = {
    'at most 0.05 s count': test_rate_of_change,
    'more than 8 ms of delay in addition to the period': test_gains_for_8_ms,
    'given 0.6 to 1.4 times': test_wrong_friction,
    'in the first 60 ms the feedback is at most 5 %': 'test_drive_check.py',
    'it then grows within 0.14 s': 'test_drive_check.py',
    'before 0.1 rad in most cases': 'test_drive_check.py',
    'the arm stops and is held, within 2.5 s': test_stop_at_the_end,
    'After three faults of the motion, references wait': test_three_faults,
    'brakes that engage 0.02 to 0.2 s after': 'test_closed_loop.py',
    'the last command | 0.000 rad | **0.4 to 1.3 rad** | 0.000 rad |': 'test_closed_loop.py',
    'floats: 0.000 rad |': 'test_closed_loop.py',
    'floats: 0.000 rad ': 'test_closed_loop.py',
    'libfranka stops after 20 ms': 'another system',
    'SIGTERM 5 s after SIGINT, and SIGKILL another 5 s later': 'another system',
    'The stop takes up to 2.5 s': test_stop_at_the_end,
    'divided by `effort_rate_limit`, below 2 s': test_time_to_end,
    'effort_limit_fraction 0.5': test_effort_limit_fraction,
    'that is 0.05 rad away': test_small_set_point,
}
"""Each sentence of docs/safety.md with a number, in the order of the page, and its test."""


def test_every_number_of_the_page_has_a_test():
    text = (DOCS / 'safety.md').read_text(encoding='utf-8')
    text = re.sub(r'\]\([^)]*\)|^\d+\. |SROS 2|ros2', '', text, flags=re.MULTILINE)
    text, at = ' '.join(text.split()), 0
    for words in STATED:
        at = text.find(words, at)
        assert at >= 0, f'docs/safety.md no longer states, in this order: {words}'
        text = text[:at] + text[at + len(words):]
    numbers = r'.{,40}(?<!\w)(?:\d[\d.,]*|three|four|five|ten|hundred)\b.{,20}'
    assert not re.findall(numbers, text), 'a number without a test'
