# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Arms in MuJoCo whose masses, rotors, damping and friction are not those of their URDF.

The kinematics are those of the sample URDFs. All other figures are those of MuJoCo Menagerie
(github.com/google-deepmind/mujoco_menagerie): franka_emika_panda/panda.xml, unitree_z1/z1.xml and
ufactory_xarm7/xarm7.xml.
"""

from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf
from robots import JOINTS, robot_urdf


class Published(NamedTuple):
    """
    Published figures of an arm, one row per joint or moving link.

    `inertials` have mass [kg], centre of mass [m] and either the quaternion w x y z and the
    principal moments, or the moments xx yy zz xy xz yz [kg·m²], in the frame of the link.
    `tool` is the position of the tool in the frame of the last link. `start` [rad] and `way`
    [rad] are the motion of the tests, at whose end the tool is lower.
    """

    armature: list[float]
    damping: list[float]
    frictionloss: list[float]
    inertials: list[str]
    tool: tuple[float, float, float]
    start: list[float]
    way: list[float]


ARMS = {
    'panda': Published(
        [0.1] * 7, [1.0] * 7, [0.0] * 7, [
            '4.970684 | 0.003875 0.002081 -0.04762 |'
            ' 0.70337 0.70661 0.0091170 -0.00013900 0.0067720 0.019169',
            '0.646926 | -0.003141 -0.02872 0.003495 |'
            ' 0.0079620 0.028110 0.025995 -0.003925 0.010254 0.000704',
            '3.228604 | 0.027518 0.039252 -0.066502 |'
            ' 0.037242 0.036155 0.01083 -0.004761 -0.011396 -0.012805',
            '3.587895 | -0.05317 0.104419 0.027454 |'
            ' 0.025853 0.019552 0.028323 0.007796 -0.001332 0.008641',
            '1.225946 | -0.011953 0.041065 -0.038437 |'
            ' 0.035549 0.029474 0.008627 -0.002117 -0.004037 0.000229',
            '1.666555 | 0.060149 -0.014117 -0.010517 |'
            ' 0.001964 0.004354 0.005433 0.000109 -0.001158 0.000341',
            '0.735522 | 0.010517 -0.004252 0.061597 |'
            ' 0.012516 0.010027 0.004815 -0.000428 -0.001196 -0.000741'],
        (0.0, 0.0, 0.2104), [0.0, 0.0, 0.0, -1.57, 0.0, 1.57, -0.785],
        [0.2, 0.35, -0.2, -0.2, 0.2, 0.3, -0.3]),
    'z1': Published(
        [0.0] * 6, [1.0, 2.0, 1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 1.0, 1.0, 1.0, 1.0], [
            '0.673326 | 2.47e-06 -0.00025198 0.0231717 |'
            ' 0.708578 0.705633 0.000281462 -0.000355927 | 0.00128328 0.000839362 0.000719308',
            '1.19132 | -0.110126 0.00240029 0.00158266 |'
            ' 0.00748058 0.707092 -0.0114473 0.70699 | 0.0246612 0.0243113 0.00100468',
            '0.839409 | 0.106092 -0.00541815 0.0347638 |'
            ' 0.540557 0.443575 0.426319 0.573839 | 0.00954365 0.00938711 0.000558432',
            '0.564046 | 0.0436668 0.00364738 -0.00170192 |'
            ' 0.0390835 0.726445 -0.0526787 0.684087 | 0.000981656 0.00094053 0.000302655',
            '0.389385 | 0.0312153 0 0.00646316 |'
            ' 0.462205 0.535209 0.53785 0.45895 | 0.000558961 0.000547317 0.000167332',
            '0.288758 | 0.0241569 -0.00017355 -0.00143876 |'
            ' 0.998779 0.0457735 -0.00663717 0.0173548 | 0.00018333 0.000147464 0.000146786'],
        (0.051, 0.0, 0.0), [0.0, 1.3, -1.2, 0.0, 0.0, 0.0], [0.3, 0.3, 0.1, 0.1, -0.3, 0.3]),
    'xarm7': Published(
        [0.1] * 7, [10.0, 10.0, 5.0, 5.0, 5.0, 2.0, 2.0], [1.0] * 7, [
            '2.382 | -0.0002 0.02905 -0.01233 |'
            ' 0.978953 -0.202769 -0.00441617 -0.0227264 | 0.00569127 0.00533384 0.00293865',
            '1.869 | 0.00022 -0.12856 0.01735 |'
            ' 0.50198 0.86483 -0.00778841 0.00483285 | 0.00959898 0.00937717 0.00201315',
            '1.6383 | 0.0466 -0.02463 -0.00768 |'
            ' 0.913819 0.289775 0.281481 -0.0416455 | 0.00351721 0.00294089 0.00195868',
            '1.7269 | 0.07047 -0.11575 0.012 |'
            ' 0.422108 0.852026 -0.126025 0.282832 | 0.00657137 0.00647948 0.00186763',
            '1.3203 | -0.00032 0.01604 -0.026 |'
            ' 0.999311 -0.0304457 0.000577067 0.0212082 | 0.00534729 0.00499076 0.0013489',
            '1.325 | 0.06469 0.03278 0.02141 |'
            ' -0.217672 0.772419 0.16258 0.574069 | 0.00245421 0.00221646 0.00107273',
            '0.17 | 0 -0.00677 -0.01098 |'
            ' 0.487612 0.512088 -0.512088 0.487612 | 0.000132176 9.3e-05 5.85236e-05'],
        (0.0, 0.0, 0.0), [0.0, -0.247, 0.0, 0.909, 0.0, 1.156, 0.0],
        [0.3, 0.35, -0.3, 0.1, 0.3, 0.2, -0.3]),
}
HANDS = {
    'panda': (
        {'pos': '0 0 0.107', 'quat': '0.9238795 0 0 -0.3826834'},
        '0.76 | -0.0096 0 0.0311 | 1 0 0 0 | 0.001 0.0025 0.0017'),
    'xarm7': (
        {'quat': '0 0 0 1'},
        '0.54156 | -0.00065489 -0.0018497 0.048028 |'
        ' 0.997403 -0.0717512 -0.0061836 0.000477479 | 0.000471093 0.000332307 0.000254799')}
"""
Hands in the frame of the last link: that of the Panda with its fingers, the base of the xArm's.

