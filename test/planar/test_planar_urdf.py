# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The URDF of a planar arm, read by Pinocchio, and the tool that writes it."""

import re
from xml.etree import ElementTree

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pinocchio
from planar_chains import assert_close, random_chain, urdf_of
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar.chain import forward_kinematics, newton_euler
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.tools.planar_urdf import main

TWO = {
    'masses': [5.0, 3.0], 'lengths': [1.0, 0.8], 'com_distances': [0.5, 0.4],
    'inertias': [0.1, 0.05],
}


def model_of(urdf):
    return pinocchio.buildModelFromXML(urdf)


def unrolled(q):
    """Return q as Pinocchio stores continuous joints: cosine and sine of each."""
    return np.column_stack([np.cos(q), np.sin(q)]).ravel()


@st.composite
def motions(draw):
    n = draw(st.integers(1, 8))
    seed = draw(st.integers(0, 2**32 - 1))
    chain, rng = random_chain(seed, n), np.random.default_rng(seed)
    return chain, rng.uniform(-7.0, 7.0, n), rng.normal(0.0, 3.0, n), rng.normal(0.0, 10.0, n)


# --- agreement with Pinocchio -----------------------------------------------------------------

@settings(deadline=None, derandomize=True, max_examples=40)
@given(motion=motions())
def test_recursion_and_positions_are_those_of_pinocchio(motion):
    chain, q, v, a = motion
    model = model_of(urdf_of(chain))
    for i in range(chain.link_count):  # every link is a body that can exist
        inertia = model.inertias[i + 1]
        assert inertia.inertia[1, 1] == pytest.approx(chain.inertias[i], rel=1e-14)
        pseudo = pinocchio.PseudoInertia.FromInertia(inertia).toMatrix()
        assert np.linalg.eigvalsh(pseudo).min() > 0.0
    data = model.createData()
    ours = newton_euler(chain, q, v, a)
    tau = pinocchio.rnea(model, data, unrolled(q), v, a)
    assert_close(ours.tau, tau, atol=1e-12 * np.abs(tau).max())

    pinocchio.forwardKinematics(model, data, unrolled(q))
    forces = np.array([
        data.oMi[i + 1].rotation @ data.f[i + 1].linear for i in range(chain.link_count)])
    assert_close(ours.force, forces[:, [0, 2]], atol=1e-12 * np.abs(forces).max())

    pinocchio.framesForwardKinematics(model, data, unrolled(q))
    points = forward_kinematics(chain, q)
    reach = sum(chain.lengths)
    for i in range(chain.link_count):
        origin, com = data.oMi[i + 1].translation, data.oMi[i + 1].act(model.inertias[i + 1].lever)
        assert_close(points.joints[i], origin[[0, 2]], atol=1e-13 * reach)
        assert_close(points.coms[i], com[[0, 2]], atol=1e-13 * reach)
    tool = data.oMf[model.getFrameId('tool0')].translation
    assert_close(points.tip, tool[[0, 2]], atol=1e-13 * reach)
    assert tool[1] == 0.0


# --- contents of the URDF ---------------------------------------------------------------------

def test_default_arm_has_the_limits_of_its_motors():
    model = model_of(default_arm_urdf())
    assert list(model.names) == ['universe', 'joint1', 'joint2']
    npt.assert_array_equal(model.velocityLimit, [10.0, 10.0])
    joints = ElementTree.fromstring(default_arm_urdf()).findall('joint')
    assert [joint.get('type') for joint in joints] == ['continuous', 'continuous', 'fixed']
    assert [joint.find('limit').get('effort') for joint in joints[:2]] == ['150.0', '60.0']
    for joint in joints[:2]:
        assert joint.find('dynamics').attrib == {'damping': '0.0', 'friction': '0.0'}


def test_friction_limits_and_names_are_written():
    urdf = planar_arm_urdf(
        **TWO, viscous_friction=[0.1, 0.2], coulomb_friction=[0.3, 0.0],
        effort_limits=[40.0, 20.0], velocity_limits=[3.0, 1 / 3], name='R & D "arm"',
        joint_names=['shoulder', 'elbow'])
    robot = ElementTree.fromstring(urdf)
    assert robot.get('name') == 'R & D "arm"'
    shoulder, elbow, _ = robot.findall('joint')
    assert [shoulder.get('name'), elbow.get('name')] == ['shoulder', 'elbow']
    assert shoulder.find('dynamics').attrib == {'damping': '0.1', 'friction': '0.3'}
    assert float(elbow.find('limit').get('velocity')) == 1 / 3
    model = model_of(urdf)
    npt.assert_array_equal(model.velocityLimit, [3.0, 1 / 3])
    npt.assert_array_equal(model.damping, [0.1, 0.2])


