# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Every quantity of the rigid bodies against MuJoCo and Drake, on real robots at random states.

By default one robot per kind of tree (`robots.KINDS`); `scripts/test -m soak` runs the others.

Both engines read the same text as the arm. They know nothing of mimic joints, locked joints or
payloads: the relations are read here from the description itself, and payloads are written into
it. Where the engines do not take the inertia of a link, the arm too reads the mended text.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
import platform
import sys
from typing import NamedTuple
from xml.etree import ElementTree
import zlib

from engines import Array, DrakeEngine, Engine, load, MOVING, MujocoEngine, Projected, Wrench
import numpy as np
import pytest
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.joint_order import JointOrder
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model.rigid_body import RigidBody
from robots import ARMS, by_kind, KINDS, MIMIC, robot_urdf, ROBOTS

# Relative to the largest entry. Accelerations need more room: where a wrist or a caster turns on
# the same tree as a lift, the condition number of M is above 10⁶.
TOLERANCE = 1e-11
MOTION_TOLERANCE = 1e-9
DOWN = (0.0, 0.0, -9.81)
ENGINES: dict[str, type[Engine]] = {'mujoco': MujocoEngine, 'drake': DrakeEngine}

# Links whose principal moments are negative, or one of them above the sum of the others. MuJoCo
# refuses such a description, and Drake puts a ball of water in the place of the link. Pinocchio
# takes it as it is: what the arm makes of it is compared in test_rigid_body.
IMPLAUSIBLE = {
    'pr2': {'double_stereo_link', 'sensor_mount_link'},
    'tiago': {'base_antenna_left_link', 'base_antenna_right_link'},
    'tiago_dual': {'base_antenna_left_link', 'base_antenna_right_link'},
    'tiago_no_hand': {'base_antenna_left_link', 'base_antenna_right_link'},
}

on_robots = pytest.mark.parametrize('robot', by_kind())
on_engines = pytest.mark.parametrize('engine', ENGINES)


# --- descriptions --------------------------------------------------------------------------------

