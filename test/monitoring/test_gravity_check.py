# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Properties of the effort check in a static hold: its verdicts, their limits, and their time."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import JointFriction, make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.monitoring.gravity_check import (
    GravityCheck,
    GravityVerdict,
    verdict_in_words,
)
from robot_dynamics.planar.urdf import default_arm_urdf

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
Q, ZERO = np.array([0.8, 0.5]), np.zeros(2)
CONTINUOUS = np.array([True, False])
G = np.array([-50.0, 10.0])
PERIOD_NS = 5_000_000
GRAVITY, LACKS = ('gravity',), 'joint_torque_without_gravity'
STILL, POSE = 'waiting for the arm to stand still for 0.5 s', 'cannot decide in this pose: '


def make_check(
    semantics: EffortConvention | None = None, friction: JointFriction | None = None,
    actuators: Any = None,
) -> GravityCheck:
    return GravityCheck(
        semantics or EffortConvention(), friction or make_friction(NAMES), actuators, CONTINUOUS)


def hold(
    check: GravityCheck, effort: Any, command: Any, seconds: float = 0.6, *, start: float = 10.0,
    q: Any = Q, g: Any = G, noise: float = 0.0,
) -> GravityVerdict | None:
    """Return the verdict on a constant hold, 200 states per second."""
    random = np.random.default_rng(1)
    for k in range(round(seconds * 200)):
        verdict = check.add(
            round(start * 1e9) + k * PERIOD_NS, np.array(q),
            np.array(effort) + noise * random.standard_normal(2),
            None if command is None else np.array(command), np.array(g))
        if verdict is not None:
            return verdict
    return None


def verdict_of(*arguments: Any, **options: Any) -> GravityVerdict:
    verdict = hold(*arguments, **options)
    assert verdict is not None
    return verdict


# --- the measured share --------------------------------------------------------------------------

@pytest.mark.parametrize('ratio', [-1.0, -0.51, -0.49, 0.0, 0.49, 0.51, 1.7])
def test_the_ratio_of_gravity_is_exact(ratio):
    command = G + [3.0, -2.0]
    verdict = verdict_of(make_check(), command + ratio * G, command, seconds=4.0)
    assert verdict.ratio == pytest.approx(ratio, abs=1e-12)
    assert verdict.measured == pytest.approx(command + ratio * G)
    assert verdict.command == pytest.approx(command)
    assert verdict.gravity == pytest.approx(G)
    assert verdict.used.all()
    assert verdict.agrees == (abs(ratio) <= 0.5)


@pytest.mark.parametrize(('semantics', 'effort', 'command', 'agrees'), [
    (EffortConvention(), G, G, True),
    (EffortConvention(), G, None, False),  # another controller must hold the arm
    (EffortConvention(), 2 * G, G, False),
    (EffortConvention(robot_compensates=GRAVITY), G, None, True),
    (EffortConvention(robot_compensates=GRAVITY), G, ZERO, True),
    (EffortConvention(robot_compensates=GRAVITY), G, G, False),  # the robot does not compensate
    (EffortConvention(LACKS), ZERO, G, True),
    (EffortConvention(LACKS), G, G, False),  # the measured effort contains gravity
    (EffortConvention(LACKS, GRAVITY), ZERO, ZERO, True),
    (EffortConvention(LACKS, GRAVITY), ZERO, None, True),
    (EffortConvention(), ZERO, G, False),
    (EffortConvention(robot_compensates=GRAVITY), ZERO, ZERO, False),
])
def test_what_was_declared_agrees_or_not(semantics, effort, command, agrees):
    assert verdict_of(make_check(semantics), effort, command, seconds=4.0).agrees == agrees


@pytest.mark.parametrize(('efficiency', 'tolerance'), [(1.0, 0.5), (0.9, 0.611), (0.6, 0.75)])
def test_currents_are_converted_and_gears_widen_the_tolerance(efficiency, tolerance):
    actuators = make_actuators(NAMES, [0.1, 0.05], [100.0, -50.0], efficiency=[efficiency])
    current = G / (np.array([0.1, 0.05]) * [100.0, -50.0])
    check = make_check(EffortConvention('motor_current'), actuators=actuators)
    verdict = verdict_of(check, 2.0 * current, G)
    assert verdict.ratio == pytest.approx(1.0)
    assert verdict.measured == pytest.approx(2.0 * G)
    assert verdict.tolerance == pytest.approx(tolerance, abs=1e-3)
    assert not verdict.agrees


