# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The check `rotors`: effort limits that no drive could turn into acceleration."""

from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.rotor_check import check_rotors
from robots import robot_urdf

HINGE = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="{kind}"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" effort="{effort}" velocity="2"/></joint></robot>"""
WRISTS = {
    'ur10': ['wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'], 'ur5': [],
    'z1': ['joint6', 'jointGripper']}


def named(urdf, arm=None):
    return [finding.where for finding in check_model(urdf, arm) if finding.check == 'rotors']


@pytest.mark.parametrize('robot', WRISTS)
def test_the_wrists_of_robots_without_rotors_are_named(robot):
    assert named(robot_urdf(robot)) == WRISTS[robot]


def test_a_mimic_joint_counts_at_its_leader():
    """It has no effort limit of its own; on the panda, no joint is named."""
    assert named(robot_urdf('panda')) == []


def test_the_message_has_both_figures_and_their_ratio():
    finding, = (f for f in check_model(HINGE.format(kind='revolute', effort=40))
                if f.check == 'rotors')
    assert (finding.level, finding.where) == ('warning', 'hinge')
    assert finding.message == (
        "effort limit of joint 'hinge', 40 N·m, divided by its smallest inertia M_jj, "
        '0.01 kg·m², is 4e+03 rad/s², expected at most 2500: no drive with a gearbox '
        'accelerates so; set the reflected inertia of the rotor with actuator.reflected_inertia '
        '(data sheet, or ros2 dynamics identify)')


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.floats(0.0, 0.1), st.floats(1.0, 500.0))
def test_a_rotor_that_is_known_counts(rotor, effort):
    """The bound is on the effort limit divided by the inertia of link and rotor."""
    urdf = HINGE.format(kind='continuous', effort=effort)
    arm = load_arm(urdf).with_reflected_inertia([rotor])
    is_named = effort > 2500.0 * (0.01 + rotor)
    findings = list(check_rotors(arm, 0.01 + arm.reflected_inertia))
    assert named(urdf, arm) == ['hinge'] * len(findings) == ['hinge'] * is_named
    if is_named and rotor:
        assert 'check actuator.reflected_inertia' in findings[0].message


def test_joints_without_limit_or_mass_and_slides_are_skipped():
    for kind, effort in (('revolute', 0), ('prismatic', 1e6)):
        assert named(HINGE.format(kind=kind, effort=effort)) == []
    massless = HINGE.format(kind='revolute', effort=40).replace('izz="0.01"', 'izz="0"')
    assert {f.check for f in check_model(massless) if f.level == 'error'} == {'inertia'}
    assert named(massless) == []