def implausible_links(urdf: str) -> set[str]:
    """Return the links whose inertia no body has."""
    found = set()
    for link in ElementTree.fromstring(urdf).findall('link'):
        tensor = link.find('inertial/inertia')
        if tensor is not None:
            xx, xy, xz, yy, yz, zz = (
                float(tensor.attrib[k]) for k in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'))
            low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            if low < 0.0 or high > (low + middle) * (1.0 + 1e-9):
                found.add(link.attrib['name'])
    return found


def mended(urdf: str, links: set[str]) -> str:
    """Return the URDF with a ball's inertia for these links: a third of the trace each way."""
    root = ElementTree.fromstring(urdf)
    for link in root.findall('link'):
        if link.attrib['name'] in links:
            tensor = link.find('inertial/inertia')
            assert tensor is not None
            third = sum(float(tensor.attrib[k]) for k in ('ixx', 'iyy', 'izz')) / 3.0
            tensor.attrib.update({k: repr(third) for k in ('ixx', 'iyy', 'izz')})
            tensor.attrib.update(dict.fromkeys(('ixy', 'ixz', 'iyz'), '0'))
    return ElementTree.tostring(root, encoding='unicode')


def description(robot: str) -> str:
    return mended(robot_urdf(robot), IMPLAUSIBLE.get(robot, set()))


def with_payloads(urdf: str, payloads: Sequence[Payload]) -> str:
    """Return the URDF with each payload as a link of its own, fixed to the one that bears it."""
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


def with_friction(urdf: str, damping: dict[str, float], coulomb: dict[str, float]) -> str:
    """Return the URDF with this friction at every joint that moves."""
    root = ElementTree.fromstring(urdf)
    for joint in root.findall('joint'):
        if (name := joint.attrib['name']) in damping:
            for old in joint.findall('dynamics'):
                joint.remove(old)
            ElementTree.SubElement(joint, 'dynamics', {
                'damping': str(damping[name]), 'friction': str(coulomb[name])})
    return ElementTree.tostring(root, encoding='unicode')


def with_other_relations(urdf: str, rng: np.random.Generator) -> str:
    """Return the URDF with odd relations of mimic joints, the last of them after the first."""
    root = ElementTree.fromstring(urdf)
    followers = [
        joint for joint in root.findall('joint')
        if joint.attrib['type'] in MOVING and joint.find('mimic') is not None]
    for joint in followers:
        mimic = joint.find('mimic')
        assert mimic is not None
        mimic.set('multiplier', str(rng.choice((-1.0, 1.0)) * rng.uniform(0.3, 2.5)))
        mimic.set('offset', str(rng.uniform(-0.5, 0.5)))
        if joint is followers[-1] and joint is not followers[0]:
            mimic.set('joint', followers[0].attrib['name'])
    return ElementTree.tostring(root, encoding='unicode')


class Joint(NamedTuple):
    """A joint that moves, as the description has it."""

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
    """Return G, q0 with q_tree = G q + q0: every joint evaluated by its own relation."""
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
        """Return random states within the limits; a joint without any turns by up to ±π."""
        limits, n, rng = self.arm.limits, self.arm.joint_count, self.rng
        low, high = np.clip(limits.lower, -np.pi, np.pi), np.clip(limits.upper, -np.pi, np.pi)
        return [
            State(rng.uniform(low, high), *rng.normal(scale=(2.0, 5.0, 20.0), size=(n, 3)).T)
            for _ in range(count)]

    def wrenches(self, count: int) -> list[ExternalWrench]:
        """Return random wrenches on random links, fixed ones and the base among them."""
        links = self.rng.choice(self.arm.link_names, count)
        return [
            ExternalWrench(str(link), self.rng.normal(size=3) * 50, self.rng.normal(size=3) * 10)
            for link in links]


def make_case(
    engine: str, urdf: str, *, joints: Sequence[str] = (), gravity: Sequence[float] = DOWN,
    theirs: str = '', damping: bool = False,
) -> Case:
    """Return an arm and the engine of one description, or of another that is `theirs`."""
    arm = load_arm(urdf, joints, gravity)
    reference = ENGINES[engine](theirs or urdf, gravity, damping)
    projection = tree_map(urdf, arm.joint_names, reference.joint_names)
    return Case(arm, RigidBody(arm), Projected(reference, *projection), generator(urdf))


@cache
def built_once(engine: str, robot: str) -> Case:
    return make_case(engine, description(robot))


def plain(engine: str, robot: str) -> Case:
    """Return the case of a robot as it is; its random numbers start anew."""
    return replace(built_once(engine, robot), rng=generator(description(robot)))


def generator(urdf: str) -> np.random.Generator:
    # Not the hash of a str, which differs from run to run.
    return np.random.default_rng(zlib.crc32(urdf.encode()))


def wrenches_of(wrenches: Sequence[ExternalWrench]) -> list[Wrench]:
    return [Wrench(w.link, w.force, w.torque) for w in wrenches]


def deviation(actual: Array | float, reference: Array | float) -> float:
    """Return max |actual − reference| relative to max |reference|."""
    difference = float(np.max(np.abs(np.subtract(actual, reference)), initial=0.0))
    scale = float(np.max(np.abs(reference), initial=0.0))
    # Both are nothing but rounding where a vector is zero by symmetry.
    return difference / scale if scale > 1e-9 else difference


def assert_near(actual: Array | float, reference: Array | float, what: str) -> None:
    assert np.shape(actual) == np.shape(reference)
    relative = deviation(actual, reference)
    assert relative <= TOLERANCE, f'{what} is off by {relative:.1e} of its largest value'


def assert_same_motion(
    a: Array, reference: Projected, state: State, wrenches: Sequence[Wrench] = (),
) -> None:
    """Compare accelerations by the efforts that they cost."""
    q, v, _, tau = state
    expected = reference.forward_dynamics(q, v, tau, wrenches)
    cost = reference.mass_matrix(q) @ (a - expected)
    scale = np.max(np.abs(tau) + np.abs(reference.external(q, wrenches)))
    assert np.max(np.abs(cost)) <= MOTION_TOLERANCE * scale


# --- what is compared ----------------------------------------------------------------------------

def joint_kinds(robot: str) -> set[tuple[str | None, ...]]:
    """Return type and axis, and type and mimic element, of each joint."""
    kinds: set[tuple[str | None, ...]] = set()
    for joint in ElementTree.fromstring(robot_urdf(robot)).findall('joint'):
        axis, kind = joint.find('axis'), joint.get('type')
        if kind in MOVING:
            kinds.add((kind, None if axis is None else axis.get('xyz')))
        if joint.find('mimic') is not None:
            kinds.add((kind, 'mimic'))
    return kinds


def test_the_default_robots_have_every_kind_of_joint():
    assert set.union(*map(joint_kinds, KINDS)) == set.union(*map(joint_kinds, ROBOTS))


@on_robots
def test_mends_what_no_engine_takes_and_nothing_else(robot):
    assert implausible_links(robot_urdf(robot)) == IMPLAUSIBLE.get(robot, set())
    assert implausible_links(description(robot)) == set()


@on_engines
@on_robots
def test_inverse_dynamics(engine, robot):
    case = plain(engine, robot)
    ours, theirs = case.body, case.reference
    for q, v, a, _ in case.states(20):
        assert_near(ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a), 'tau')
        wrenches = case.wrenches(3)
        assert_near(
            ours.inverse_dynamics(q, v, a, wrenches),
            theirs.inverse_dynamics(q, v, a, wrenches_of(wrenches)), 'tau with wrenches')


