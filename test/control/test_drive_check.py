# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The drive check: wrong drives are named at the joint that has them, right ones never."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import re
from typing import Any

from lock_step_loop import FIRST_STAMP, LockStep, middle, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.model.payload import make_payload
from robot_dynamics.monitoring.drive_causes import Joints
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

Q = {'ur5': np.array([0.0, -1.2, 1.2, -1.0, -1.2, 0.2]),
     'panda': np.array([0.0, -0.6, 0.1, -2.0, 0.1, 1.6, 0.2])}
J = {'ur5': 1, 'panda': 3}
"""A joint that gravity loads."""
Drive = Callable[[FloatArray, FloatArray], FloatArray]
"""Returns the torque (n,) at the joints for a command (n,) and g(q) (n,)."""


def at(j: int, change: Callable[[float], float]) -> Drive:
    """Return a drive that changes the command of one joint."""
    def drive(tau: FloatArray, g: FloatArray) -> FloatArray:
        tau = tau.copy()
        tau[j] = change(float(tau[j]))
        return tau
    return drive


class Driven(LockStep):
    """An arm with rotors that the loop does not know, and with given drives."""

    def __init__(
        self, name: str, drive: Drive = lambda tau, g: tau, load: float = 0.0,
        report: Drive | None = None, rate: float = 500.0,
        gravity: Sequence[float] = (0.0, 0.0, -9.81), **options: Any,
    ) -> None:
        """`load` [kg] is a mass at the last link; `report` returns the report of a command."""
        arm = smooth_arm(name)
        self.drive, self.said = drive, report
        true = arm.with_gravity(gravity).with_reflected_inertia(arm.limits.effort / 1000.0)
        true = true.with_payloads([make_payload(arm.link_names[-1], load, (0.0, 0.0, 0.05))])
        super().__init__(arm, true_arm=true, q=Q[name], rate=rate, **options)

    def _move(self, tau: FloatArray) -> None:
        g = self._body.gravity(self.q)
        samples = self.loop.drives.samples
        if self.said is not None and samples.wants_report:
            samples.report(self.said(tau, g))
        super()._move(self.drive(tau, g))

    def go(self, way: float) -> None:
        """Move all joints by a way [rad]."""
        names = self.arm.joint_names
        goal = self.q + way * np.where(self.q > middle(self.arm), -1.0, 1.0)
        self.loop.follow(make_trajectory(names, [0.0], [goal]))

    def words(self) -> list[str]:
        """Return the verdict of each joint."""
        return [one.verdict for one in self.loop.drives.verdicts()]


# --- wrong drives --------------------------------------------------------------------------------

def is_about(verdict: str, word: str) -> bool:
    """Return whether a verdict is this word, with its number within 15 %."""
    name, _, number = word.rpartition(' ')
    if not number.replace('.', '').isdigit():
        return verdict.startswith(word)
    return verdict.startswith(name) and float(verdict.split()[-1]) == pytest.approx(
        float(number), rel=0.15)


WRONG = {
    'reversed': lambda tau: -tau, 'no effect': lambda tau: 0.0,
    'command scale 0.25': lambda tau: 0.25 * tau, 'command scale 2': lambda tau: 2.0 * tau,
    'command scale 4': lambda tau: 4.0 * tau, 'clipped at': lambda tau: np.clip(tau, -10.0, 10.0)}
arms = pytest.mark.parametrize(('name', 'rate'), [('ur5', 250.0), ('panda', 1000.0)])


@arms
@pytest.mark.parametrize('word', WRONG)
def test_a_wrong_drive_is_named_at_its_joint_only(name, word, rate):
    one = Driven(name, at(J[name], WRONG[word]), rate=rate)
    one.run(0.4)
    words = one.words()
    assert is_about(words[J[name]], word)
    del words[J[name]]
    assert set(words) <= {'agrees', 'not observable yet'}


