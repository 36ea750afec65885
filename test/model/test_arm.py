# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The public interface of an arm: joints by name, limits, friction, links, and rejections."""

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import arm_from_urdf, load_arm
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.planar.urdf import default_arm_urdf

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>'
    '<inertia ixx="0.2" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>')


def arm_urdf():
    """
    Return a chain with joints of each kind.

    `roll` and `slide` are free, the range of `far` excludes 0, `echo` follows `roll` through
    `mirror`, and `shadow` follows `far`.
    """
    links = ''.join(f'<link name="l{i}">{INERTIAL}</link>' for i in range(8))
    joints = (
        ('slide', 'prismatic', '<limit lower="-0.2" upper="0.4" effort="80" velocity="0.5"/>'
                               '<dynamics damping="5" friction="2"/>'),
        ('roll', 'continuous', '<limit effort="30" velocity="3"/>'
                               '<dynamics damping="0.5" friction="0.25"/>'),
        ('far', 'revolute', '<limit lower="0.5" upper="2" effort="0" velocity="0"/>'),
        ('plate', 'fixed', ''),
        ('mirror', 'revolute', '<limit lower="-3" upper="3"/><dynamics damping="1" friction="1"/>'
                               '<mimic joint="roll" multiplier="-2" offset="0.1"/>'),
        ('echo', 'revolute', '<limit lower="-3" upper="3"/><dynamics damping="1" friction="1"/>'
                             '<mimic joint="mirror" multiplier="3" offset="-0.2"/>'),
        ('shadow', 'revolute', '<limit lower="-3" upper="3"/>'
                               '<mimic joint="far" multiplier="0.5" offset="0.25"/>'),
    )
    text = ''.join(
        f'<joint name="{name}" type="{kind}"><origin xyz="0.1 0.2 0.3" rpy="0.1 {i} 0"/>'
        f'<parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="0 1 1"/>{rest}</joint>'
        for i, (name, kind, rest) in enumerate(joints))
    return f'<robot name="kinds">{links}{text}</robot>'


# --- joints by name ------------------------------------------------------------------------------

def test_joints_are_in_the_order_of_the_document():
    arm = load_arm(arm_urdf())
    assert arm.name == 'kinds'
    assert arm.joint_names == ('slide', 'roll', 'far')
    assert arm.joint_kinds == ('prismatic', 'continuous', 'revolute')
    assert arm.joint_count == 3
    assert arm.link_names == tuple(f'l{i}' for i in range(8))
    assert arm.locked_joints == {}
    assert arm.payloads == ()


def test_limits_by_joint():
    limits = load_arm(arm_urdf()).limits
    inf = np.inf
    npt.assert_array_equal(limits.lower, [-0.2, -inf, 0.5])
    npt.assert_array_equal(limits.upper, [0.4, inf, 2.0])
    # Exporters write a velocity or effort limit of 0 for "not known".
    npt.assert_array_equal(limits.velocity, [0.5, 3.0, inf])
    npt.assert_array_equal(limits.effort, [80.0, 30.0, inf])


@pytest.mark.parametrize('limit', ['', 'lower="-0" upper="0"'])
def test_a_joint_that_may_not_leave_zero_counts_as_fixed_unless_it_is_named(limit):
    urdf = arm_urdf().replace('lower="0.5" upper="2"', limit)
    with pytest.raises(ModelError, match=(
            "^robot_description: joint 'far' is revolute with lower=0 and upper=0, expected a "
            r'range \(lower below upper\), or other names in joints$')):
        load_arm(urdf, ['slide', 'far'])
    arm = load_arm(urdf)
    assert 'far' not in arm.joint_names
    assert arm.locked_joints == {'far': 0.0}


def test_joints_left_out_are_locked_as_near_to_zero_as_they_may_be():
    assert load_arm(arm_urdf(), ['roll']).locked_joints == {'slide': 0.0, 'far': 0.5}
    below = arm_urdf().replace('lower="0.5" upper="2"', 'lower="-2" upper="-0.5"')
    assert load_arm(below, ['roll']).locked_joints == {'slide': 0.0, 'far': -0.5}


# --- friction ------------------------------------------------------------------------------------

def test_friction_of_mimic_joints_is_felt_at_their_leader():
    arm = load_arm(arm_urdf())
    # By power: damping with the square of the speed, Coulomb friction with its magnitude.
    npt.assert_allclose(arm.friction.viscous, [5.0, 0.5 + 4.0 * 1.0 + 36.0 * 1.0, 0.0])
    npt.assert_allclose(arm.friction.coulomb, [2.0, 0.25 + 2.0 * 1.0 + 6.0 * 1.0, 0.0])


# --- gravity, links, immutability ----------------------------------------------------------------

def test_gravity_is_that_of_the_earth_by_default():
    npt.assert_array_equal(load_arm(arm_urdf()).pinocchio_model.gravity.linear, [0, 0, -9.81])
    moon = load_arm(arm_urdf(), gravity=(0.1, 0.2, -1.6))
    npt.assert_array_equal(moon.with_payloads([]).pinocchio_model.gravity.linear, [0.1, 0.2, -1.6])


# --- rejections ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('more', 'message'), [
    ({'joints': ['roll', 'wrist']},
     "joints has 'wrist', expected joints out of ['slide', 'roll', 'far']"),
    ({'joints': ['mirror']},
     "joints has 'mirror', expected joints out of ['slide', 'roll', 'far']"),
    ({'joints': ['roll', 'roll']}, "joints has 'roll' twice, expected each name once"),
    ({'gravity': (0, -9.81)},
     "gravity has 2 values, expected 3, one for each of ['x', 'y', 'z']"),
    ({'gravity': (0, 0, np.nan)}, 'gravity[2] (z) is nan, expected a finite number'),
])
def test_message_on_arguments(more, message):
    with pytest.raises(InvalidInputError) as caught:
        load_arm(arm_urdf(), **more)
    assert str(caught.value) == message


def test_what_cannot_move_is_no_arm():
    with pytest.raises(ModelError) as caught:
        load_arm('<robot name="statue"><link name="a"/></robot>')
    assert str(caught.value) == (
        "robot_description: robot 'statue' has no joint that moves, expected at least one "
        'revolute, continuous or prismatic joint')


@pytest.mark.parametrize('given', [str, Path, lambda path: f'file://{path}'])
def test_a_path_is_read(tmp_path, given):
    path = tmp_path / 'two link arm.urdf'
    path.write_text(default_arm_urdf(), encoding='utf-8')
    arm = load_arm(given(path), ['joint2'], (0.0, 0.0, -1.62))
    assert (arm.joint_names, arm.gravity.tolist()) == (('joint2',), [0.0, 0.0, -1.62])


@pytest.mark.parametrize('given', [
    Path('arm.urdf'), '', '/', 'no URDF', 'x' * 5000, 'nul\0', 'file:///no/arm.urdf'])
def test_a_path_without_a_file_gets_one_clear_error(given):
    with pytest.raises(ModelError, match='which is no file, expected the path of a URDF or xac'):
        load_arm(given)


def test_a_description_from_outside_is_never_a_path(tmp_path):
    path = tmp_path / 'arm.urdf'
    path.write_text(default_arm_urdf(), encoding='utf-8')
    for load in (arm_from_urdf, lambda text: arm_from_parameters(text, {}), check_model):
        with pytest.raises(ModelError, match='not well-formed XML'):
            load(str(path))