@pytest.mark.parametrize(('joint', 'decides'), [(0, True), (1, False)])
def test_a_continuous_joint_rests_where_its_position_wraps(joint, decides):
    """Noise makes a position alternate between π and −π; for other joints this is motion."""
    random, check, verdict = np.random.default_rng(2), make_check(), None
    rest = Q.copy()
    rest[joint] = np.pi
    for k in range(200):
        q = rest + 1e-4 * random.standard_normal(2)
        q[joint] = wrap_to_pi(q[joint])
        found = check.add(k * PERIOD_NS, q, 2.0 * G, G, G)
        verdict = verdict or found
    assert (verdict is not None) == decides
    if verdict is not None:
        assert verdict.ratio == pytest.approx(1.0)


# --- friction and noise --------------------------------------------------------------------------

@pytest.mark.parametrize('sign', [[1, 1], [1, -1]])
@pytest.mark.parametrize('load', [0.0, 1 / 3])
def test_known_friction_and_a_load_raise_no_alarm_and_hide_none(sign, load):
    friction = make_friction(NAMES, [0.0], [12.0, 2.4])
    held = np.array(sign) * friction.static
    alone = verdict_of(make_check(friction=friction), (1.0 + load) * G + held, G)
    assert alone.agrees
    assert 0.5 < alone.tolerance <= 0.75
    assert not verdict_of(make_check(friction=friction), (2.0 + load) * G + abs(held), G).agrees
    assert not verdict_of(make_check(friction=friction), 2.0 * G + held * np.sign(-G), G).agrees


@pytest.mark.parametrize(('friction', 'is_used'), [(2.4, True), (2.6, False)])
def test_a_joint_is_used_if_its_gravity_is_four_times_its_friction(friction, is_used):
    check = make_check(friction=make_friction(NAMES, [0.0], [1.0, friction]))
    verdict = verdict_of(check, G + [0.0, 4.0], G)
    assert verdict.used.tolist() == [True, is_used]
    assert (verdict.ratio == pytest.approx(0.0)) != is_used


@pytest.mark.parametrize(('g', 'decides'), [
    ([0.0, 0.0], False), ([0.05, -0.09], False), ([0.05, -0.11], True)])
def test_in_a_pose_without_gravity_it_does_not_decide(g, decides):
    check = make_check()
    verdict = hold(check, g, g, 3.0, g=g)
    assert (verdict is not None) == decides
    assert decides or check.waiting.startswith(POSE)
    assert verdict_of(check, G, G, start=20.0).agrees  # a better hold follows


def test_noise_is_averaged_and_hides_a_small_load():
    verdict = verdict_of(make_check(), 2.0 * G, G, noise=1.0)
    assert verdict.ratio == pytest.approx(1.0, abs=0.02)
    check = make_check()
    assert hold(check, G, G, 3.0, noise=30.0) is None
    assert check.waiting.startswith((POSE, STILL))


# --- the time of the check -----------------------------------------------------------------------

def test_it_takes_half_a_second_and_twenty_states():
    check = make_check()
    assert hold(check, G, G, 0.495) is None
    assert verdict_of(make_check(), G, G, 0.51).agrees
    for period_ms, verdicts in ((100, 1), (245, 1), (255, 0)):  # a gap above 0.25 s restarts
        slow = make_check()
        found = [slow.add(k * period_ms * 1_000_000, Q, G, G, G) for k in range(20)]
        assert [verdict is None for verdict in found] == [True] * 19 + [not verdicts]


@pytest.mark.parametrize('moves', [
    {'q': [0.8, 0.5026]}, {'start': 5.0}, {'command': None}])
def test_motion_a_new_command_or_a_step_back_in_time_restarts(moves):
    check, changed = make_check(), {'command': G, 'start': 10.4, **moves}
    command = changed.pop('command')
    assert hold(check, G, G, 0.4) is None
    assert hold(check, G, command, 0.4, **changed) is None
    assert hold(check, G, G, 0.4, start=10.8) is None