def test_links_show_and_can_collide():
    robot = ElementTree.fromstring(planar_arm_urdf(**TWO))
    for name, length in (('link1', 1.0), ('link2', 0.8)):
        link = robot.find(f'link[@name="{name}"]')
        for role in ('visual', 'collision'):
            box = link.find(f'{role}/geometry/box').get('size').split()
            assert [float(side) for side in box] == [length / 10.0, length / 10.0, length]
            assert link.find(f'{role}/origin').get('xyz') == f'0 0 {length / 2.0}'
    assert robot.find('link[@name="base_link"]/inertial') is None
    assert list(robot.find('link[@name="tool0"]')) == []


def test_numbers_survive_to_the_last_digit():
    mass = 0.1 + 0.2  # 0.30000000000000004
    robot = ElementTree.fromstring(planar_arm_urdf([mass], [1 / 3], [0.1], [np.float64(1e-7)]))
    assert float(robot.find('link[@name="link1"]/inertial/mass').get('value')) == mass
    assert float(robot.find('link[@name="link1"]/inertial/inertia').get('iyy')) == 1e-7
    assert robot.findall('joint')[-1].find('origin').get('xyz') == f'0 0 {1 / 3!r}'


@pytest.mark.parametrize(('change', 'message'), [
    ({'masses': [5.0, 0.0]}, 'masses[1] (link2) is 0, expected a number > 0'),

    ({'viscous_friction': [0.0, -0.1]},
     'viscous_friction[1] (joint2) is -0.1, expected a number >= 0'),

    ({'effort_limits': [0.0, 1.0]}, 'effort_limits[0] (joint1) is 0, expected a number > 0'),

    ({'name': ' '}, "name is ' ', expected a printable name"),
    ({'joint_names': ['a']}, "joint_names is ['a'], expected 2 names"),
    ({'joint_names': ['a', '']}, "joint_names[1] is '', expected a printable name"),
    ({'joint_names': ['a', 'a']}, "joint_names has 'a' twice"),
    ({'joint_names': ['a', 'tool0_joint']}, "joint_names has 'tool0_joint', expected other names"),
])
def test_what_cannot_be_built_is_named(change, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        planar_arm_urdf(**{**TWO, **change})


# --- the tool ---------------------------------------------------------------------------------

def test_tool_writes_a_file_with_all_arguments(tmp_path, capsys):
    file = tmp_path / 'arm.urdf'
    status = main([
        '--masses', '1', '2', '3', '--lengths', '1', '1', '0.5', '--com-distances', '0.5', '0.5',
        '0.25', '--inertias', '0.1', '0.1', '0.05', '--viscous', '0.1', '0.2', '0.3', '--coulomb',
        '1', '2', '3', '--effort-limits', '9', '8', '7', '--velocity-limits', '6', '5', '4',
        '--name', 'three', '-o', str(file)])
    assert status == 0
    assert capsys.readouterr().out == ''
    assert file.read_text(encoding='utf-8') == planar_arm_urdf(
        [1, 2, 3], [1, 1, 0.5], [0.5, 0.5, 0.25], [0.1, 0.1, 0.05], [0.1, 0.2, 0.3], [1, 2, 3],
        [9, 8, 7], [6, 5, 4], name='three')


def test_tool_gives_the_limits_of_the_default_arm_to_that_arm_alone(capsys):
    assert main(['--masses', '5', '2']) == 0
    limits = ElementTree.fromstring(capsys.readouterr().out).findall('joint/limit')
    assert [limit.get('effort') for limit in limits] == ['1000.0', '1000.0']
    assert [limit.get('velocity') for limit in limits] == ['100.0', '100.0']
    assert main(['--viscous', '0.5']) == 0  # of both joints
    limits = ElementTree.fromstring(capsys.readouterr().out).findall('joint/limit')
    assert [limit.get('effort') for limit in limits] == ['150.0', '60.0']
    assert main([]) == 0
    assert capsys.readouterr() == (default_arm_urdf(), '')


def test_tool_reports_errors_in_one_line(capsys):
    assert main(['--masses', '5', '-3']) == 2
    assert capsys.readouterr() == (
        '', 'planar_urdf: masses[1] (link2) is -3, expected a number > 0\n')
