# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Random trees of bodies, and their reference, which is the engine Drake."""

from typing import Any, NamedTuple

from engine_cases import tree_map
from engines import DrakeEngine, Projected
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
from robot_dynamics.model import ArmModel, ExternalWrench, load_arm, RigidBody

laws = settings(max_examples=40)
seeds = st.integers(0, 2**32 - 1)


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

    def mechanics(self) -> Projected:
        engine = DrakeEngine(self.urdf)
        return Projected(engine, *tree_map(self.urdf, self.arm.joint_names, engine.joint_names))

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