@on_engines
@on_robots
def test_terms(engine, robot):
    case = plain(engine, robot)
    ours, theirs = case.body, case.reference
    for q, v, a, _ in case.states(20):
        wrenches = case.wrenches(2)
        pushed = wrenches_of(wrenches)
        terms = ours.terms(q, v, a, wrenches)
        M, coriolis, gravity = theirs.mass_matrix(q), theirs.coriolis(q, v), theirs.gravity(q)
        assert_near(terms.inertial, M @ a, 'inertial')
        assert_near(terms.coriolis, coriolis, 'coriolis')
        assert_near(terms.gravity, gravity, 'gravity')
        assert_near(terms.external, theirs.external(q, pushed), 'external')
        assert_near(ours.gravity(q), gravity, 'g')
        assert_near(ours.nonlinear(q, v), coriolis + gravity, 'C v + g')
        assert_near(ours.mass_matrix(q), M, 'M')


@on_engines
@on_robots
def test_energies(engine, robot):
    case = plain(engine, robot)
    ours, theirs = case.body, case.reference
    states = case.states(20)
    for q, v, _, _ in states:
        assert_near(ours.kinetic_energy(q, v), theirs.kinetic_energy(q, v), 'kinetic energy')
    # Each engine counts from a height of its own.
    potential = np.array([ours.potential_energy(s.q) for s in states])
    expected = np.array([theirs.potential_energy(s.q) for s in states])
    assert_near(np.diff(potential), np.diff(expected), 'difference of potential energies')


@on_engines
@on_robots
def test_forward_dynamics(engine, robot):
    case = plain(engine, robot)
    for state in case.states(20):
        q, v, _, tau = state
        assert_same_motion(case.body.forward_dynamics(q, v, tau), case.reference, state)
        wrenches = case.wrenches(2)
        a = case.body.forward_dynamics(q, v, tau, wrenches)
        assert_same_motion(a, case.reference, state, wrenches_of(wrenches))


@on_engines
@on_robots
def test_coriolis_matrix(engine, robot):
    """C v against the engine's, and C from the derivatives of the engine's own M."""
    case = plain(engine, robot)
    for q, v, _, _ in case.states(1 if case.arm.joint_count > 40 else 3):
        C = case.body.coriolis_matrix(q, v)
        c = case.reference.christoffel(q)
        assert_near(C @ v, case.reference.coriolis(q, v), 'C v')
        assert_near(case.body.christoffel_symbols(q), c, 'c')
        assert_near(C, c @ v, 'C')


