# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The density of links: volumes, bounds, and the links of real arms.

The check `rotors`: effort limits that no drive could turn into acceleration.
"""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from one_joint_arm import arm_of, inertial, LIMIT, text_stl
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.mesh_bounds import MeshReader
from robot_dynamics.model_check.rotor_check import check_rotors
from robots import robot_urdf

MOMENTS = (0.1, 0.1, 0.01)
MESH = '<visual><geometry><mesh filename="a.stl" scale="0.1 0.1 0.1"/></geometry></visual>'


def box_of(litres, kind='collision'):
    """Return a cube with this volume."""
    side = (1e-3 * litres) ** (1 / 3)
    return f'<{kind}><geometry><box size="{side} {side} {side}"/></geometry></{kind}>'


def densities(mass, geometry, **options):
    """Return the messages on the density of a link; its inertia is not part of the check."""
    found = check_model(arm_of(inertial(mass, MOMENTS), geometry=geometry), **options)
    return [f.message for f in found if f.check == 'density']


@pytest.mark.parametrize(('geometry', 'litres'), [
    ('<box size="0.2 0.3 0.1"/>', 6.0),
    ('<sphere radius="0.1"/>', 4e3 / 3 * np.pi * 0.1**3),
    ('<cylinder radius="0.1" length="0.2"/>', 1e3 * np.pi * 0.1**2 * 0.2),
    ('<capsule radius="0.1" length="0.2"/>', 1e3 * np.pi * 0.1**2 * (0.2 + 0.4 / 3)),
])
def test_the_volumes_of_shapes_are_exact(geometry, litres):
    """The mass at the bound of 4,000 kg/m³ separates a finding from none."""
    shape = f'<collision><geometry>{geometry}</geometry></collision>'
    assert densities(4.0 * litres * (1 - 1e-9), shape) == []
    assert len(densities(4.0 * litres * (1 + 1e-9), shape)) == 1


def test_the_message_on_a_density_names_link_mass_volume_and_range():
    message, = densities(42.9, box_of(8.0))
    assert message == (
        "density of link 'arm' is 5.36e+03 kg/m³: 42.9 kg in at most 8 litres of geometry, "
        'expected 30 to 4000 kg/m³; check value and unit of its <mass>, and the size and scale of '
        'its geometry')


@pytest.mark.parametrize(('mass', 'geometry', 'count'), [
    (11.9 * 0.5, box_of(0.5), 0), (12.1 * 0.5, box_of(0.5), 1),  # below 1 L lead is the bound
    (5.0, box_of(0.99), 0), (5.0, box_of(1.01), 1),
    (50.0, box_of(0.009), 0),  # a marker
    (0.0029, box_of(0.101), 1), (0.0029, box_of(0.099), 0),  # a small link weighs little
    (7.0, box_of(1.5) + box_of(1.5), 0),  # parts of one link
    (7.0, box_of(1.5) + box_of(1.8, 'visual'), 0),  # the larger volume decides
    (0.02, box_of(50.0) + box_of(0.5, 'visual'), 0),  # the smaller volume decides
    (0.02, box_of(50.0), 1),
    (0.02, box_of(50.0) + '<visual><geometry><mesh filename="a.stl"/></geometry></visual>', 0),
    (900.0, '', 0),
])
def test_densities_of_small_large_and_partly_known_links(mass, geometry, count):
    assert len(densities(mass, geometry)) == count


def test_a_mesh_counts_as_its_scaled_bounding_box(tmp_path):
    (tmp_path / 'a.stl').write_bytes(text_stl())  # scaled to 6 L
    assert densities(23.9, MESH, meshes=MeshReader(tmp_path)) == []
    assert len(densities(24.1, MESH, meshes=MeshReader(tmp_path))) == 1
    assert densities(24.1, MESH) == []


WRISTS = {
    'ur10': ['wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'], 'ur5': [],
    'z1': ['joint6', 'jointGripper']}


def hinge(kind, effort):
    return arm_of(inertial(1.0, MOMENTS), LIMIT.replace('100', str(effort)), kind, axis='0 0 1',
                  geometry='')


def named(urdf, arm=None):
    return [finding.where for finding in check_model(urdf, arm) if finding.check == 'rotors']


@pytest.mark.parametrize('robot', WRISTS)
def test_the_wrists_of_robots_without_rotors_are_named(robot):
    assert named(robot_urdf(robot)) == WRISTS[robot]


def test_a_mimic_joint_counts_at_its_leader():
    """It has no effort limit of its own; on the panda, no joint is named."""
    assert named(robot_urdf('panda')) == []


def test_the_message_has_both_figures_and_their_ratio():
    finding, = (f for f in check_model(hinge('revolute', 40)) if f.check == 'rotors')
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
    urdf = hinge('continuous', effort)
    arm = load_arm(urdf).with_reflected_inertia([rotor])
    is_named = effort > 2500.0 * (0.01 + rotor)
    findings = list(check_rotors(arm, 0.01 + arm.reflected_inertia))
    assert named(urdf, arm) == ['hinge'] * len(findings) == ['hinge'] * is_named
    if is_named and rotor:
        assert 'check actuator.reflected_inertia' in findings[0].message


def test_joints_without_limit_or_mass_and_slides_are_skipped():
    for kind, effort in (('revolute', 0), ('prismatic', 1e6)):
        assert named(hinge(kind, effort)) == []
    massless = hinge('revolute', 40).replace('izz="0.01"', 'izz="0"')
    assert {f.check for f in check_model(massless) if f.level == 'error'} == {'inertia'}
    assert named(massless) == []
