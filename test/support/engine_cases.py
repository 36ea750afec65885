# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One arm and one engine at random states, and the tolerances of the comparison.

Both engines read the same text as the arm. They do not support mimic joints, locked joints or
payloads: this module reads the relations from the description, and writes payloads into the
description.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple
from xml.etree import ElementTree
import zlib

from engines import Array, DrakeEngine, Engine, MOVING, MujocoEngine, Projected
import numpy as np
from robot_dynamics.model import ArmModel, ExternalWrench, load_arm, Payload, RigidBody
from robots import robot_urdf

# Relative to the largest entry. Accelerations need a larger tolerance: if a wrist or a caster is
# in the same tree as a lift, the condition number of M is above 10⁶.
MOTION_TOLERANCE = 1e-9
ENGINES: dict[str, type[Engine]] = {'mujoco': MujocoEngine, 'drake': DrakeEngine}


# --- descriptions --------------------------------------------------------------------------------

def with_payloads(urdf: str, payloads: Sequence[Payload]) -> str:
    """Return the URDF with each payload as a separate link, fixed to the link that carries it."""
    root = ElementTree.fromstring(urdf)
    for i, payload in enumerate(payloads):
        link = ElementTree.SubElement(root, 'link', {'name': f'load_{i}'})
        inertial = ElementTree.SubElement(link, 'inertial')
        ElementTree.SubElement(inertial, 'origin', {'xyz': ' '.join(map(str, payload.com))})
        ElementTree.SubElement(inertial, 'mass', {'value': str(payload.mass)})
        tensor = ElementTree.SubElement(inertial, 'inertia')
        for r, c in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            tensor.set(f'i{"xyz"[r]}{"xyz"[c]}', str(payload.inertia[r, c]))
        joint = ElementTree.SubElement(root, 'joint', {'name': f'weld_{i}', 'type': 'fixed'})
        ElementTree.SubElement(joint, 'parent', {'link': payload.link})
        ElementTree.SubElement(joint, 'child', {'link': f'load_{i}'})
    return ElementTree.tostring(root, encoding='unicode')


def with_other_relations(urdf: str, rng: np.random.Generator) -> str:
    """Return the URDF with unusual relations of mimic joints; the last one refers to the first."""
    root = ElementTree.fromstring(urdf)
    followers = [
        joint for joint in root.findall('joint')
        if joint.attrib['type'] in MOVING and joint.find('mimic') is not None]
    for joint in followers:
        mimic = joint.find('mimic')
        mimic.set('multiplier', str(rng.choice((-1.0, 1.0)) * rng.uniform(0.3, 2.5)))
        mimic.set('offset', str(rng.uniform(-0.5, 0.5)))
        if joint is followers[-1] and joint is not followers[0]:
            mimic.set('joint', followers[0].attrib['name'])
    return ElementTree.tostring(root, encoding='unicode')


class Joint(NamedTuple):
    """A movable joint of the description."""

    lower: float
    upper: float
    leader: str
    multiplier: float
    offset: float


def moving_joints(urdf: str) -> dict[str, Joint]:
    joints = {}
    for element in ElementTree.fromstring(urdf).findall('joint'):
        if element.attrib['type'] not in MOVING:
            continue
        limit, mimic = element.find('limit'), element.find('mimic')
        unlimited = element.attrib['type'] == 'continuous' or limit is None
        low, high = (-np.inf, np.inf) if unlimited else (
            float(limit.get(key, '0')) for key in ('lower', 'upper'))
        follows = ('', 1.0, 0.0) if mimic is None else (
            mimic.attrib['joint'], float(mimic.get('multiplier', '1')),
            float(mimic.get('offset', '0')))
        joints[element.attrib['name']] = Joint(low, high, *follows)
    return joints


def tree_map(urdf: str, names: Sequence[str], tree: Sequence[str]) -> tuple[Array, Array]:
    """Return G, q0 with q_tree = G q + q0: each joint is evaluated by its relation."""
    joints = moving_joints(urdf)

    def evaluate(name: str, q: dict[str, float]) -> float:
        joint = joints[name]
        if joint.leader:
            return joint.multiplier * evaluate(joint.leader, q) + joint.offset
        return q[name] if name in q else max(joint.lower, min(joint.upper, 0.0))

    def position(q: Array) -> Array:
        return np.array([evaluate(name, dict(zip(names, q))) for name in tree])

    q0 = position(np.zeros(len(names)))
    return np.array([position(e) - q0 for e in np.eye(len(names))]).T, q0


# --- cases ---------------------------------------------------------------------------------------

class State(NamedTuple):
    """Position, velocity, acceleration and an effort, each (n,)."""

    q: Array
    v: Array
    a: Array
    tau: Array


@dataclass(frozen=True, eq=False)
class Case:
    """One arm, and the engine that it is compared with."""

    arm: ArmModel
    body: RigidBody
    reference: Projected
    rng: np.random.Generator

    def states(self, count: int) -> list[State]:
        """Return random states within the limits; ±π for a joint without limits."""
        limits, n, rng = self.arm.limits, self.arm.joint_count, self.rng
        low, high = np.clip(limits.lower, -np.pi, np.pi), np.clip(limits.upper, -np.pi, np.pi)
        return [
            State(rng.uniform(low, high), *rng.normal(scale=(2.0, 5.0, 20.0), size=(n, 3)).T)
            for _ in range(count)]

    def wrenches(self, count: int) -> list[ExternalWrench]:
        """Return random wrenches on random links, including fixed links and the base."""
        links = self.rng.choice(self.arm.link_names, count)
        return [
            ExternalWrench(str(link), self.rng.normal(size=3) * 50, self.rng.normal(size=3) * 10)
            for link in links]


def make_case(engine: str, urdf: str, *, theirs: str = '') -> Case:
    """Return an arm and the engine of one description, or of the description `theirs`."""
    arm = load_arm(urdf)
    reference = ENGINES[engine](theirs or urdf)
    projection = tree_map(urdf, arm.joint_names, reference.joint_names)
    return Case(arm, RigidBody(arm), Projected(reference, *projection), generator(urdf))


@cache
def built_once(engine: str, robot: str) -> Case:
    return make_case(engine, robot_urdf(robot))


def plain(engine: str, robot: str) -> Case:
    """Return the case of an unchanged robot; its random number generator is reset."""
    return replace(built_once(engine, robot), rng=generator(robot_urdf(robot)))


def generator(urdf: str) -> np.random.Generator:
    # The hash of a str differs between runs.
    return np.random.default_rng(zlib.crc32(urdf.encode()))


def assert_same_motion(a: Array, reference: Projected, state: State) -> None:
    """Compare accelerations by the efforts that they need."""
    q, v, _, tau = state
    difference = reference.inverse_dynamics(q, v, a) - tau
    assert np.max(np.abs(difference)) <= MOTION_TOLERANCE * np.max(np.abs(tau))