def test_slow_motion_is_rest():
    check = make_check()
    assert hold(check, G, G, 0.4) is None
    assert verdict_of(check, G, G, 0.2, start=10.4, q=[0.8, 0.5024]).agrees


def test_a_step_within_the_window_is_not_averaged():
    """Brakes open, and the effort steps from 0 to the holding effort: no verdict on the mean."""
    check = make_check()
    assert hold(check, ZERO, G, 0.25) is None
    assert hold(check, G, G, 0.27, start=10.25) is None
    assert check.waiting == STILL
    assert verdict_of(check, G, G, start=10.6).agrees
    for step, decides in ((0.2, True), (0.3, False)):
        check = make_check()
        assert hold(check, (1.0 - step) * G, G, 0.25) is None
        assert (hold(check, G, G, 0.27, start=10.25) is not None) == decides


def test_late_efforts_in_a_window_are_ignored():
    """The first states of a hold report the effort before the first command."""
    check = make_check()
    assert hold(check, ZERO, G, 0.1) is None
    verdict = verdict_of(check, G, G, start=10.1)
    assert verdict.ratio == 0.0
    assert verdict.measured.tolist() == G.tolist()


# --- brakes and missing efforts ------------------------------------------------------------------

def test_an_arm_on_its_brakes_without_a_command_gives_no_verdict():
    for semantics in (EffortConvention(), EffortConvention(robot_compensates=GRAVITY)):
        check = make_check(semantics)
        assert hold(check, 0.24 * G, None, 4.0) is None
        assert check.waiting.startswith('cannot decide: the measured effort does not carry the')
    assert verdict_of(make_check(EffortConvention()), 0.26 * G, None).ratio == pytest.approx(0.26)


def test_under_a_command_brakes_get_three_seconds():
    check = make_check()
    assert hold(check, ZERO, G, 2.9) is None
    assert verdict_of(check, G, G, start=12.9, seconds=2.0).agrees
    assert verdict_of(make_check(), ZERO, G, 3.6).ratio == pytest.approx(-1.0)


def test_joints_without_a_measurement_are_left_out():
    nan = float('nan')
    verdict = verdict_of(make_check(), [2.0 * G[0], nan], G)
    assert verdict.used.tolist() == [True, False]
    assert verdict.ratio == pytest.approx(1.0)
    check = make_check()
    assert hold(check, [nan, nan], G, 3.0) is None
    assert check.waiting == 'no measured effort'


# --- texts ---------------------------------------------------------------------------------------

@pytest.mark.parametrize(('semantics', 'effort', 'words'), [
    (EffortConvention(), 2.0 * G, ['1.00 times', 'expected 0', 'robot_compensates: [gravity]']),
    (EffortConvention(), ZERO, [
        '-1.00 times', 'measured_effort: joint_torque_without_gravity', 'brakes carry the arm',
        'measured_effort: none']),
    (EffortConvention(LACKS), G, [
        '0.00 times', 'expected -1', 'set measured_effort: joint_torque;']),
    (EffortConvention(robot_compensates=GRAVITY), G, [
        'expected 1', "robot_compensates ['gravity']", 'remove it from robot_compensates']),
])
def test_a_warning_has_the_numbers_and_the_parameter(semantics, effort, words):
    line = verdict_in_words(
        verdict_of(make_check(semantics), effort, G, seconds=4.0), NAMES, semantics)
    expected = [*words, f'joint1: measured {effort[0]:.3f}, command -50.000, g(q) -50.000',
                f'joint2: measured {effort[1]:.3f}, command 10.000, g(q) 10.000']
    for part in expected:
        assert part in line
    assert '\n' not in line


DRIVE = make_effort_calibration(NAMES, [0.4, 2.5], [8.0, -4.0], ARM.limits.effort)


def test_another_controller_of_such_drives_is_found():
    check = GravityCheck(
        EffortConvention(), make_friction(NAMES), None, CONTINUOUS, DRIVE, DRIVE)
    verdict = verdict_of(check, DRIVE.effort(G), None)
    assert verdict.ratio == pytest.approx(1.0, abs=1e-12)
    assert verdict.measured == pytest.approx(G)
    assert verdict.command.tolist() == [0.0, 0.0]
