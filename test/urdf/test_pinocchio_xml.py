# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The URDF for Pinocchio contains the values that the parser checked, and no limits."""

import numpy.testing as npt
from one_joint_urdf import INERTIA, INERTIAL, link_of, mimics
import pinocchio as pin
import pytest
from robot_dynamics.urdf.parser import parse_urdf
from robots import robot_urdf


def pinocchio_inertia(xml):
    return pin.buildModelFromXML(parse_urdf(xml).pinocchio_xml).inertias[1]


@pytest.mark.parametrize(('plain', 'unusual'), [
    ('value="1.5"', 'value="\t+15e-1 "'), ('ixx="1"', 'ixx="1\n"'),
    ('xyz="0.1 0.2 0.3"', 'xyz="  0.1\t0.2\n.3 "'), ('rpy="0 0 1"', 'rpy="0\n0\n1"'),
])
def test_numbers_with_unusual_space_reach_pinocchio(plain, unusual):
    # The parser of Pinocchio would silently ignore the whole inertia of the link.
    xml = link_of(
        '<inertial><origin xyz="0.1 0.2 0.3" rpy="0 0 1"/><mass value="1.5"/>'
        f'{INERTIA}</inertial>')
    assert plain in xml
    ours, expected = pinocchio_inertia(xml.replace(plain, unusual)), pinocchio_inertia(xml)
    assert ours.mass == expected.mass == 1.5
    npt.assert_array_equal(ours.lever, expected.lever)
    npt.assert_array_equal(ours.inertia, expected.inertia)


def test_pinocchio_sees_no_limits_no_mimics_and_one_coordinate_per_joint():
    second = '<inertial><mass value="heavy"/></inertial>'  # only the first one was checked
    assert pinocchio_inertia(link_of(INERTIAL + second)).mass == 1.5
    parsed = parse_urdf(mimics('<mimic joint="turn" multiplier="2"/>', kind='continuous'))
    model = pin.buildModelFromXML(parsed.pinocchio_xml)
    assert (model.nq, model.nv) == (2, 2)
    assert 'mimic' not in parsed.pinocchio_xml
    assert (model.upperPositionLimit > 1e29).all()
    assert (model.lowerPositionLimit < -1e29).all()


@pytest.mark.parametrize('name', [
    'ur5', 'panda', 'talos_left_arm', 'tiago_no_hand', 'talos_full_v2', 'pr2'])
def test_pinocchio_reads_the_same_bodies_from_real_robots(name):
    urdf = robot_urdf(name)
    ours = pin.buildModelFromXML(parse_urdf(urdf).pinocchio_xml)
    plain = pin.buildModelFromXML(urdf)
    assert list(ours.names) == list(plain.names)
    for joint, other in zip(ours.inertias, plain.inertias):
        npt.assert_allclose(joint.toDynamicParameters(), other.toDynamicParameters(), rtol=0)
    for placement, other in zip(ours.jointPlacements, plain.jointPlacements):
        npt.assert_array_equal(placement.homogeneous, other.homogeneous)
