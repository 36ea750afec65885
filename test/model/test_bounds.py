# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Numbers beyond those of any arm are rejected by name at the interface, before any overflow.

A warning of numpy is a failure here: it indicates a number that the code did not check.
"""

import re

import numpy as np
from one_joint_arm import arm_of, inertial
import pytest
from robot_dynamics.exceptions import InvalidInputError, ModelError, TrajectoryError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.joint_order import JointOrder
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.validation import check_samples, check_vector

pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
LARGEST_VALUE = 1e9
"""Largest number of a motion, in SI units."""
BEYOND = 1.0001e9


# --- numbers of a motion -------------------------------------------------------------------------

def test_the_largest_value_passes_and_what_is_beyond_is_refused_by_name():
    assert check_vector('position', [LARGEST_VALUE, -LARGEST_VALUE], 2, NAMES, LARGEST_VALUE).all()
    with pytest.raises(InvalidInputError) as caught:
        check_vector('position', [0.0, -2e9], 2, NAMES, LARGEST_VALUE)
    assert str(caught.value) == (
        'position[1] (joint2) is -2e+09, expected a number in [-1e+09, 1e+09]')
    with pytest.raises(InvalidInputError, match=r'position\[1\]\[0\] \(joint1\) is 1e\+300, exp'):
        check_samples('position', [0.0, 0.0, 1e300, 0.0], 2, NAMES, LARGEST_VALUE)


@pytest.mark.parametrize('ask', [
    lambda order, value: order.position(value),
    lambda order, value: order.positions(value),
    lambda order, value: order.rate(value, 'position'),
    lambda order, value: order.rates(value, 1, 'position'),
    lambda order, value: order.effort(value, 'position'),
])
def test_every_number_of_a_request_is_bounded(ask):
    order = JointOrder(ARM)
    assert np.ravel(ask(order, [LARGEST_VALUE, 0.0])).tolist() == [LARGEST_VALUE, 0.0]
    with pytest.raises(InvalidInputError, match=r'position.*\(joint1\) is 1.0001e\+09, expected'):
        ask(order, [BEYOND, 0.0])


@pytest.mark.parametrize('rounded', [-1e-310, -0.9e-6])
def test_a_moment_that_rounding_left_below_zero_is_a_load_all_the_same(rounded):
    flat = np.diag([rounded, 1.0, 1.0])
    loaded = ARM.with_payloads([make_payload('tool0', 1.0, inertia=flat)])
    plain = ARM.with_payloads([make_payload('tool0', 1.0, inertia=np.diag([0.0, 1.0, 1.0]))])
    for ours, theirs in zip(loaded.pinocchio_model.inertias, plain.pinocchio_model.inertias):
        assert ours.inertia.tolist() == theirs.inertia.tolist()


# --- parameters ----------------------------------------------------------------------------------

@pytest.mark.parametrize('field', ['torque_constant', 'gear_ratio', 'current_time_constant'])
def test_what_divides_is_not_almost_zero(field):
    motor = {'torque_constant': [0.1], 'gear_ratio': [100.0]}
    make_actuators(NAMES, **{**motor, field: [1e-12]})
    with pytest.raises(InvalidInputError, match=rf"actuator\.{field} of 'joint1' is 9e-13, exp"):
        make_actuators(NAMES, **{**motor, field: [9e-13]})
    with pytest.raises(InvalidInputError, match=rf'actuator\.{field}\[0\] is 1e\+300, expected'):
        make_actuators(NAMES, **{**motor, field: [1e300]})


# --- descriptions --------------------------------------------------------------------------------

@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('<mass value="5.0"', '<mass value="1e200"', "link 'link1': inertial: mass=1e+200, expected"),
    ('ixx="0.1', 'ixx="1e308', "link 'link1': inertial: ixx=1e+308, expected at most 1e+09 in"),
    ('<axis xyz="0 1 0"', '<axis xyz="0 1e-200 0"', "joint 'joint1': axis is zero, expected a"),
    ('damping="0.0"', 'damping="1e300"', "joint 'joint1': damping=1e+300, expected at most"),
])
def test_numbers_of_a_description_are_bounded(old, new, words):
    urdf = default_arm_urdf()
    assert old in urdf
    with pytest.raises(ModelError, match=re.escape(words)):
        load_arm(urdf.replace(old, new, 1))


def slide(limit: str) -> str:
    return arm_of(
        inertial(moments=(1, 1, 1)), f'<limit {limit}/>', 'prismatic', axis='0 0 1', geometry='')


def limits_of(limit: str) -> list[float]:
    limits = load_arm(slide(limit)).limits
    return [float(values[0]) for values in (
        limits.lower, limits.upper, limits.velocity, limits.effort)]


def test_a_limit_beyond_any_arm_is_none():
    unlimited = [-np.inf, np.inf, np.inf, np.inf]
    assert limits_of('lower="-1e308" upper="1e10" velocity="1e30" effort="1e10"') == unlimited
    assert limits_of('lower="-inf" upper="inf" velocity="1e-320" effort="0"') == unlimited
    assert limits_of('lower="-1e9" upper="1e9" velocity="1e9" effort="1e9"') == [
        -1e9, 1e9, 1e9, 1e9]
    with pytest.raises(ModelError, match=r'lower=1e\+10, upper=1e\+11, expected a range that'):
        load_arm(slide('lower="1e10" upper="1e11"'))


def test_the_model_check_looks_no_further_than_an_arm_can_reach():
    findings = check_model(slide('lower="-1" upper="1e308" velocity="1" effort="100"'))
    assert [finding.check for finding in findings] == ['limits']


def test_a_chain_of_mimic_joints_multiplies_up_to_a_number():
    links = ''.join(f'<link name="l{i}"/>' for i in range(9))
    joints = ''.join(
        f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
        + (f'<mimic joint="j{i - 1}" multiplier="1e6"/>' if i else '') + '</joint>'
        for i in range(8))
    with pytest.raises(ModelError, match=r"joint 'j2': mimic chain: multiplier=1e\+12, expected"):
        load_arm(f'<robot name="r">{links}{joints}</robot>')


# --- messages ------------------------------------------------------------------------------------

def test_a_long_message_keeps_its_start_and_end():
    with pytest.raises(TrajectoryError) as caught:
        raise TrajectoryError(f'joint_names has {"x" * 10**6!r}, expected only joints of this arm')
    message = str(caught.value)
    assert len(message) <= 1600
    assert str(TrajectoryError('x' * 1600)) == 'x' * 1600
    assert message.startswith("joint_names has 'xxx")
    assert message.endswith("xxx', expected only joints of this arm")
    left_out = re.search(r'… \((\d+) characters left out\) …', message)
    original = f'joint_names has {"x" * 10**6!r}, expected only joints of this arm'
    assert int(left_out[1]) == len(original) - (len(message) - len(left_out[0]) - 2)