The URDF of the Panda contains its hand, that of the xArm7 none.
"""
TOOL = 'tool'
FLOOR = 'floor'


def given_arm(name: str) -> ArmModel:
    """Return the arm of the URDF, as the controller has it; skip the test without it."""
    return load_arm(robot_urdf(name), JOINTS.get(name, ()))


def foreign_mjcf(name: str, load: float = 0.0, floor: float | None = None) -> str:
    """
    Return the MJCF of an arm with its published figures, and a body `tool` at its tool.

    `load` [kg] is an unknown mass at the tool, `floor` [m] the height of a floor, which only the
    tool touches.
    """
    published, root = ARMS[name], ElementTree.fromstring(arm_to_mjcf(given_arm(name)))
    bodies = [body for body in root.iter('body') if body.find('joint') is not None]
    for k, body in enumerate(bodies):
        for field in ('armature', 'damping', 'frictionloss'):
            body.find('joint').set(field, str(getattr(published, field)[k]))
        old = body.find('inertial')
        if old is not None:
            body.remove(old)
        body.append(_inertial(published.inertials[k]))
    last = bodies[-1]
    if name in HANDS:
        pose, inertial = HANDS[name]
        SubElement(last, 'body', {'name': 'hand', **pose}).append(_inertial(inertial))
    tool = SubElement(last, 'body', name=TOOL, pos=' '.join(map(str, published.tool)))
    SubElement(tool, 'geom', type='sphere', size='0.02', mass=str(max(load, 1e-6)), name=TOOL)
    if floor is not None:
        world = root.find('worldbody')
        assert world is not None
        SubElement(world, 'geom', name=FLOOR, type='plane', size='2 2 0.1', pos=f'0 0 {floor}')
    return ElementTree.tostring(root, encoding='unicode')


def _inertial(text: str) -> Element:
    mass, pos, *moments = (part.strip() for part in text.split('|'))
    values = {'mass': mass, 'pos': pos}
    if len(moments) == 1:
        return Element('inertial', {**values, 'fullinertia': moments[0]})
    return Element('inertial', {**values, 'quat': moments[0], 'diaginertia': moments[1]})


def foreign_simulation(name: str, **scene: Any) -> Any:
    """Return the `MujocoSimulation` of an arm at its start; skip the test without MuJoCo."""
    pytest.importorskip('mujoco')
    from robot_dynamics_tools.mujoco.mujoco_simulation import model_of_mjcf, MujocoSimulation
    model = model_of_mjcf(foreign_mjcf(name, **scene))
    return MujocoSimulation(model, position=ARMS[name].start)


def tool_height(name: str, position: FloatArray) -> float:
    """Return the height [m] of the tool at a position (n,)."""
    simulation = foreign_simulation(name)
    simulation.data.qpos[:] = position
    simulation._mj.mj_forward(simulation.model, simulation.data)
    return float(simulation.data.body(TOOL).xpos[2])


def contact_force(simulation: Any) -> float:
    """Return the sum of the normal forces of all contacts [N]."""
    force, total = np.zeros(6), 0.0
    for i in range(simulation.data.ncon):
        simulation._mj.mj_contactForce(simulation.model, simulation.data, i, force)
        total += float(force[0])
    return total


def push_on_tool(simulation: Any, force: FloatArray) -> list[Any]:
    """Return the wrenches for a force (3,) [N] in the base frame on the tool."""
    from robot_dynamics.model.external_wrench import ExternalWrench
    R = simulation.data.body(TOOL).xmat.reshape(3, 3)
    return [ExternalWrench(TOOL, R.T @ force, np.zeros(3))]
