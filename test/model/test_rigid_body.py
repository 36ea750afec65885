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
The laws of the manipulator equation, on random trees and on real robots.

`Mechanics` is what they are compared with: the energies of a URDF from its frames alone, written
here from the definitions, without an engine.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple
from xml.etree import ElementTree

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.analysis.residual import model_terms
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.rigid_body import RigidBody
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf

GRAVITY = np.array([0.0, 0.0, -9.81])
REAL = ('kinova', 'panda', 'pr2', 'talos_left_arm', 'tiago_pro', 'ur10', 'z1')

laws = settings(deadline=None, derandomize=True, max_examples=40)
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
    # The moments of a solid box, turned by the origin's angles.
    return (
        f'<inertial><origin xyz="{text(rng.normal(0, 0.2, 3))}" '
        f'rpy="{text(rng.uniform(-3, 3, 3))}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{mass * (b*b + c*c) / 12!r}" iyy="{mass * (a*a + c*c) / 12!r}" '
        f'izz="{mass * (a*a + b*b) / 12!r}" ixy="0" ixz="0" iyz="0"/></inertial>')


def random_urdf(rng: np.random.Generator, mimic: bool = True) -> str:
    """
    Return a tree with every kind of joint, mimics of mimics, and links without inertia.

    Every leaf has inertia, so the mass matrix is regular. Names, and with them the order of the
    engine, have nothing to do with the order of the document.
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
        if mimic and kind != 'fixed' and i > 0 and rng.random() < 0.35:
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
    """An arm and a state of it, with a rng for whatever else a test wants."""

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


@pytest.fixture(params=REAL)
def real(request):
    return case_of(robot_urdf(request.param), np.random.default_rng(7), some_locked=False)


def directions(case: Case) -> np.ndarray:
    return case.rng.normal(0, 1, (4, case.arm.joint_count))


def slope(function: Any, x: np.ndarray, along: np.ndarray, h: float) -> Any:
    """Return the derivative of function along a direction, with an error of order h⁴."""
    near = function(x + h * along) - function(x - h * along)
    far = function(x + 2 * h * along) - function(x - 2 * h * along)
    return (8 * near - far) / (12 * h)


# --- the generator reaches what it is there for --------------------------------------------------

def test_random_trees_have_every_feature():
    seen = set()
    for seed in range(60):
        case = random_case(seed)
        root = ElementTree.fromstring(case.urdf)
        seen |= {joint.get('type') for joint in root.findall('joint')}
        relations = {
            joint.get('name'): joint.find('mimic').get('joint') for joint in root.findall('joint')
            if joint.find('mimic') is not None and joint.get('type') != 'fixed'}
        parents = [joint.find('parent').get('link') for joint in root.findall('joint')]
        for feature, there in (
            ('mimic of a mimic', any(leader in relations for leader in relations.values())),
            ('mimic of a locked joint',
             any(leader in case.arm.locked_joints for leader in relations.values())),
            ('mimic of an actuated joint', bool(case.arm.mimic_joints)),
            ('locked away from 0', any(case.arm.locked_joints.values())),
            ('branches', len(set(parents)) < len(parents)),
            ('massless link', any(
                link.find('inertial') is None for link in root.findall('link'))),
            ('plain order', case.arm.coordinates.is_identity),
            ('another order', case.arm.coordinates.is_permutation
             and not case.arm.coordinates.is_identity),
        ):
            if there:
                seen.add(feature)
    assert seen == {
        'revolute', 'continuous', 'prismatic', 'fixed', 'mimic of a mimic', 'branches',
        'mimic of a locked joint', 'mimic of an actuated joint', 'locked away from 0',
        'massless link', 'plain order', 'another order'}


# --- laws, each stated once and held against random trees and real robots ------------------------

def mass_matrix_is_symmetric_and_positive(case):
    M = case.body.mass_matrix(case.q)
    assert M.shape == (case.arm.joint_count,) * 2
    npt.assert_allclose(M, M.T, rtol=0, atol=1e-12 * abs(M).max())
    assert np.linalg.eigvalsh(M)[0] > 0.0


def mass_matrix_is_of_the_kinetic_energy(case):
    mechanics, M = case.mechanics(), case.body.mass_matrix(case.q)
    for v in directions(case):
        expected = mechanics.kinetic_energy(case.q, v)
        assert 0.5 * v @ M @ v == pytest.approx(expected, rel=1e-7)
        assert case.body.kinetic_energy(case.q, v) == pytest.approx(expected, rel=1e-7)


def potential_energy_is_of_the_masses(case):
    """All masses count, including those fixed to the base."""
    expected = case.mechanics().potential_energy(case.q)
    ours = (
        case.body.potential_energy(case.q), case.body.potential_energy_batch(case.q[None])[0],
        case.body.terms(case.q, case.v, case.a).potential_energy)
    assert ours == pytest.approx(np.full(3, expected), rel=1e-9, abs=1e-9)


def rotors_have_their_share_of_the_kinetic_energy(case):
    """Kinetic energy: that of the links and ½ N² J_r v² per joint of any type and axis."""
    arm, n = case.arm, case.arm.joint_count
    geared = ArmDynamics(arm.with_actuators(make_actuators(
        arm.joint_names, [0.1], case.rng.uniform(-120, 120, n),
        rotor_inertia=case.rng.uniform(1e-6, 1e-4, n))))
    inertia = geared.arm.actuators.reflected_inertia
    for v in directions(case):
        expected = case.mechanics().kinetic_energy(case.q, v) + 0.5 * inertia @ v**2
        along = model_terms(geared, *np.array([[case.q], [v], [case.a]]))
        ours = (
            geared.rigid_body.kinetic_energy(case.q, v),
            geared.rigid_body.terms(case.q, v, case.a).kinetic_energy, along.kinetic_energy[0])
        assert ours == pytest.approx(np.full(3, expected), rel=1e-7)


def gravity_is_the_slope_of_the_potential_energy(case):
    mechanics, g = case.mechanics(), case.body.gravity(case.q)
    for along in directions(case):
        expected = slope(mechanics.potential_energy, case.q, along, 1e-3)
        assert g @ along == pytest.approx(expected, rel=1e-6, abs=1e-6)


def christoffel_symbols_are_of_the_mass_matrix(case):
    c, n = case.body.christoffel_symbols(case.q), case.arm.joint_count
    assert c.shape == (n, n, n)
    npt.assert_allclose(c, c.transpose(0, 2, 1), rtol=0, atol=1e-13 * max(1.0, abs(c).max()))
    dM = np.stack(
        [slope(case.body.mass_matrix, case.q, e, 1e-3) for e in np.eye(n)], axis=-1)
    # c_ijk = ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_jk/∂q_i), dM[i, j, k] = ∂M_ij/∂q_k
    expected = 0.5 * (dM + dM.transpose(0, 2, 1) - dM.transpose(2, 0, 1))
    npt.assert_allclose(c, expected, rtol=0, atol=1e-8 * max(1.0, abs(c).max()))


def coriolis_matrix_is_of_the_christoffel_symbols(case):
    C = case.body.coriolis_matrix(case.q, case.v)
    c = case.body.christoffel_symbols(case.q)
    scale = max(1.0, abs(C).max())
    npt.assert_allclose(
        C, np.einsum('ijk,k->ij', c, case.v), rtol=0, atol=1e-12 * scale)
    nonlinear = case.body.nonlinear(case.q, case.v) - case.body.gravity(case.q)
    npt.assert_allclose(
        C @ case.v, nonlinear, rtol=0, atol=1e-11 * max(scale, abs(nonlinear).max(), 100.0))


def mass_matrix_rate_minus_twice_coriolis_is_skew(case):
    M_rate = slope(case.body.mass_matrix, case.q, case.v, 1e-3)
    S = M_rate - 2.0 * case.body.coriolis_matrix(case.q, case.v)
    npt.assert_allclose(S, -S.T, rtol=0, atol=1e-7 * max(1.0, abs(M_rate).max()))


def forward_dynamics_undoes_inverse_dynamics(case):
    dynamics = ArmDynamics(case.arm)
    for wrenches in ((), case.wrenches()):
        tau = dynamics.inverse_dynamics(case.q, case.v, case.a, wrenches)
        a = dynamics.forward_dynamics(case.q, case.v, tau, wrenches)
        M = case.body.mass_matrix(case.q)
        # The acceleration is as exact as the effort is, as far as M lets it be.
        npt.assert_allclose(
            M @ (a - case.a), 0.0, rtol=0, atol=1e-10 * max(1.0, abs(tau).max()))
        npt.assert_allclose(a, case.a, rtol=0, atol=1e-12 * np.linalg.cond(M) * abs(tau).max())


def power_is_the_rate_of_energy_and_what_friction_takes(case):
    dynamics = ArmDynamics(case.arm)

    def energy(t: np.ndarray) -> np.ndarray:
        q, v = case.q + case.v * t + 0.5 * case.a * t**2, case.v + case.a * t
        return np.array(case.body.kinetic_energy(q, v) + case.body.potential_energy(q))

    rate = float(slope(energy, np.array(0.0), np.array(1.0), 1e-3))
    taken = case.arm.friction.effort(case.v) @ case.v
    assert taken >= 0.0
    tau = dynamics.inverse_dynamics(case.q, case.v, case.a)
    scale = abs(tau) @ abs(case.v)
    assert tau @ case.v - taken == pytest.approx(rate, abs=1e-6 * max(1.0, scale))


def wrenches_do_the_work_of_their_links(case):
    mechanics, wrenches = case.mechanics(), case.wrenches()
    effort = case.body.external(case.q, wrenches)
    for v in directions(case):
        twists = mechanics.twists(case.q, v)
        power = sum(
            w.force @ twists[w.link][0] + w.torque @ twists[w.link][1] for w in wrenches)
        assert effort @ v == pytest.approx(-power, rel=1e-7, abs=1e-6)


def terms_add_up(case):
    wrenches = case.wrenches()
    terms = ArmDynamics(case.arm).terms(case.q, case.v, case.a, wrenches)
    total = terms.inertial + terms.coriolis + terms.gravity + terms.friction + terms.external
    npt.assert_array_equal(total, terms.effort)
    npt.assert_allclose(
        terms.effort, ArmDynamics(case.arm).inverse_dynamics(case.q, case.v, case.a, wrenches),
        rtol=0, atol=1e-11 * max(1.0, abs(terms.effort).max(), abs(terms.external).max()))
    near = {'rtol': 1e-9, 'atol': 1e-9 * max(1.0, abs(terms.effort).max())}
    M = case.body.mass_matrix(case.q)
    npt.assert_allclose(terms.inertial, M @ case.a, **near)
    npt.assert_allclose(
        terms.coriolis, case.body.coriolis_matrix(case.q, case.v) @ case.v, **near)
    npt.assert_allclose(terms.gravity, case.body.gravity(case.q), **near)
    npt.assert_array_equal(terms.friction, case.arm.friction.effort(case.v))
    npt.assert_array_equal(terms.external, case.body.external(case.q, wrenches))
    assert terms.kinetic_energy == pytest.approx(
        case.body.kinetic_energy(case.q, case.v), rel=1e-9)
    assert terms.potential_energy == case.body.potential_energy(case.q)


def inverse_dynamics_is_affine_in_the_acceleration(case):
    M, rest = case.body.mass_matrix(case.q), case.body.nonlinear(case.q, case.v)
    tau = case.body.inverse_dynamics(case.q, case.v, case.a)
    npt.assert_allclose(
        tau, M @ case.a + rest, rtol=0, atol=1e-11 * max(1.0, abs(tau).max(), abs(rest).max()))


def batch_is_the_single_ones(case):
    dynamics, n = ArmDynamics(case.arm), case.arm.joint_count
    q, v, a = case.rng.normal(0, 2, (3, 5, n))
    expected = np.array([dynamics.inverse_dynamics(*state) for state in zip(q, v, a)])
    for threads in (1, 2):
        batch = dynamics.inverse_dynamics_batch(q, v, a, threads)
        npt.assert_allclose(batch, expected, rtol=0, atol=1e-11 * max(1.0, abs(expected).max()))
    assert dynamics.inverse_dynamics_batch(q[:0], v[:0], a[:0]).shape == (0, n)


@pytest.mark.parametrize('samples', [1, 500, 501, 1203])
def test_a_batch_of_any_size_is_the_single_ones(samples):
    body = UncheckedRigidBody(load_arm(default_arm_urdf()))
    q, v, a = np.random.default_rng(samples).normal(0, 2, (3, samples, 2))
    # as it is done by a Pinocchio without OpenMP
    one_by_one = body._rnea_one_by_one(q, v, a)
    assert one_by_one.shape == (samples, 2)
    npt.assert_array_equal(one_by_one[-1], body.inverse_dynamics(q[-1], v[-1], a[-1]))
    npt.assert_allclose(body.inverse_dynamics_batch(q, v, a), one_by_one, rtol=0, atol=1e-11)


def order_of_joints_is_the_order_of_everything(case):
    p = case.rng.permutation(case.arm.joint_count)
    arm = load_arm(case.urdf, [case.arm.joint_names[i] for i in p])
    assert arm.locked_joints == case.arm.locked_joints
    q, v, a, wrenches = case.q, case.v, case.a, case.wrenches()
    ours, other = ArmDynamics(case.arm), ArmDynamics(arm)
    close = {'rtol': 1e-10, 'atol': 1e-9}
    npt.assert_allclose(
        other.inverse_dynamics(q[p], v[p], a[p], wrenches),
        ours.inverse_dynamics(q, v, a, wrenches)[p], **close)
    npt.assert_allclose(
        other.rigid_body.mass_matrix(q[p]), case.body.mass_matrix(q)[np.ix_(p, p)], **close)
    npt.assert_allclose(
        other.rigid_body.christoffel_symbols(q[p]),
        case.body.christoffel_symbols(q)[np.ix_(p, p, p)], **close)
    for name in ('lower', 'upper', 'velocity', 'effort'):
        npt.assert_array_equal(getattr(arm.limits, name), getattr(case.arm.limits, name)[p])
    npt.assert_array_equal(arm.friction.viscous, case.arm.friction.viscous[p])
    npt.assert_array_equal(arm.friction.coulomb, case.arm.friction.coulomb[p])
    assert arm.joint_kinds == tuple(case.arm.joint_kinds[i] for i in p)


LAWS = (
    mass_matrix_is_symmetric_and_positive,
    mass_matrix_is_of_the_kinetic_energy,
    rotors_have_their_share_of_the_kinetic_energy,
    potential_energy_is_of_the_masses,
    gravity_is_the_slope_of_the_potential_energy,
    christoffel_symbols_are_of_the_mass_matrix,
    coriolis_matrix_is_of_the_christoffel_symbols,
    mass_matrix_rate_minus_twice_coriolis_is_skew,
    forward_dynamics_undoes_inverse_dynamics,
    power_is_the_rate_of_energy_and_what_friction_takes,
    wrenches_do_the_work_of_their_links,
    terms_add_up,
    inverse_dynamics_is_affine_in_the_acceleration,
    batch_is_the_single_ones,
    order_of_joints_is_the_order_of_everything,
)


@pytest.mark.parametrize('law', LAWS, ids=lambda law: law.__name__)
@laws
@given(case=random_cases)
def test_law_on_random_trees(law, case):
    law(case)


@pytest.mark.parametrize('law', LAWS, ids=lambda law: law.__name__)
def test_law_on_real_robots(law, real):
    law(real)


# --- joints that are not actuated ----------------------------------------------------------------

@laws
@given(seed=seeds)
def test_locking_joints_leaves_the_block_of_the_others(seed):
    rng = np.random.default_rng(seed)
    urdf = random_urdf(rng, mimic=False)
    whole = load_arm(urdf)
    kept = [str(name) for name in rng.permutation(whole.joint_names)][
        :int(rng.integers(1, whole.joint_count + 1))]
    arm = load_arm(urdf, kept)
    index = [whole.joint_names.index(name) for name in kept]
    q, v, a = rng.normal(0, 1, (3, len(kept)))
    q_whole = np.array([arm.locked_joints.get(name, 0.0) for name in whole.joint_names])
    v_whole, a_whole = np.zeros((2, whole.joint_count))
    q_whole[index], v_whole[index], a_whole[index] = q, v, a
    npt.assert_allclose(
        RigidBody(arm).mass_matrix(q),
        RigidBody(whole).mass_matrix(q_whole)[np.ix_(index, index)], rtol=1e-10, atol=1e-10)
    npt.assert_allclose(
        RigidBody(arm).inverse_dynamics(q, v, a),
        RigidBody(whole).inverse_dynamics(q_whole, v_whole, a_whole)[index],
        rtol=1e-10, atol=1e-9)


# --- gravity -------------------------------------------------------------------------------------

@laws
@given(seed=seeds)
def test_turning_gravity_is_turning_the_base(seed):
    case = random_case(seed, some_locked=False)
    rpy = case.rng.uniform(-3, 3, 3)
    x, y, z = np.eye(3)
    R = turn(z, rpy[2]) @ turn(y, rpy[1]) @ turn(x, rpy[0])
    mounted = case.urdf.replace(
        '</robot>',
        '<link name="floor"/><joint name="mount" type="fixed"><parent link="floor"/>'
        f'<child link="link0"/><origin rpy="{text(rpy)}"/></joint></robot>')
    expected = RigidBody(load_arm(mounted)).inverse_dynamics(case.q, case.v, case.a)
    tilted = load_arm(case.urdf, gravity=R.T @ GRAVITY)
    ours = RigidBody(tilted).inverse_dynamics(case.q, case.v, case.a)
    npt.assert_allclose(ours, expected, rtol=0, atol=1e-10 * max(1.0, abs(expected).max()))


def test_without_gravity_nothing_is_needed_to_hold_the_arm():
    case = random_case(3)
    arm = load_arm(case.urdf, case.arm.joint_names, gravity=(0, 0, 0))
    npt.assert_array_equal(RigidBody(arm).gravity(case.q), np.zeros(arm.joint_count))
    assert abs(case.body.gravity(case.q)).max() > 0.1


# --- details -------------------------------------------------------------------------------------

def test_continuous_joints_turn_round_and_round():
    case = case_of(robot_urdf('kinova'), np.random.default_rng(1), some_locked=False)
    turns = np.array([2 * np.pi if kind == 'continuous' else 0.0 for kind in case.arm.joint_kinds])
    assert turns.any()
    npt.assert_allclose(
        case.body.inverse_dynamics(case.q + 3 * turns, case.v, case.a),
        case.body.inverse_dynamics(case.q, case.v, case.a), rtol=0, atol=1e-10)


@pytest.mark.parametrize('some_locked', [False, True])
def test_results_are_new_and_inputs_are_left_alone(some_locked):
    case = random_case(5, some_locked=some_locked)
    body, q, v, a, wrenches = case.body, case.q, case.v, case.a, case.wrenches()
    before = [array.copy() for array in (q, v, a)]
    functions = (
        lambda q: body.inverse_dynamics(q, v, a),
        lambda q: body.inverse_dynamics(q, v, a, wrenches),
        body.gravity,
        lambda q: body.nonlinear(q, v),
        lambda q: body.external(q, wrenches),
        lambda q: body.inverse_dynamics_batch(q[None], v[None], a[None]),
        body.mass_matrix,
        lambda q: body.coriolis_matrix(q, v),
        body.christoffel_symbols,
        lambda q: body.forward_dynamics(q, v, a),
        lambda q: body.forward_dynamics(q, v, a, wrenches),
    )
    for function in functions:
        first = function(q)
        kept = first.copy()
        function(q + 1.0)
        npt.assert_array_equal(first, kept)
    for array, copy in zip((q, v, a), before):
        npt.assert_array_equal(array, copy)


def test_no_wrench_is_no_effort():
    case = random_case(11)
    npt.assert_array_equal(
        case.body.external(case.q, ()), np.zeros(case.arm.joint_count))


def test_a_wrench_at_the_base_link_is_borne_by_the_base():
    case = random_case(12)
    wrench = ExternalWrench('link0', np.full(3, 50.0), np.full(3, 9.0))
    npt.assert_array_equal(
        case.body.external(case.q, [wrench]), np.zeros(case.arm.joint_count))


def test_a_wrench_at_an_unknown_link_is_refused():
    case = random_case(13)
    wrench = ExternalWrench('gripper', np.zeros(3), np.zeros(3))
    for call in (
        lambda: case.body.external(case.q, [wrench]),
        lambda: case.body.inverse_dynamics(case.q, case.v, case.a, [wrench]),
        lambda: case.body.forward_dynamics(case.q, case.v, case.a, [wrench]),
    ):
        with pytest.raises(InvalidInputError, match="frame_id is 'gripper', expected .*'link0'"):
            call()


@pytest.mark.parametrize('joints', [(), ('b', 'a'), ('b',)])
def test_forward_dynamics_of_a_joint_that_moves_no_mass_is_refused(joints):
    urdf = (
        '<robot name="light"><link name="base"/>'
        f'<link name="arm">{random_inertial(np.random.default_rng(0))}</link><link name="tip"/>'
        '<joint name="a" type="continuous"><parent link="base"/><child link="arm"/></joint>'
        '<joint name="b" type="continuous"><parent link="arm"/><child link="tip"/></joint>'
        '</robot>')
    body = RigidBody(load_arm(urdf, joints))
    x = np.ones(body.arm.joint_count)
    assert np.isfinite(body.inverse_dynamics(x, x, x)).all()
    with pytest.raises(InvalidInputError, match='mass matrix is singular, expected every joint'):
        body.forward_dynamics(x, x, x)