def test_a_drive_at_its_limit_shows_its_scale_once_it_gets_less():
    one = Driven('panda', at(3, lambda tau: float(np.clip(4.0 * tau, -87.0, 87.0))), rate=250.0)
    while one.loop.drives.wrong is None and one.k < 100:
        one.run(0.004)
    assert re.search(r'command scale ([34]\.|3.0 or more)', one.loop.supervisor.fault.message)
    one.run(0.4)
    assert is_about(one.words()[3], 'command scale 4')


@pytest.mark.parametrize('name', ['ur5', 'panda'])
@pytest.mark.parametrize(('word', 'drive'), [
    ('adds gravity', lambda tau, g: tau + g), ('no effect', lambda tau, g: 0.0 * tau)])
def test_a_cause_of_the_whole_arm_is_named_as_such(name, word, drive):
    one = Driven(name, drive)
    one.run(0.4)
    assert one.words()[J[name]] == word
    assert set(one.words()) <= {word, 'not observable yet'}


@pytest.mark.parametrize(('name', 'gravity', 'angle'), [
    ('ur5', (0.0, 9.81, 0.0), 90.0), ('panda', (0.0, 9.81, 0.0), 90.0),
    ('ur5', (0.0, 0.0, 9.81), 180.0), ('panda', (5.0, 0.0, -8.44), 30.6)])
def test_a_tilted_base_is_named_with_its_gravity(name, gravity, angle):
    one = Driven(name, gravity=gravity)
    one.run(0.4)
    word, sentence = one.loop.drives.verdicts()[J[name]]
    assert word.startswith('gravity tilted by ')
    assert float(word.split()[-1]) == pytest.approx(angle, abs=15.0)
    assert set(one.words()) == {word}
    assert sentence.startswith('the motion needs a gravity of [')
    assert sentence.endswith('set gravity, or mount the base as in the URDF')


@pytest.mark.parametrize('name', ['ur5', 'panda'])
@pytest.mark.parametrize('word', ['reversed', 'no effect', 'command scale 4'])
def test_gravity_compensation_ends_by_a_wrong_drive_that_moves_the_arm_at_once(name, word):
    one = Driven(name, at(J[name], WRONG[word]), command='gravity_compensation')
    while one.loop.drives.wrong is None and one.k < 200:
        one.run(0.004)
    assert np.abs(one.q - Q[name])[J[name]] <= 0.07
    assert one.loop.supervisor.fault.name == 'wrong_drive'
    assert word.split()[0] in one.words()[J[name]]


def test_a_clipped_drive_and_a_scale_are_named_together_while_both_explain_the_motion():
    """The command of the first 30 ms is that of gravity alone, which does not separate them."""
    one = Driven('ur5', at(1, lambda tau: 0.3 * tau))
    one.run(0.04)
    verdict = one.loop.drives.verdicts()[1]
    assert verdict.verdict.startswith('unclear: ')
    assert 'command scale 0.' in verdict.verdict
    assert 'clipped at' in verdict.verdict
    assert verdict.sentence.endswith('a motion with other torques at this joint separates them')


# --- right drives --------------------------------------------------------------------------------

@pytest.mark.parametrize('name', ['ur5', 'panda'])
@pytest.mark.parametrize('load', [0.0, 1.0])
def test_right_drives_agree_after_a_motion_and_are_never_accused(name, load):
    one = Driven(name, load=load)
    one.run(0.5)
    assert set(one.words()) <= {'agrees', 'not observable yet'}
    one.go(0.5)
    one.run(1.2)
    assert set(one.words()) <= {'agrees', 'not observable yet'}
    assert load > 0.0 or one.words().count('agrees') >= 3


@pytest.mark.parametrize(('name', 'law', 'begin'), [
    ('ur5', 'computed_torque', 0.5), ('panda', 'computed_torque', 0.1),
    ('panda', 'gravity_compensation', 0.1), ('ur5', 'hand_guiding', 0.2)])
