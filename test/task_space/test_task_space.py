# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Task space against MuJoCo and Drake, its laws at a rank loss, and its errors.

Inverse kinematics: the pose is reached within the limits, or refused with the residual.
"""

from functools import partial
import re

from engine_cases import Case, ENGINES, make_case, with_other_relations, with_payloads
from engines import Array
from hypothesis import given, settings
from hypothesis import strategies as st
import largest_error
from lock_step_loop import smooth_arm
import numpy as np
import pinocchio as pin
import pytest
from random_trees import laws, random_cases
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.task_space import TaskSpace, TaskSpaceState
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, last_link, rotation_vector
from robot_dynamics.task_space.inverse_kinematics import joints_at
from robots import robot_urdf

pytestmark = pytest.mark.usefixtures('largest_error')
TOLERANCE = 1e-9
assert_near = partial(largest_error.assert_near, TOLERANCE)
ROBOTS = 'default', 'ur5', 'panda', 'talos_full_v2'
"""Two to 45 joints; panda with prismatic joints, the last two with mimic joints."""
POINT = np.array([0.05, -0.1, 0.2])


def far_link(arm: ArmModel) -> str:
    """Return a link that most joints move."""
    v = np.ones(arm.joint_count)
    moved = [np.count_nonzero(TaskSpace(arm, link).at(v).jacobian.any(axis=0))
             for link in arm.link_names]
    return arm.link_names[int(np.argmax(moved))]


def loaded_case(engine: str, robot: str) -> tuple[Case, ArmModel, Array]:
    """Return the case of a robot with payload, its arm with rotors as well, and their inertia."""
    urdf = robot_urdf(robot)
    if robot == 'talos_full_v2':
        urdf = with_other_relations(urdf, np.random.default_rng(1))
    arm = load_arm(urdf)
    load = make_payload(far_link(arm), 1.3, (0.1, 0.02, -0.05), np.diag([0.01, 0.02, 0.015]))
    case = make_case(engine, urdf, theirs=with_payloads(urdf, [load]))
    rotors = np.random.default_rng(2).uniform(0.0, 0.4, arm.joint_count)
    return case, case.arm.with_payloads([load]).with_reflected_inertia(rotors), np.diag(rotors)


def in_link_axes(rotation: Array, J: Array, bias: Array, v: Array) -> tuple[Array, Array]:
    """Return J and J̇ q̇ with components along the axes of the link: d(Rᵀ v) = Rᵀ a − ω × v."""
    turned = np.kron(np.eye(2), rotation.T)
    twist = turned @ J @ v
    omega = twist[3:]
    return turned @ J, turned @ bias - np.concatenate(
        [np.cross(omega, twist[:3]), np.cross(omega, omega)])


@pytest.mark.parametrize('robot', ROBOTS)
@pytest.mark.parametrize('engine', ENGINES)
def test_every_quantity_of_an_engine(engine, robot):
    case, arm, rotors = loaded_case(engine, robot)
    link, theirs = far_link(arm), case.reference
    for reference in ('base_aligned', 'local'):
        task = TaskSpace(arm, link, POINT, reference)
        for q, v, _, _ in case.states(3):
            state = task.at(q, v)
            point, rotation, J, bias = theirs.point_motion(q, v, link, POINT)
            if reference == 'local':
                J, bias = in_link_axes(rotation, J, bias, v)
            M = theirs.mass_matrix(q) + rotors
            for name, expected in (
                    ('translation', point), ('rotation', rotation), ('jacobian', J),
                    ('bias_acceleration', bias), ('mass_matrix', M)):
                assert_near(getattr(state, name), expected, name)
            assert_near(state.joint_gravity, theirs.gravity(q), 'g')
            assert_near(state.joint_coriolis, theirs.coriolis(q, v), 'C v')
            assert_near(state.inverse_inertia, J @ np.linalg.solve(M, J.T), 'inverse of inertia')
            assert_equation_of_motion(state, case, q, v)


def assert_equation_of_motion(state: TaskSpaceState, case: Case, q: Array, v: Array) -> None:
    """Compare the acceleration under Jᵀ F, with M, C q̇ and g of the engine, with Λ v̇ + μ + p."""
    if state.rank < 6:
        return
    F = case.rng.normal(size=6) * 10.0
    M = state.mass_matrix
    a = np.linalg.solve(
        M, state.jacobian.T @ F - case.reference.coriolis(q, v) - case.reference.gravity(q))
    acceleration = state.jacobian @ a + state.bias_acceleration
    force = state.inertia @ acceleration + state.coriolis_force + state.gravity_force
    scale = np.abs(state.inertia).max() * np.abs(acceleration).max()
    error = float(np.abs(force - F).max() / max(scale, 1.0))
    largest_error.assert_small(error, TOLERANCE, 'Lambda v + mu + p')


@laws
@given(case=random_cases)
def test_laws_on_random_trees(case):
    """Mimics of mimics, locked joints, branches, and any number of joints."""
    rng, n = case.rng, case.arm.joint_count
    for link in (rng.choice(case.arm.link_names), far_link(case.arm)):
        state = TaskSpace(case.arm, str(link), rng.normal(size=3)).batch(
            singular_positions(rng, 20, n), rng.normal(size=(20, n)))
        assert_laws(state, rng)


def singular_positions(rng: np.random.Generator, count: int, n: int) -> Array:
    """Return random positions (count, n), half of them with many exact right angles."""
    q = rng.uniform(-np.pi, np.pi, (count, n))
    right = 0.5 * np.pi * rng.integers(-2, 3, (count, n))
    turned = rng.random((count, n)) < 0.7
    turned[count // 2:] = False
    return np.where(turned, right, q)


def assert_laws(state: TaskSpaceState, rng: np.random.Generator) -> None:
    """Check the laws that hold at any rank, for many states."""
    quantities = {name: getattr(state, name) for name in (
        'inverse_inertia', 'inertia', 'dynamic_inverse', 'gravity_force', 'coriolis_force',
        'directions', 'translation_singular_values', 'rotation_singular_values',
        'translation_manipulability', 'rotation_manipulability', 'position_margin')}
    for name, value in quantities.items():
        assert not np.isnan(value).any(), name
    J, inverse = state.jacobian, state.dynamic_inverse
    kept = np.arange(6) < state.rank[:, np.newaxis]
    U = np.swapaxes(state.directions, 1, 2)
    range_projection = (U * kept[:, np.newaxis]) @ np.swapaxes(U, 1, 2)
    np.testing.assert_allclose(J @ inverse, range_projection, atol=1e-8)
    np.testing.assert_allclose(J @ inverse @ J, J, atol=1e-8)
    # lost directions: no joint motion moves the point along them
    np.testing.assert_allclose(
        (U * ~kept[:, np.newaxis]).swapaxes(1, 2) @ J, np.zeros_like(J), atol=1e-7)
    # an effort Jᵀ F is the force F, without the part that nothing transmits
    F = rng.normal(size=(len(J), 6, 1))
    force = inverse.swapaxes(1, 2) @ J.swapaxes(1, 2) @ F
    np.testing.assert_allclose(force, range_projection @ F, atol=1e-8)
    # what gravity leaves to the null space accelerates nothing in the task
    rest = state.joint_gravity[..., np.newaxis] - (
        J.swapaxes(1, 2) @ state.gravity_force[..., np.newaxis])
    acceleration = J @ np.linalg.solve(state.mass_matrix, rest)
    free = J @ np.linalg.solve(state.mass_matrix, state.joint_gravity[..., np.newaxis])
    assert np.abs(acceleration).max() <= 1e-5 * np.abs(free).max()  # rounding near rank losses


def test_every_distance_to_a_singularity():
    """The wrist of an arm from 1 rad to 1e-18 rad of its singularity, and exactly in it."""
    q = np.tile([0.3, -1.0, 1.2, 0.4, 0.0, 0.5], (20, 1))
    q[:19, 4] = 10.0 ** -np.arange(19)
    state = TaskSpace(load_arm(robot_urdf('ur5')), 'tool0').batch(q, np.ones_like(q))
    assert (np.diff(state.rank) <= 0).all()
    assert (state.rank[0], state.rank[-1]) == (6, 5)
    assert_laws(state, np.random.default_rng(7))
    np.testing.assert_allclose(np.abs(state.directions[-1, 5]) @ np.abs(
        state.directions[15, 5]), 1.0, atol=1e-6)


def test_one_state_and_many_are_equal():
    arm = load_arm(robot_urdf('panda'))
    task, rng = TaskSpace(arm, 'panda_link8', POINT), np.random.default_rng(6)
    q, v = rng.normal(size=(5, 8)), rng.normal(size=(5, 8))
    many = task.batch(q, v)
    for i in range(5):
        one = task.at(q[i], v[i])
        for name in ('jacobian', 'bias_acceleration', 'inertia', 'gravity_force', 'rank',
                     'coriolis_force', 'rotation_manipulability', 'position_margin'):
            np.testing.assert_allclose(
                getattr(one, name), getattr(many, name)[i], rtol=1e-9, atol=1e-12)
    assert task.batch(np.zeros((0, 8))).inertia.shape == (0, 6, 6)
    assert not task.at(q[0]).joint_coriolis.any()


def test_manipulability_and_margins():
    arm = load_arm(robot_urdf('panda'))
    q = np.full(8, 0.02)
    state = TaskSpace(arm, 'panda_link8').at(q)
    for half, value in ((state.jacobian[:3], state.translation_manipulability),
                        (state.jacobian[3:], state.rotation_manipulability)):
        np.testing.assert_allclose(value, np.sqrt(np.linalg.det(half @ half.T)), rtol=1e-6)
    margin = np.minimum(q - arm.limits.lower, arm.limits.upper - q)
    assert state.position_margin == pytest.approx(margin)
    assert state.position_margin[3] < 0.0  # the elbow of this arm cannot be stretched


def test_invalid_input_is_named():
    arm = load_arm(robot_urdf('ur5'))
    task = TaskSpace(arm, 'tool0')
    for call, words in (
        (lambda: TaskSpace(arm, 'tool1'), r"frame is 'tool1', .*'tool0'"),
        (lambda: TaskSpace(arm, 'tool0', reference='world'),
         r"reference is 'world', .*\['base_aligned', 'local'\]"),
        (lambda: TaskSpace(arm, 'tool0', (0, np.nan, 0)), r'point\[1\] \(y\) is nan'),
        (lambda: task.at([0.0] * 5), 'position has 5 values, expected 6'),
        (lambda: task.batch(np.zeros((3, 6)), np.zeros((2, 6))),
         'velocity has 2 samples, expected 3'),
        (lambda: task.batch(np.zeros((3, 6))).lost_directions, 'one state'),
    ):
        with pytest.raises(InvalidInputError, match=words):
            call()


def test_a_joint_without_mass_is_named():
    urdf = re.sub(r'(<link name="link2">.*?)<inertial>.*?</inertial>', r'\1', default_arm_urdf(),
                  flags=re.DOTALL)
    task = TaskSpace(load_arm(urdf), 'link2')
    assert task.at((0.0, 0.0)).jacobian.shape == (6, 2)
    with pytest.raises(InvalidInputError, match=r'at position \[0.0, 0.0\] is not positive def'):
        _ = task.batch(np.zeros((2, 2))).inertia


ARMS = ['default', 'ur5', 'panda']
DISTANCE, ANGLE = 1e-4, 1e-3  # [m], [rad] up to which a pose is reached


def bounds(arm: ArmModel) -> tuple[np.ndarray, np.ndarray]:
    return np.maximum(arm.limits.lower, -3.0), np.minimum(arm.limits.upper, 3.0)


@pytest.mark.parametrize('robot', ARMS)
def test_pose_and_jacobian_are_those_of_task_space(robot):
    arm = smooth_arm(robot)
    link = last_link(arm)
    kinematics, task = FrameKinematics(arm, link), TaskSpace(arm, link)
    for q in np.random.default_rng(0).uniform(*bounds(arm), (5, arm.joint_count)):
        state = task.at(q)
        p, R, J = kinematics.jacobian(q)
        assert p == pytest.approx(state.translation)
        assert pytest.approx(state.rotation) == R
        assert pytest.approx(state.jacobian) == J
        assert kinematics.pose(q)[0] == pytest.approx(p)


@pytest.mark.parametrize('robot', ARMS)
@settings(max_examples=20)
@given(seed=st.integers(0, 100_000))
def test_a_pose_nearby_is_reached_within_the_limits(robot, seed):
    arm, rng = smooth_arm(robot), np.random.default_rng(seed)
    kinematics, (lower, upper) = FrameKinematics(arm, last_link(arm)), bounds(arm)
    start = rng.uniform(lower, upper)
    p, R = kinematics.pose(np.clip(start + rng.uniform(-0.1, 0.1, len(start)), lower, upper))
    q = joints_at(arm, kinematics, start, p, R)
    assert ((q >= arm.limits.lower) & (q <= arm.limits.upper)).all()
    reached, turned = kinematics.pose(q)
    assert np.linalg.norm(reached - p) <= DISTANCE
    assert arm.joint_count < 6 or np.linalg.norm(rotation_vector(turned @ R.T)) <= ANGLE


def test_no_joint_makes_more_than_half_a_turn():
    arm = smooth_arm('ur5')  # its joints have two turns
    kinematics, rng = FrameKinematics(arm, last_link(arm)), np.random.default_rng(5)
    found = 0
    for start, goal in rng.uniform(-3.0, 3.0, (15, 2, 6)):
        try:
            q = joints_at(arm, kinematics, start, *kinematics.pose(goal))
        except InvalidInputError:
            continue
        found += 1
        assert np.abs(q - start).max() <= np.pi + 1e-9
    assert found > 7


def test_two_joints_reach_a_translation_with_any_rotation():
    arm = smooth_arm('default')
    kinematics, start = FrameKinematics(arm, 'tool0'), np.array([0.8, 0.5])
    p, R = kinematics.pose(start + 0.1)
    q = joints_at(arm, kinematics, start, p, pin.exp3(np.array([0.0, 0.0, 1.0])) @ R)
    assert kinematics.pose(q)[0] == pytest.approx(p, abs=DISTANCE)


@pytest.mark.parametrize('robot', ['panda', 'default'])
def test_a_pose_out_of_reach_is_refused_with_its_distance(robot):
    arm = smooth_arm(robot)
    kinematics = FrameKinematics(arm, last_link(arm))
    with pytest.raises(InvalidInputError, match=r'is (\d|\.)+ m and .* rad from the nearest pose'):
        joints_at(arm, kinematics, np.full(arm.joint_count, 0.3), np.full(3, 9.0), np.eye(3))