@on_engines
@on_robots
def test_batch(engine, robot):
    case = plain(engine, robot)
    states = case.states(20)
    q, v, a = (np.array([state[i] for state in states]) for i in range(3))
    tau = case.body.inverse_dynamics_batch(q, v, a)
    assert_near(
        tau, np.array([case.reference.inverse_dynamics(*s[:3]) for s in states]), 'batch')
    one_by_one = np.array([case.body.inverse_dynamics(*s[:3]) for s in states])
    assert deviation(tau, one_by_one) <= 1e-12
    assert deviation(case.body.inverse_dynamics_batch(q, v, a, threads=2), one_by_one) <= 1e-12


@on_engines
@pytest.mark.parametrize('robot', by_kind(ARMS))
def test_gravity_of_any_direction(engine, robot):
    """An arm on a wall or a ceiling."""
    case = make_case(engine, description(robot), gravity=(3.1, -7.2, 4.4))
    for q, v, a, _ in case.states(20):
        assert_near(case.body.gravity(q), case.reference.gravity(q), 'g')
        assert_near(
            case.body.inverse_dynamics(q, v, a), case.reference.inverse_dynamics(q, v, a), 'tau')


def random_payloads(arm: ArmModel, rng: np.random.Generator) -> list[Payload]:
    """Return loads on three links, two on the last of them."""
    first, second, third = rng.choice(arm.link_names, 3, replace=False)
    loads = []
    for link in (first, second, third, third):
        spread = rng.normal(size=(3, 3)) * 0.1
        second_moment = spread @ spread.T
        inertia = np.trace(second_moment) * np.eye(3) - second_moment
        loads.append(
            make_payload(str(link), rng.uniform(0.2, 4.0), rng.normal(size=3) * 0.2, inertia))
    return loads


@on_engines
@on_robots
def test_payloads(engine, robot):
    loads = random_payloads(plain(engine, robot).arm, np.random.default_rng(7))
    urdf = description(robot)
    case = make_case(engine, urdf, theirs=with_payloads(urdf, loads))
    ours, theirs = RigidBody(case.arm.with_payloads(loads)), case.reference
    states = case.states(20)
    for state in states:
        q, v, a, tau = state
        assert_near(ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a), 'tau')
        assert_near(ours.mass_matrix(q), theirs.mass_matrix(q), 'M')
        assert_near(ours.gravity(q), theirs.gravity(q), 'g')
        assert_same_motion(ours.forward_dynamics(q, v, tau), theirs, state)
    potential = np.array([ours.potential_energy(s.q) for s in states])
    expected = np.array([theirs.potential_energy(s.q) for s in states])
    assert_near(np.diff(potential), np.diff(expected), 'difference of potential energies')


@on_engines
@on_robots
def test_joints_in_any_order(engine, robot):
    """A request in an order of its own, mimic joints among its names, is answered by name."""
    case = plain(engine, robot)
    tree = case.reference.engine.joint_names
    G, arm = case.reference.G, case.arm
    for q, v, a, _ in case.states(20):
        shuffled = [str(name) for name in case.rng.permutation(tree)]
        order = JointOrder(arm, shuffled)
        rows = [tree.index(name) for name in shuffled]
        motion = (
            order.position(case.reference.tree(q)[rows]), order.rate((G @ v)[rows], 'velocity'),
            order.rate((G @ a)[rows], 'acceleration'))
        answer = dict(zip(order.names, order.answer(case.body.inverse_dynamics(*motion))))
        expected = dict(zip(arm.joint_names, case.reference.inverse_dynamics(q, v, a)))
        assert answer.keys() == expected.keys()
        assert list(order.names) == [name for name in shuffled if name in expected]
        assert_near(
            np.array([answer[name] for name in expected]), np.array([*expected.values()]), 'tau')
        M = order.answer_form(case.body.mass_matrix(motion[0]))
        back = [order.names.index(name) for name in arm.joint_names]
        assert_near(M[np.ix_(back, back)], case.reference.mass_matrix(q), 'M')
        # An effort at a mimic joint counts at its leader.
        everywhere = case.rng.normal(size=len(tree)) * 10
        given = order.effort(everywhere[rows])
        assert_near(given, G.T @ everywhere, 'effort')