def test_a_push_is_not_a_wrong_drive(name, law, begin):
    one, rng = Driven(name, command=law), np.random.default_rng(1)
    force = 0.15 * one.arm.limits.effort * rng.uniform(-1.0, 1.0, len(one.q))
    start = one.now
    one.push = lambda t: force if begin < t - start < begin + 0.3 else 0.0
    for _ in range(4):
        one.run(0.4)
        assert set(one.words()) <= {'agrees', 'not observable yet'}
        assert one.loop.drives.wrong is None


def test_an_arm_that_rests_shows_nothing():
    one = Driven('ur5')
    one.run(0.6)
    assert one.words() == ['not observable yet'] * 6


def test_the_friction_of_an_identified_arm_has_the_deviation_of_the_live_residual():
    arm = smooth_arm('ur5')  # limits 150 and 28 N·m
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=[4.0]))
    mean, deviation = Joints.of_arm(arm, 100.0).friction
    assert [mean[0], mean[5], deviation[0], deviation[5]] == pytest.approx([4.5, 4.0, 3.0, 1.2])
    for noise, expected in ((3.0, 5.0), (0.1, 4.0)):
        found = replace(arm, uncertainty=make_uncertainty(
            arm, noise_deviation=[noise], noise_bandwidth=10.0, friction_deviation=[4.0],
            friction_velocity=[0.1]))
        mean, deviation = Joints.of_arm(found, 100.0).friction
        assert mean == pytest.approx(4.0)
        assert deviation == pytest.approx(expected, rel=1e-2)


# --- reports -------------------------------------------------------------------------------------

def test_the_scale_of_a_report_is_named_once_the_motion_confirms_the_command():
    one = Driven('ur5', report=at(1, lambda tau: 2.0 * tau))
    one.run(0.8)
    assert one.words()[1] == 'unclear: report scale 2.0 or command scale 2.0'
    one.go(0.5)
    one.run(1.2)
    verdict = one.loop.drives.verdicts()[1]
    assert is_about(verdict.verdict, 'report scale 2.0')
    assert 'set effort.report_scale to 0.' in verdict.sentence


def test_a_report_in_steps_is_coarse():
    one = Driven('ur5', report=at(1, lambda tau: 8.0 * round(tau / 8.0)))
    one.run(0.3)
    one.go(0.5)
    one.run(1.0)
    assert one.words()[1] == 'coarse 8.0'


@pytest.mark.parametrize(('name', 'report', 'delay', 'word'), [
    ('ur5', None, 40, 'delayed by 0.040'), ('panda', lambda tau, g: tau, 10, 'agrees'),
    ('panda', lambda tau, g: tau, 40, 'delayed by 0.040')])
def test_a_motion_or_a_late_report_shows_the_delay_of_the_command(name, report, delay, word):
    one = Driven(name, report=report)
    one.delay = delay
    one.run(0.5)
    one.go(0.5)
    one.run(1.0)
    assert word in one.words()
    assert set(one.words()) <= {word, 'agrees', 'not observable yet'}


@pytest.mark.parametrize(('share', 'word', 'sentence'), [
    (1.0, 'adds gravity', 'the command that holds the arm is 0.00 g(q) ± '),
    (0.0, 'not observable yet', '')])
def test_a_robot_that_holds_itself_is_seen_without_a_command_and_brakes_are_none(
        share, word, sentence):
    one = Driven('ur5', lambda tau, g: g, report=lambda tau, g: share * g)
    one.loop.is_heard = False
    one.run(1.0)
    assert one.words() == [word] * 6
    assert one.loop.drives.verdicts()[0].sentence.startswith(sentence)


# --- samples -------------------------------------------------------------------------------------

def test_the_needed_torque_of_a_known_arm_is_the_commanded_one():
    one = LockStep(smooth_arm('ur5'), q=Q['ur5'])
    one.run(0.5)
    one.loop.follow(make_trajectory(one.arm.joint_names, [0.0], [Q['ur5'] + 0.4]))
    one.run(0.6)
    window = one.loop.drives.samples.window()
    assert np.abs(window.acceleration).max() > 2.0
    assert np.abs(window.needed - window.commanded).max() < 0.3
    assert set(np.round(np.diff(window.time), 4)) == {0.01, 0.04}


