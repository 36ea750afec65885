# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Generated arms that every engine reads: revolute chains in space, with full inertias.

Every joint turns about the z axis of its frame; each frame has a random orientation relative to
the frame before. The arms have no meshes and no friction, and no motion reaches a limit.
"""

from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from robot_dynamics.arrays import FloatArray


class ChainLink(NamedTuple):
    """
    A link and the joint that moves it.

    `xyz` [m] and `rpy` [rad] place the joint in the link before; `mass` [kg], `com` [m] and
    `inertia` (3, 3) [kg·m²] about the COM are in the frame of the joint.
    """

    xyz: FloatArray
    rpy: FloatArray
    mass: float
    com: FloatArray
    inertia: FloatArray


def spatial_chain(n: int, seed: int = 0) -> list[ChainLink]:
    """Return the links of a chain of n joints, always the same for a seed."""
    rng = np.random.default_rng(seed)
    return [_random_link(rng) for _ in range(n)]


def _random_link(rng: np.random.Generator) -> ChainLink:
    # The inertia of point masses, so that the inertia is physically possible.
    masses = rng.uniform(0.1, 0.5, 6)
    points = rng.uniform(-0.1, 0.1, (6, 3))
    mass = float(masses.sum())
    com = masses @ points / mass
    r = points - com
    inertia = (masses * (r * r).sum(axis=1)).sum() * np.eye(3) - (r.T * masses) @ r
    return ChainLink(
        rng.uniform(-0.2, 0.2, 3), rng.uniform(-np.pi, np.pi, 3), mass, com, inertia)


def joint_frames(links: list[ChainLink]) -> FloatArray:
    """Return the pose (4, 4) of each joint in the base frame at q = 0, (n, 4, 4)."""
    poses, pose = [], np.eye(4)
    for link in links:
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = _rotation(link.rpy), link.xyz
        pose = pose @ step
        poses.append(pose)
    return np.array(poses)


def _rotation(rpy: FloatArray) -> FloatArray:
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr]])


def modified_dh(links: list[ChainLink]) -> tuple[FloatArray, list[tuple[float, ...]]]:
    """
    Return the modified DH frames at q = 0, (n, 4, 4), and α, a, θ, d of each joint.

    The base frame of the parameters is the frame of the first joint. Consecutive axes must not be
    parallel; the axes of `spatial_chain` are not.
    """
    joints = joint_frames(links)
    frames = joints.copy()
    for frame, joint, following in zip(frames, joints, joints[1:]):
        z, z_next = joint[:3, 2], following[:3, 2]
        x = np.cross(z, z_next)
        x /= np.linalg.norm(x)
        between = following[:3, 3] - joint[:3, 3]
        # between = s z + a x − t z_next: s places the frame at the common perpendicular.
        s, _, _ = np.linalg.solve(np.array([z, x, -z_next]).T, between)
        frame[:3, 0], frame[:3, 1], frame[:3, 3] = x, np.cross(z, x), joint[:3, 3] + s * z
    parameters: list[tuple[float, ...]] = [(0.0, 0.0, 0.0, 0.0)]
    for before, frame in zip(frames, frames[1:]):
        step = np.linalg.solve(before, frame)
        alpha = np.arctan2(-step[1, 2], step[2, 2])
        parameters.append((
            float(alpha), float(step[0, 3]), float(np.arctan2(-step[0, 1], step[0, 0])),
            float(step[2, 3] * np.cos(alpha) - step[1, 3] * np.sin(alpha))))
    return frames, parameters


def chain_urdf(links: list[ChainLink]) -> str:
    """Return the URDF of a chain: joints joint1, joint2, … between base_link and its links."""
    robot = ElementTree.Element('robot', name='chain')
    ElementTree.SubElement(robot, 'link', name='base_link')
    parent = 'base_link'
    for i, link in enumerate(links, 1):
        child = f'link{i}'
        _add_link(robot, child, link)
        joint = ElementTree.SubElement(robot, 'joint', name=f'joint{i}', type='revolute')
        ElementTree.SubElement(joint, 'origin', xyz=_words(link.xyz), rpy=_words(link.rpy))
        ElementTree.SubElement(joint, 'parent', link=parent)
        ElementTree.SubElement(joint, 'child', link=child)
        ElementTree.SubElement(joint, 'axis', xyz='0 0 1')
        ElementTree.SubElement(
            joint, 'limit', lower='-3.1', upper='3.1', effort='1000', velocity='100')
        parent = child
    return ElementTree.tostring(robot, encoding='unicode')


def _add_link(robot: ElementTree.Element, name: str, link: ChainLink) -> None:
    element = ElementTree.SubElement(robot, 'link', name=name)
    inertial = ElementTree.SubElement(element, 'inertial')
    ElementTree.SubElement(inertial, 'origin', xyz=_words(link.com), rpy='0 0 0')
    ElementTree.SubElement(inertial, 'mass', value=repr(link.mass))
    ElementTree.SubElement(inertial, 'inertia', {
        f'i{a}{b}': repr(float(link.inertia[i, j]))
        for i, a in enumerate('xyz') for j, b in enumerate('xyz') if i <= j})


def _words(values: FloatArray) -> str:
    return ' '.join(repr(float(value)) for value in values)
