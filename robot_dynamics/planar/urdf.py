# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
URDF of a planar arm whose dynamics are exactly those of `planar_chain.PlanarChain`.

The plane of the chain is the x-z plane of the URDF: its x is x, its y (up) is z, and all joints
turn about +y, which takes z to x as a positive angle does there. At zero all links stand
upright along +z, each in the frame of its joint. A URDF contains no gravity: the program that
reads the URDF has to use 9.81 m/s² along -z.
"""

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy.typing as npt
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar.chain import PlanarChain
from robot_dynamics.planar.two_link import PlanarTwoLink
from robot_dynamics.validation import check_per_joint, check_scalar, check_unique

BASE_LINK = 'base_link'
TOOL_LINK = 'tool0'
TOOL_JOINT = 'tool0_joint'

# Far above what an arm of this size needs, as the chain itself knows no limits.
GENEROUS_EFFORT_LIMIT = 1000.0
GENEROUS_VELOCITY_LIMIT = 100.0

DEFAULT_EFFORT_LIMITS = (150.0, 60.0)
DEFAULT_VELOCITY_LIMITS = (10.0, 10.0)

# The links are drawn as square rods a tenth as wide as long. A uniform rod of that shape has
# I_zz / I_yy = 2 w² / (l² + w²), which also keeps the three principal moments those of a body
# that can exist.
LENGTH_PER_WIDTH = 10.0
AXIAL_INERTIA_RATIO = 2.0 / (LENGTH_PER_WIDTH**2 + 1.0)

COLOURS = ('0.55 0.57 0.6 1.0', '0.75 0.77 0.8 1.0')


def planar_arm_urdf(
    masses: Sequence[float],
    lengths: Sequence[float],
    com_distances: Sequence[float],
    inertias: Sequence[float],
    viscous_friction: npt.ArrayLike = 0.0,
    coulomb_friction: npt.ArrayLike = 0.0,
    effort_limits: npt.ArrayLike = GENEROUS_EFFORT_LIMIT,
    velocity_limits: npt.ArrayLike = GENEROUS_VELOCITY_LIMIT,
    name: str = 'planar_arm',
    joint_names: Sequence[str] | None = None,
) -> str:
    """
    Return the URDF of an n-link planar arm, first the link at the base.

    Masses [kg], lengths [m], COM distances from the joint [m] and moments of inertia about the
    joint's axis through the COM [kg·m²] are as in `PlanarChain`. Viscous [N·m·s/rad] and Coulomb
    friction [N·m], and the limits [N·m, rad/s], are one number for all joints or one value per
    joint. By default, the joints are called joint1, joint2, ... They are continuous, so that they
    can turn over.

    The moments about the other two axes do not move a planar arm; they are chosen as those of a
    thin rod along z, so that the pseudo-inertia (Wensing, Kim and Slotine, IEEE RA-L 3(1),
    2018) is positive definite. `tool0` is a frame at the tip, without mass.

    Raises InvalidInputError if a list has another length, if a value is out of its range (as for
    `PlanarChain`; friction >= 0, limits > 0), or if a name is empty, not printable or repeated.
    """
    chain = PlanarChain(masses, lengths, com_distances, inertias)
    names = _joint_names(chain.link_count, joint_names)
    viscous = _per_joint('viscous_friction', viscous_friction, names)
    coulomb = _per_joint('coulomb_friction', coulomb_friction, names)
    effort = _per_joint('effort_limits', effort_limits, names, True)
    velocity = _per_joint('velocity_limits', velocity_limits, names, True)

    robot = ElementTree.Element('robot', name=_checked_name('name', name))
    _add_base(robot, chain.lengths[0] / LENGTH_PER_WIDTH)
    parent, height = BASE_LINK, 0.0
    for i, joint_name in enumerate(names):
        child = f'link{i + 1}'
        _add_link(robot, child, chain, i)
        joint = _add_joint(robot, joint_name, 'continuous', parent, child, height)
        ElementTree.SubElement(joint, 'axis', xyz='0 1 0')
        ElementTree.SubElement(
            joint, 'limit', effort=repr(effort[i]), velocity=repr(velocity[i]))
        ElementTree.SubElement(
            joint, 'dynamics', damping=repr(viscous[i]), friction=repr(coulomb[i]))
        parent, height = child, chain.lengths[i]
    ElementTree.SubElement(robot, 'link', name=TOOL_LINK)
    _add_joint(robot, TOOL_JOINT, 'fixed', parent, TOOL_LINK, height)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding='unicode') + '\n'


def default_arm_urdf() -> str:
    """
    Return the URDF of the default arm, which nodes and tools use without arguments.

    It is `PlanarTwoLink()` without friction, limited to 150 N·m and 60 N·m, and to 10 rad/s.
    """
    chain = PlanarChain.from_two_link(PlanarTwoLink())
    return planar_arm_urdf(
        chain.masses, chain.lengths, chain.com_distances, chain.inertias,
        effort_limits=DEFAULT_EFFORT_LIMITS, velocity_limits=DEFAULT_VELOCITY_LIMITS)


def _checked_name(field: str, name: str) -> str:
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise InvalidInputError(f'{field} is {name!r}, expected a printable name, not empty')
    return name


def _joint_names(count: int, given: Sequence[str] | None) -> list[str]:
    if given is None:
        return [f'joint{i + 1}' for i in range(count)]
    if isinstance(given, str) or len(given) != count:
        raise InvalidInputError(f'joint_names is {given!r}, expected {count} names, one per link')
    names = [_checked_name(f'joint_names[{i}]', name) for i, name in enumerate(given)]
    if TOOL_JOINT in names:
        raise InvalidInputError(
            f'joint_names has {TOOL_JOINT!r}, expected other names: the joint of the tool has it')
    check_unique('joint_names', names)
    return names


def _per_joint(
    field: str, values: npt.ArrayLike, names: list[str], exclusive_minimum: bool = False,
) -> list[float]:
    return [
        check_scalar(f'{field}[{i}] ({names[i]})', value, 0.0, exclusive_minimum=exclusive_minimum)
        for i, value in enumerate(check_per_joint(field, values, names))
    ]


def _add_base(robot: ElementTree.Element, width: float) -> None:
    # Without mass, because several readers do not support a root link with inertia.
    base = ElementTree.SubElement(robot, 'link', name=BASE_LINK)
    visual = ElementTree.SubElement(base, 'visual')
    ElementTree.SubElement(visual, 'origin', xyz=f'0 0 {-width!r}', rpy='0 0 0')
    geometry = ElementTree.SubElement(visual, 'geometry')
    ElementTree.SubElement(geometry, 'cylinder', radius=repr(width), length=repr(width))
    material = ElementTree.SubElement(visual, 'material', name='base')
    ElementTree.SubElement(material, 'color', rgba='0.3 0.3 0.3 1.0')


def _add_link(robot: ElementTree.Element, name: str, chain: PlanarChain, i: int) -> None:
    length, I_yy = chain.lengths[i], chain.inertias[i]
    link = ElementTree.SubElement(robot, 'link', name=name)
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(
        inertial, 'origin', xyz=f'0 0 {chain.com_distances[i]!r}', rpy='0 0 0')
    ElementTree.SubElement(inertial, 'mass', value=repr(chain.masses[i]))
    ElementTree.SubElement(
        inertial, 'inertia', ixx=repr(I_yy), iyy=repr(I_yy),
        izz=repr(AXIAL_INERTIA_RATIO * I_yy), ixy='0.0', ixz='0.0', iyz='0.0')
    width = length / LENGTH_PER_WIDTH
    for role in ('visual', 'collision'):
        shape = ElementTree.SubElement(link, role)
        ElementTree.SubElement(shape, 'origin', xyz=f'0 0 {length / 2.0!r}', rpy='0 0 0')
        geometry = ElementTree.SubElement(shape, 'geometry')
        ElementTree.SubElement(geometry, 'box', size=f'{width!r} {width!r} {length!r}')
        if role == 'visual':
            colour = i % len(COLOURS)
            material = ElementTree.SubElement(shape, 'material', name=f'links{colour + 1}')
            ElementTree.SubElement(material, 'color', rgba=COLOURS[colour])


def _add_joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, height: float,
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'origin', xyz=f'0 0 {height!r}', rpy='0 0 0')
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    return joint