def test_no_sample_spans_a_gap():
    one = LockStep(smooth_arm('ur5'), q=Q['ur5'])
    one.run(0.5)
    count = one.loop.drives.samples.count
    for k in range(2):
        one.loop.answer(FIRST_STAMP + (one.k + 300 * (k + 1)) * MS, one.q, one.v)
    assert one.loop.drives.samples.count == count


# --- the end of the command ----------------------------------------------------------------------

@arms
@pytest.mark.parametrize('word', [
    'reversed', 'no effect', 'command scale 0.25', 'command scale 2'])
def test_a_wrong_drive_ends_the_command_before_the_arm_has_moved(name, word, rate):
    one = Driven(name, at(J[name], WRONG[word]), rate=rate)
    while one.loop.drives.wrong is None and one.k < 500:
        one.run(0.004)
    assert np.abs(one.q - Q[name]).max() <= 0.1
    fault = one.loop.supervisor.fault
    assert (fault.name, fault.latched) == ('wrong_drive', True)
    assert f'{one.arm.joint_names[J[name]]!r}: ' in fault.message


def test_a_reversed_drive_gets_no_effort_any_more():
    one = Driven('ur5', at(1, WRONG['reversed']))
    one.run(0.1)
    effort = one.run(0.3).effort
    assert np.nanmax(np.abs(effort[:, 1])) == 0.0
    assert np.nanmin(np.abs(effort[:5, 2])) > 1.0  # the others are held


@pytest.mark.parametrize('rate', [125.0, 500.0])
@pytest.mark.parametrize('is_all', [False, True])
@pytest.mark.parametrize('scale', [2.0, 4.0])
def test_a_drive_that_delivers_more_than_the_command_is_held_with_less(scale, is_all, rate):
    """At rest, twice all commands is also a robot that adds gravity: what follows tells."""
    one = Driven('ur5', (lambda tau, g: scale * tau) if is_all else at(
        1, lambda tau: scale * tau), rate=rate)
    one.run(0.4)
    effort = one.run(0.2).effort[-1, 1]
    assert effort * scale == pytest.approx(one._body.gravity(one.q)[1], rel=0.1)
    assert is_about(one.words()[1], f'command scale {scale:g}')
    assert np.abs(one.v).max() < 0.3
    assert np.abs(one.q - Q['ur5']).max() < 0.25


def test_a_robot_that_adds_gravity_holds_itself_when_it_is_seen():
    one = Driven('ur5', lambda tau, g: tau + g)
    trace = one.run(0.5)
    assert np.nanmax(np.abs(trace.effort[100:])) == 0.0
    assert np.abs(trace.q[-1] - Q['ur5']).max() < 0.15  # it has no friction


def test_after_a_reset_a_drive_that_is_right_now_is_commanded_again():
    one = Driven('ur5', at(1, WRONG['no effect']))
    one.run(0.2)
    assert one.loop.supervisor.fault.name == 'wrong_drive'
    one.drive = lambda tau, g: tau
    assert one.loop.reset()[0]
    one.run(1.0)
    assert np.abs(one.v).max() < 0.01
    assert one.loop.supervisor.fault_count == 1


def test_the_feedback_of_the_first_60_ms_is_bounded():
    """A disturbed position: the full feedback of 20 mrad would be far above 5 % of the limit."""
    one = Driven('ur5')
    one.run(0.02)  # until the measured velocities are used
    one.q = one.q + 0.02
    trace = one.run(0.03)
    g = np.abs(trace.effort - trace.effort[0])[:, 1]
    assert 5.0 < np.nanmax(g) <= 7.6
    assert np.nanmax(np.abs(one.run(0.25).effort[:, 1])) > 0.0