def halves(names: Sequence[str]) -> list[list[str]]:
    """Return the joints in two halves, each in an order of its own."""
    shuffled = [str(name) for name in np.random.default_rng(11).permutation(names)]
    return [shuffled[::2], shuffled[1::2]]


@on_engines
@on_robots
def test_locked_joints(engine, robot):
    """Half of the joints, and the others stay where they are; then the other way round."""
    for names in halves(plain(engine, robot).arm.joint_names):
        case = make_case(engine, description(robot), joints=names)
        ours, theirs = case.body, case.reference
        for state in case.states(10):
            q, v, a, tau = state
            wrenches = case.wrenches(2)
            assert_near(
                ours.inverse_dynamics(q, v, a, wrenches),
                theirs.inverse_dynamics(q, v, a, wrenches_of(wrenches)), 'tau')
            assert_near(ours.mass_matrix(q), theirs.mass_matrix(q), 'M')
            assert_near(ours.kinetic_energy(q, v), theirs.kinetic_energy(q, v), 'kinetic energy')
            assert_same_motion(ours.forward_dynamics(q, v, tau), theirs, state)


def compare_with_friction(engine: str, urdf: str, joints: Sequence[str] = ()) -> None:
    """Compare damping with the engine's own, and Coulomb friction by the power at each joint."""
    tree, rng = list(moving_joints(urdf)), np.random.default_rng(13)
    damping, coulomb = rng.uniform(0.1, 5.0, len(tree)), rng.uniform(0.1, 5.0, len(tree))
    urdf = with_friction(urdf, dict(zip(tree, damping)), dict(zip(tree, coulomb)))
    case = make_case(engine, urdf, joints=joints, damping=True)
    dynamics, theirs = ArmDynamics(case.arm), case.reference
    for state in case.states(20):
        q, v, a, tau = state
        dry = theirs.G.T @ (coulomb * np.sign(theirs.G @ v))
        assert_near(
            dynamics.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a) + dry, 'tau')
        assert_same_motion(dynamics.forward_dynamics(q, v, tau + dry), theirs, state)


@on_engines
@on_robots
def test_friction(engine, robot):
    compare_with_friction(engine, description(robot))


@on_engines
@pytest.mark.parametrize('robot', by_kind(MIMIC))
def test_mimic_joints_of_any_relation(engine, robot):
    """Multipliers of any size, offsets and a chain of leaders; the robots' own are ±1 and 0."""
    urdf = with_other_relations(description(robot), np.random.default_rng(17))
    case = make_case(engine, urdf)
    ours, theirs = case.body, case.reference
    assert theirs.G.shape[0] > theirs.G.shape[1]
    for q, v, a, _ in case.states(20):
        assert_near(ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q, v, a), 'tau')
        assert_near(ours.kinetic_energy(q, v), theirs.kinetic_energy(q, v), 'kinetic energy')
        assert_near(ours.coriolis_matrix(q, v) @ v, theirs.coriolis(q, v), 'C v')
    for names in ((), *halves(case.arm.joint_names)):
        compare_with_friction(engine, urdf, names)


def test_missing_engine_is_skipped(monkeypatch):
    monkeypatch.delenv('CI', raising=False)
    with pytest.raises(pytest.skip.Exception, match='not installed'):
        load('no_such_engine', 'no-such-engine')


@pytest.mark.skipif(
    (sys.platform, platform.machine()) != ('linux', 'x86_64'),
    reason='not every engine has a wheel for this platform')
def test_missing_engine_fails_in_ci(monkeypatch):
    monkeypatch.setenv('CI', 'true')
    with pytest.raises(pytest.fail.Exception, match='not installed'):
        load('no_such_engine', 'no-such-engine')
