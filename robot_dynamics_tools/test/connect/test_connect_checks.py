# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of description and joint states, without a robot."""

import io
import sys
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from robot_dynamics.model.arm import arm_from_urdf, load_arm
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.description_file import read_description_file
from robot_dynamics_tools.connect.checks import Checklist
from robot_dynamics_tools.connect.description import checked_arm
from robot_dynamics_tools.connect.probe import drive_settings
from robot_dynamics_tools.connect.states import check_units
from robot_dynamics_tools.recordings.joint_series import JointSeries

PANDA = read_description_file('panda', 'urdf')
ARM_OF_PANDA = [f'panda_joint{k}' for k in range(1, 8)]
UNLIMITED = default_arm_urdf().replace('effort="60"', 'effort="0"').replace(
    'effort="60.0"', 'effort="0"')


def checked(
    urdf: str, joints: Any, published: Any, may_ask: bool = False,
    given: Any = MappingProxyType({}), **limits: Any,
) -> tuple[Any, Checklist]:
    checks = Checklist()
    found = checked_arm(urdf, 'a file', joints, published, given, limits, may_ask, checks)
    return found, checks


def test_a_missing_effort_limit_is_never_no_bound():
    _, checks = checked(UNLIMITED, [], ['joint1', 'joint2'])
    assert [check.text.partition(' (')[0] for check in checks.bad] == [
        'missing or 0: effort of joint2']
    (urdf, _), checks = checked(UNLIMITED, [], ['joint1', 'joint2'], joint2=['3.0', '40.0'])
    assert not checks.bad
    assert arm_from_urdf(urdf).limits.effort.tolist() == [150.0, 40.0]


def test_the_model_has_the_parameters_of_the_file():
    (_, arm), checks = checked(UNLIMITED, [], ['joint1', 'joint2'], given={
        'joints': ['joint1', 'joint2'], 'effort.limit': [100.0, 30.0],
        'friction.coulomb': [4.0, 1.5], 'payload.links': ['tool0'], 'payload.mass': [2.0]})
    assert not checks.bad
    assert arm.limits.effort.tolist() == [100.0, 30.0]
    assert arm.friction.coulomb.tolist() == [4.0, 1.5]
    assert arm.payloads[0].mass == 2.0


@pytest.mark.parametrize(('typed', 'bad'), [('40\n', []), ('\n', ['limits']), ('', ['limits'])])
def test_a_missing_limit_is_asked_for(monkeypatch, capsys, typed, bad):
    monkeypatch.setattr(sys, 'stdin', io.StringIO(typed))
    (urdf, _), checks = checked(UNLIMITED, [], ['joint1', 'joint2'], may_ask=True)
    assert 'effort limit of joint2 [SI units, from the data sheet;' in capsys.readouterr().out
    assert [check.name for check in checks.bad] == bad
    assert arm_from_urdf(urdf).limits.effort[1] == (np.inf if bad else 40.0)


def test_a_gripper_is_not_part_of_the_arm_unasked():
    fingers = ['panda_finger_joint1', 'panda_finger_joint2']
    (_, arm), checks = checked(PANDA, ARM_OF_PANDA, [*ARM_OF_PANDA, *fingers])
    assert list(arm.joint_names) == ARM_OF_PANDA
    assert not checks.bad
    _, checks = checked(PANDA, [], [*ARM_OF_PANDA, *fingers])
    assert [check.text.partition(' (')[0] for check in checks.bad] == [
        'panda_finger_joint1 may be a gripper']


def test_joints_of_another_robot_are_named_with_those_expected():
    (_, arm), checks = checked(default_arm_urdf(), [], ['a', 'b'])
    assert arm is None
    assert checks.bad[0].text.startswith('none; not published: joint1, joint2; ignored: a, b')


def series(
    factor: float, velocity_factor: float = 1.0, seconds: float = 8.0, start: float = 0.0,
) -> JointSeries:
    """Return a motion from `start`, whose positions and velocities are multiplied."""
    times = np.arange(0.0, seconds, 0.01)
    q, v = np.sin(times), np.cos(times)
    return JointSeries(
        ('joint1', 'joint2'), np.array(1e9 * times, dtype=np.int64),
        start + factor * np.stack([q, 0.5 * q], axis=1),
        velocity_factor * np.stack([v, 0.5 * v], axis=1), None, 0)


@pytest.mark.parametrize(('motion', 'known', 'name', 'grade', 'said'), [
    ((1.0, 1.0), '', 'velocity', Grade.GOOD, 'the derivative of the position'),
    ((57.2958, 1.0), '', 'units', Grade.BAD, 'position in degrees'),
    ((57.2958, 57.2958), '', 'units', Grade.BAD, 'more than a turn, as in degrees: joint1'),
    ((1.0, 1.0, 0.005), '', 'units', Grade.UNKNOWN, 'not known: no motion yet'),
    ((1.0, 1.0, 0.005, 45.0), 'stated', 'units', Grade.GOOD, 'stated'),
    ((1.0, -1.0), '', 'velocity', Grade.CHECK, 'not the derivative of the position at joint1'),
])
def test_units_are_named(motion, known, name, grade, said):
    checks = Checklist()
    check_units(series(*motion), load_arm(default_arm_urdf()), known, checks)
    check, = (one for one in checks if one.name == name)
    assert check.grade is grade
    assert said in check.text


@pytest.mark.parametrize(('verdict', 'failure', 'key', 'value'), [
    ('agrees; a sentence', '', 'command', 'computed_torque'),
    ('agrees; a sentence', 'the motion ended early', 'command', 'none'),
    ('reversed; a sentence', '', 'effort.command_scale', [-2.0, 2.0]),
    ('command scale -1.09', "wrong_drive: 'joint1'", 'effort.command_scale', [-2.0, 2.0]),
    ('report scale 0.5; a sentence', '', 'effort.report_scale', [2.0, 1.0]),
    ('unclear: report scale 0.5 or command scale 2', '', 'effort.report_scale', [2.0, 1.0]),
    ('adds gravity; a sentence', '', 'robot_compensates', ['gravity']),
    ('gravity tilted by 90; a gravity of [9.8, 0.0, 0.1] m/s²', '', 'gravity', [9.81, 0.0, 0.1])])
def test_a_drive_changes_its_parameter(verdict, failure, key, value):
    other = 'command scale 2.5; of a stop' if 'wrong' in failure else 'agrees; a sentence'
    found = drive_settings(
        load_arm(default_arm_urdf()), {'joint1': verdict, 'joint2': other},
        np.array([1.0, np.nan]), {'effort.command_scale': ([2.0], 'given')}, failure, Checklist())
    assert found[key][0] == value
