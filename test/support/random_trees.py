# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Random trees of bodies, and their energies from the definitions.

`Mechanics` computes the energies of a URDF only from its frames, without an engine.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple
from xml.etree import ElementTree

from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
from robot_dynamics.model import ArmModel, ExternalWrench, load_arm, RigidBody

GRAVITY = np.array([0.0, 0.0, -9.81])
laws = settings(max_examples=40)
seeds = st.integers(0, 2**32 - 1)


# --- mechanics from the definitions --------------------------------------------------------------

def skew(w: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotate about a unit axis (Rodrigues)."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def numbers(element: ElementTree.Element | None, attribute: str, default: str) -> np.ndarray:
    text = default if element is None else element.get(attribute, default)
    return np.array([float(word) for word in text.split()])


def origin(element: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    tag = element.find('origin')
    roll, pitch, yaw = numbers(tag, 'rpy', '0 0 0')
    x, y, z = np.eye(3)
    return turn(z, yaw) @ turn(y, pitch) @ turn(x, roll), numbers(tag, 'xyz', '0 0 0')


class Body(NamedTuple):
    mass: float
    com: np.ndarray
    inertia: np.ndarray


class Mechanics:
    """Poses, twists and energies of all the links of a URDF, by name."""

    step = 1e-5

    def __init__(self, urdf: str, joint_names: Iterable[str]) -> None:
        root = ElementTree.fromstring(urdf.strip())
        self.joints = {joint.get('name'): joint for joint in root.findall('joint')}
        self.actuated = tuple(joint_names)
        self.bodies = {
            link.get('name'): self._body(link) for link in root.findall('link')
            if link.find('inertial') is not None}
        self.children: dict[Any, list[Any]] = {}
        for joint in self.joints.values():
            self.children.setdefault(joint.find('parent').get('link'), []).append(joint)
        children = {joint.find('child').get('link') for joint in self.joints.values()}
        self.root, = (link.get('name') for link in root.findall('link')
                      if link.get('name') not in children)

    @staticmethod
    def _body(link: ElementTree.Element) -> Body:
        inertial = link.find('inertial')
        R, com = origin(inertial)
        tag = inertial.find('inertia')
        xx, xy, xz, yy, yz, zz = (
            float(tag.get(entry)) for entry in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'))
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Body(float(inertial.find('mass').get('value')), com, R @ inertia @ R.T)

    def position_of(self, name: str, q: np.ndarray) -> float:
        if name in self.actuated:
            return float(q[self.actuated.index(name)])
        mimic = self.joints[name].find('mimic')
        if mimic is not None:
            leader = self.position_of(mimic.get('joint'), q)
            return float(mimic.get('multiplier', 1)) * leader + float(mimic.get('offset', 0))
        limit = self.joints[name].find('limit')
        if self.joints[name].get('type') == 'continuous':
            return 0.0
        return max(float(limit.get('lower', 0)), min(float(limit.get('upper', 0)), 0.0))

    def poses(self, q: np.ndarray) -> dict[Any, tuple[np.ndarray, np.ndarray]]:
        poses = {self.root: (np.eye(3), np.zeros(3))}
        frontier = [self.root]
        while frontier:
            parent = frontier.pop()
            R, p = poses[parent]
            for joint in self.children.get(parent, []):
                R_joint, p_joint = origin(joint)
                R_child, p_child = R @ R_joint, p + R @ p_joint
                if joint.get('type') != 'fixed':
                    axis = numbers(joint.find('axis'), 'xyz', '1 0 0')
                    axis = axis / np.linalg.norm(axis)
                    z = self.position_of(joint.get('name'), q)
                    if joint.get('type') == 'prismatic':
                        p_child = p_child + R_child @ axis * z
                    else:
                        R_child = R_child @ turn(axis, z)
                child = joint.find('child').get('link')
                poses[child] = (R_child, p_child)
                frontier.append(child)
        return poses

    def twists(self, q: np.ndarray, v: np.ndarray) -> dict[Any, tuple[np.ndarray, np.ndarray]]:
        """Velocity of the origin and angular velocity of every link, in the link's frame."""
        h = self.step / max(1.0, np.linalg.norm(v))
        before, now, after = self.poses(q - h * v), self.poses(q), self.poses(q + h * v)
        twists = {}
        for link, (R, _) in now.items():
            W = (after[link][0] - before[link][0]) / (2 * h) @ R.T
            w = 0.5 * np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])
            twists[link] = (R.T @ (after[link][1] - before[link][1]) / (2 * h), R.T @ w)
        return twists

    def kinetic_energy(self, q: np.ndarray, v: np.ndarray) -> float:
        twists = self.twists(q, v)
        energy = 0.0
        for link, body in self.bodies.items():
            velocity, w = twists[link]
            at_com = velocity + np.cross(w, body.com)
            energy += 0.5 * (body.mass * at_com @ at_com + w @ body.inertia @ w)
        return energy

    def potential_energy(self, q: np.ndarray, gravity: np.ndarray = GRAVITY) -> float:
        poses = self.poses(q)
        return -sum(
            body.mass * gravity @ (poses[link][1] + poses[link][0] @ body.com)
            for link, body in self.bodies.items())


# --- random trees --------------------------------------------------------------------------------

def text(values: Any) -> str:
    return ' '.join(repr(float(value)) for value in np.atleast_1d(values))


def random_inertial(rng: np.random.Generator) -> str:
    mass, (a, b, c) = rng.uniform(0.1, 5.0), rng.uniform(0.05, 0.6, 3).tolist()
    # The moments of a solid box, rotated by the angles of the origin.
    return (
        f'<inertial><origin xyz="{text(rng.normal(0, 0.2, 3))}" '
        f'rpy="{text(rng.uniform(-3, 3, 3))}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{mass * (b*b + c*c) / 12!r}" iyy="{mass * (a*a + c*c) / 12!r}" '
        f'izz="{mass * (a*a + b*b) / 12!r}" ixy="0" ixz="0" iyz="0"/></inertial>')


def random_urdf(rng: np.random.Generator) -> str:
    """
    Return a tree with every kind of joint, mimics of mimics, and links without inertia.

    Every leaf has inertia, so the mass matrix is regular. The names, and so the joint order of
    the engine, are independent of the order in the document.
    """
    count = int(rng.integers(3, 10))
    names = [f'{chr(97 + letter)}{i}' for i, letter in enumerate(rng.permutation(26)[:count])]
    parents = [int(rng.integers(max(0, i - 2), i + 1)) for i in range(count)]
    kinds = rng.choice(
        ['revolute', 'continuous', 'prismatic', 'fixed'], count, p=[0.35, 0.25, 0.2, 0.2])
    kinds[0] = 'revolute'
    moving = [i for i in range(count) if kinds[i] != 'fixed']
    links, joints = [f'<link name="link0">{random_inertial(rng)}</link>'], []
    for i, (name, parent, kind) in enumerate(zip(names, parents, kinds)):
        heavy = i + 1 not in parents or rng.random() < 0.6
        links.append(f'<link name="link{i + 1}">{random_inertial(rng) if heavy else ""}</link>')
        lower = rng.uniform(-3.0, 0.5)
        follows = ''
        if kind != 'fixed' and i > 0 and rng.random() < 0.35:
            leader = names[int(rng.choice([j for j in moving if j < i]))]
            follows = (f'<mimic joint="{leader}" multiplier="{rng.uniform(-2, 2)!r}" '
                       f'offset="{rng.uniform(-1, 1)!r}"/>')
        joints.append(
            f'<joint name="{name}" type="{kind}">'
            f'<origin xyz="{text(rng.normal(0, 0.3, 3))}" rpy="{text(rng.uniform(-3, 3, 3))}"/>'
            f'<parent link="link{parent}"/><child link="link{i + 1}"/>'
            f'<axis xyz="{text(rng.normal(0, 1, 3))}"/>'
            f'<limit lower="{lower!r}" upper="{lower + rng.uniform(0, 3)!r}" '
            f'effort="{rng.uniform(1, 99)!r}" velocity="{rng.uniform(1, 9)!r}"/>'
            f'<dynamics damping="{rng.uniform(0, 1)!r}" friction="{rng.uniform(0, 1)!r}"/>'
            f'{follows}</joint>')
    rng.shuffle(links)
    rng.shuffle(joints)
    return f'<robot name="random">{"".join(links)}{"".join(joints)}</robot>'


class Case(NamedTuple):
    """An arm, a state of it, and a random number generator for the test."""

    urdf: str
    arm: ArmModel
    body: RigidBody
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    rng: np.random.Generator

    def mechanics(self) -> Mechanics:
        return Mechanics(self.urdf, self.arm.joint_names)

    def wrenches(self) -> list[ExternalWrench]:
        links = self.rng.choice(self.arm.link_names, 3)
        return [
            ExternalWrench(str(link), self.rng.normal(0, 20, 3), self.rng.normal(0, 5, 3))
            for link in links]


def case_of(urdf: str, rng: np.random.Generator, some_locked: bool = True) -> Case:
    arm = load_arm(urdf)
    if some_locked and arm.joint_count > 1:
        kept = rng.permutation(arm.joint_names)[:rng.integers(1, arm.joint_count + 1)]
        arm = load_arm(urdf, [str(name) for name in kept])
    n = arm.joint_count
    return Case(
        urdf, arm, RigidBody(arm), rng.uniform(-2, 2, n), rng.normal(0, 1.5, n),
        rng.normal(0, 4, n), rng)


def random_case(seed: int, **more: Any) -> Case:
    rng = np.random.default_rng(seed)
    return case_of(random_urdf(rng), rng, **more)


random_cases = seeds.map(random_case)
