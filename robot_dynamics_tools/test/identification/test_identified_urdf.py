# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The identified URDF: its model is the identified one; elements that are replaced in a URDF."""

from identification_bench import changed_arm
import numpy as np
import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.regressor import inertial_parameters
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.inertials import read_bodies
from robot_dynamics_tools.identification.identified_arm import identified_urdf, kept_fractions
from robot_dynamics_tools.urdf_editing import with_elements
from robots import robot_urdf

PANDA_JOINTS = [f'panda_joint{i}' for i in range(1, 8)]


@pytest.mark.parametrize(('name', 'joints'), [('ur10', ()), ('panda', PANDA_JOINTS)])
def test_the_written_arm_is_the_identified_one(name, joints):
    urdf = robot_urdf(name)
    arm = load_arm(urdf, joints)
    phi = inertial_parameters(changed_arm(arm, 0.2))
    n = arm.joint_count
    viscous, dry = np.arange(1.0, n + 1.0), 0.5 * np.arange(1.0, n + 1.0)
    found = load_arm(identified_urdf(urdf, arm, phi, viscous, dry), joints)
    assert inertial_parameters(found) == pytest.approx(phi, rel=1e-8, abs=1e-9)
    assert found.friction.viscous.tolist() == viscous.tolist()
    assert found.friction.coulomb.tolist() == dry.tolist()


def test_links_fixed_to_a_body_give_their_mass_up_where_it_does_not_fit():
    # The locked hand of the panda is now heavier than its whole last body.
    urdf, joints = robot_urdf('panda'), PANDA_JOINTS
    arm = load_arm(urdf, joints)
    phi = inertial_parameters(arm)
    phi[-10:] *= 0.1
    written = identified_urdf(urdf, arm, phi, np.zeros(7), np.zeros(7))
    found = load_arm(written, joints)
    assert inertial_parameters(found) == pytest.approx(phi, rel=1e-8, abs=1e-10)
    kept = kept_fractions(urdf, arm, phi)
    assert set(kept) == {'panda_hand', 'panda_leftfinger', 'panda_rightfinger'}
    before, after = ({body.name: body for body in read_bodies(text)} for text in (urdf, written))
    for link, fraction in kept.items():
        assert 0.0 < fraction < 1.0
        assert after[link].mass == pytest.approx(fraction * before[link].mass)
        assert after[link].inertia == pytest.approx(fraction * before[link].inertia)
    found_before, found_after = ({
        (finding.check, finding.where) for finding in check_model(text, model)
        if finding.check in ('lost_mass', 'mass')}
        for text, model in ((urdf, arm), (written, found)))
    assert found_after <= found_before
    assert kept_fractions(urdf, arm, inertial_parameters(arm)) == {}


def test_impossible_bodies_are_not_written():
    arm = load_arm(default_arm_urdf())
    phi = inertial_parameters(arm)
    phi[0] = -1.0
    with pytest.raises(ModelError, match="of the body 'link1' correspond to no mass distribution"):
        identified_urdf(default_arm_urdf(), arm, phi, np.zeros(2), np.zeros(2))
    with pytest.raises(ModelError, match='is not valid XML'):
        with_elements('<robot>', {}, {})
    with pytest.raises(ModelError, match='DTD'):
        with_elements('<!DOCTYPE robot [<!ENTITY e "x">]><robot/>', {}, {})


URDF = """<?xml version="1.0" encoding="latin-1"?>
<!-- before: <link name="a"/> -->
<robot name='x'>
  <link name="base"/><link name='a'>
    <inertial><mass value="1"/></inertial> <!-- kept -->
    <visual><geometry><sphere radius="1 > 0"/></geometry></visual>
  </link>
  <!-- <link name="a"><inertial/></link> -->
  <joint name="j" type="revolute"> <dynamics damping="1" spring="4"/> <axis xyz="0 0 1"/> </joint>
  <joint name="k" type="fixed"/>
</robot>"""


def test_only_what_is_named_changes():
    changed = with_elements(
        URDF, {'a': '<inertial>A</inertial>', 'base': '<inertial>B</inertial>'},
        {'k': {'damping': '3'}, 'j': {'damping': '2'}})
    assert changed == """<?xml version="1.0" encoding="UTF-8"?>
<!-- before: <link name="a"/> -->
<robot name="x">
  <link name="base">
    <inertial>B</inertial>
  </link><link name="a">
    <inertial>A</inertial>
     <!-- kept -->
    <visual><geometry><sphere radius="1 &gt; 0"/></geometry></visual>
  </link>
  <!-- <link name="a"><inertial/></link> -->
  <joint name="j" type="revolute"> <dynamics damping="2" spring="4"/> <axis xyz="0 0 1"/> </joint>
  <joint name="k" type="fixed">
    <dynamics damping="3"/>
  </joint>
</robot>
"""
    assert with_elements(changed, {}, {}) == changed
    assert with_elements('\ufeff' + changed.replace('UTF-8', 'utf-16'), {}, {}) == changed
