# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The impedances of the joints and of a frame: stiffness, modes, motions, contact, and bounds.

What both have in common comes first.
"""

from collections.abc import Mapping

from cartesian_arm import CartesianArm, ROBOTS, rotored
from controller_bench import update
from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import directions, FIRST_STAMP, LockStep, middle, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.cartesian_impedance import CartesianImpedance
from robot_dynamics.control.laws.control_law import LawInput
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.task_space import TaskSpace
from robot_dynamics.task_space.frame_kinematics import last_link

LARGEST_ERROR = {'joint_impedance': (3e-3, 1e-4), 'cartesian_impedance': (5e-3, 1e-3)}
"""[rad] along a motion, and at its end."""
commands = pytest.mark.parametrize('command', LARGEST_ERROR)


@commands
def test_a_motion_has_no_error(command):
    """M q̈_ref accelerates the arm, so that the spring has nothing to do; states at 1 kHz."""
    one, (along, at_end) = LockStep(
        smooth_arm('panda'), rate=1000.0, command=command), LARGEST_ERROR[command]
    one.run(0.5)
    goal = one.q + 0.3
    one.follow(goal, 2.0)
    for _ in range(4):
        one.run(0.25)
        assert one.q == pytest.approx(one.loop.reference.position, abs=along)
    one.run(2.0)
    assert one.q == pytest.approx(goal, abs=at_end)


@pytest.mark.parametrize(('name', 'largest', 'delay'), [('ur5', 5.5e-3, 8), ('ur10', 3e-3, 0)])
def test_slow_states_follow_a_stream_of_set_points(name, largest, delay):
    """Set-points each 20 ms change the acceleration of the reference between two states."""
    one, errors = LockStep(
        smooth_arm(name), rate=30.0, delay=delay, command='cartesian_impedance'), []
    one.run(1.0)
    start, answer = one.q.copy(), one.loop.answer

    def measuring(stamp_ns: int, q: FloatArray, v: FloatArray) -> LoopAnswer:
        found = answer(stamp_ns, q, v)
        errors.append(one.loop.reference.position - q)
        return found

    one.loop.answer = measuring  # type: ignore[method-assign, assignment]
    for x in np.minimum(np.arange(1, 81) / 30, 1.0):
        s = x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
        one.follow(start + 0.1 * s * directions(len(start)))
        one.run(0.02)
    assert start + 0.1 * directions(len(start)) == pytest.approx(one.q, abs=1e-3)
    assert np.abs(errors).max() < largest


SLOW_ROTORS = 5.0
"""[kg·m²]: no mode of 400 N·m/rad exceeds 9 rad/s."""
SMALL = 1e-4
"""[rad] and [rad/s] of the errors with which the gains are measured."""


def impedance_of(
    arm: ArmModel, parameters: Mapping[str, object], **options: object,
) -> ControlLoop:
    return ControlLoop.of_arm(arm, command='joint_impedance', parameters=parameters, **options)


def measured_gains(loop: ControlLoop, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return K and D (n, n) of the law at rest at q, from its efforts for small errors."""
    n, controller = len(q), loop.controller
    loop.answer(FIRST_STAMP, q, np.zeros(n))
    loop.answer(FIRST_STAMP + 2 * MS, q, np.zeros(n))
    stamp = FIRST_STAMP + 2 * MS

    def effort(shift: np.ndarray, v: np.ndarray) -> np.ndarray:
        effort = controller.answer(stamp, q + shift, v).law.effort
        return effort - ArmDynamics(loop.controller.arm).rigid_body.nonlinear(q + shift, v)

    K, D = np.zeros((n, n)), np.zeros((n, n))
    for j, one in enumerate(SMALL * np.eye(n)):
        K[:, j] = (effort(-one, 0.0 * q) - effort(one, 0.0 * q)) / (2.0 * SMALL)
        D[:, j] = (effort(0.0 * q, -one) - effort(0.0 * q, one)) / (2.0 * SMALL)
    return K, D


@pytest.mark.parametrize('name', ['ur5', 'panda'])
@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), stiffness=st.floats(1.0, 2000.0))
def test_every_mode_is_critically_damped_and_none_is_too_fast(name, seed, stiffness):
    """The law is a spring and a damper whose modes are those of the closed loop with M(q)."""
    arm = smooth_arm(name)
    q = middle(arm) + np.random.default_rng(seed).uniform(-1.0, 1.0, arm.joint_count)
    loop = impedance_of(arm, {'impedance.stiffness': stiffness}, scales_gains=False)
    K, D = measured_gains(loop, q)
    M = ArmDynamics(arm).rigid_body.mass_matrix(q)
    wanted = np.linalg.eigvals(np.linalg.solve(M, stiffness * np.eye(len(q)))).real
    squares, modes = np.linalg.eig(np.linalg.solve(M, K))
    omega = np.sqrt(squares.real)
    assert np.sort(omega) == pytest.approx(np.sort(np.minimum(np.sqrt(wanted), 30.369)), rel=1e-3)
    assert (np.linalg.eigvalsh(K) <= stiffness * (1.0 + 1e-4)).all()
    assert pytest.approx(K.T, abs=1e-4 * stiffness) == K
    assert np.linalg.solve(M, D) @ modes == pytest.approx(
        modes * (2.0 * omega), abs=1e-3 * omega.max())


def test_the_default_stiffness_takes_the_effort_limit_at_an_error_of_a_quarter():
    arm = load_arm(
        '<robot name="r"><link name="a"/>' + ''.join(
            f'<link name="{child}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
            f'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{child}" type="continuous">'
            f'<parent link="{parent}"/><child link="{child}"/>{limit}</joint>'
            for parent, child, limit in (
                ('a', 'b', '<limit effort="50" velocity="1"/>'), ('b', 'c', ''))) + '</robot>')
    arm = arm.with_reflected_inertia([SLOW_ROTORS])
    K, D = measured_gains(impedance_of(arm, {}, scales_gains=False), np.array([0.8, 0.5]))
    assert pytest.approx(np.diag([200.0, 100.0]), abs=1e-3) == K
    M = ArmDynamics(arm).rigid_body.mass_matrix(np.array([0.8, 0.5]))
    rates = np.linalg.eigvals(np.linalg.solve(M, D)).real
    assert np.sort(rates)**2 == pytest.approx(
        4.0 * np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real), rel=1e-3)


REGULAR = 0.15
"""Smallest singular value of a regular pose, with 0.25 m as unit of length."""
arms = pytest.mark.parametrize('robot', ['ur5', 'panda'])
seeds = given(seed=st.integers(0, 10_000))
few = settings(max_examples=12)


def law_of(arm: ArmModel, **options: object) -> CartesianImpedance:
    parameters = {f'cartesian.{name}': value for name, value in options.items()}
    law = ControlLoop.of_arm(
        arm, command='cartesian_impedance', parameters=parameters).controller.law
    assert isinstance(law, CartesianImpedance)
    law.scale_gains(np.ones(arm.joint_count))
    return law


def random_pose(arm: ArmModel, seed: int) -> np.ndarray:
    lower, upper = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    return np.random.default_rng(seed).uniform(lower, upper)


@arms
@few
@seeds
def test_the_frame_has_the_stiffness_and_the_posture_does_not_move_it(robot, seed):
    """The compliance of the frame, J K⁻¹ Jᵀ, is the inverse of the stiffness, in all six axes."""
    arm = rotored(smooth_arm(robot), 5.0)
    q, kt = random_pose(arm, seed), [300.0, 500.0, 700.0]
    law = law_of(arm, translation_stiffness=kt)
    state = TaskSpace(arm, last_link(arm)).at(q)
    J, M = state.jacobian, state.mass_matrix
    if len(q) < 6 or np.linalg.svd(np.diag([4.0] * 3 + [1.0] * 3) @ J)[1][5] <= REGULAR:
        return
    K, D = law.gains(UncheckedArmDynamics(arm), q)
    compliance = J @ np.linalg.solve(K, J.T)
    assert compliance == pytest.approx(np.diag(1.0 / np.array([*kt, 30.0, 30.0, 30.0])), abs=1e-6)
    assert np.abs(J @ np.linalg.solve(M, law._posture)).max() < 1e-6 * np.abs(K).max()
    zeta, Lambda = 1.0, state.inertia
    modes = np.linalg.eigvals(np.linalg.solve(Lambda, np.diag([*kt, 30.0, 30.0, 30.0]))).real
    if modes.min() > 4.0:  # D = 2 ζ Q √B₀ Qᵀ, in task space
        damping = np.linalg.inv(J @ np.linalg.solve(D, J.T))
        lambda_d = np.linalg.eigvals(np.linalg.solve(Lambda, damping)).real
        assert np.sort(lambda_d) == pytest.approx(2.0 * zeta * np.sort(np.sqrt(modes)), rel=1e-3)


@pytest.mark.parametrize('robot', ['default', 'ur5', 'panda', 'so100'])
@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), singular=st.booleans())
def test_no_mode_is_too_fast_and_each_is_damped_in_any_pose(robot, seed, singular):
    """Between 2 and 30.4 rad/s, also at singularities: with most joints at 0."""
    arm = smooth_arm(robot)
    q = random_pose(arm, seed)
    if singular:
        q = np.where(np.random.default_rng(seed).uniform(size=len(q)) < 0.7, 0.0, q)
    law, M = law_of(arm), ArmDynamics(arm).rigid_body.mass_matrix(q)
    K, D = law.gains(UncheckedArmDynamics(arm), q)
    L = np.linalg.inv(np.linalg.cholesky(M))
    squares, rates = (np.linalg.eigvalsh(L @ A @ L.T) for A in (K, D))
    assert squares[-1] <= 30.37**2 + 0.1
    assert rates[0] >= 3.999
    assert rates[-1] <= 60.75
    if robot == 'so100':  # light joints have the fastest modes that are allowed
        assert rates[-1] == pytest.approx(60.74, rel=1e-3)
    if len(q) >= 6:
        assert squares[0] > 0.0


@arms
def test_a_lost_direction_is_held_by_the_posture(robot):
    """The stiffness is continuous along a motion through a singularity."""
    arm = rotored(smooth_arm(robot), 1.0)
    law, dynamics, before = law_of(arm), UncheckedArmDynamics(arm), None
    far = random_pose(arm, 1)
    for s in np.linspace(-0.3, 0.3, 601):
        K, _ = law.gains(dynamics, s * far)
        assert before is None or np.abs(K - before).max() < 0.2 * np.abs(K).max()
        assert np.linalg.eigvalsh(K)[0] > 0.1
        before = K


STEPS = [('ur10', True, 1000, 0), ('panda', False, 250, 8), ('z1', True, 250, 8)]


@pytest.mark.parametrize(('robot', 'rotors', 'rate', 'delay'), [
    *STEPS, *(pytest.param(robot, rotors, 250, 8, marks=pytest.mark.soak)
              for robot in ROBOTS for rotors in (False, True))])
def test_a_step_overshoots_by_at_most_5_percent(robot, rotors, rate, delay):
    for axis in (1, 2, 3, 5):
        one = CartesianArm(robot, rate, delay, rotors)
        way = one.step(axis, 0.05 if axis < 3 else 0.3, 1.5)
        assert way.max() <= 1.05
        assert way[-1] == pytest.approx(1.0, abs=0.06)


def brake_at(robot: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the effort beyond the damping at a reference at rest at q."""
    law, dynamics = law_of(arm := rotored(smooth_arm(robot))), UncheckedArmDynamics(arm)
    law._K, law._D = law.gains(dynamics, q)
    state = LawInput(dynamics, 0, q, v, q, None, law.feedback)
    return law.damper(state, 0.0 * q, -v) + law._D @ v


@arms
@few
@seeds
def test_a_joint_before_its_limit_is_braked_by_its_own_effort(robot, seed):
    """
    It could stop 0.05 rad before the limit at 15.2 1/s: 0.01 rad earlier from 0.152 rad/s.

    An effort at other joints would keep them away from their reference.
    """
    limits, q = smooth_arm(robot).limits, random_pose(smooth_arm(robot), seed)
    j = np.random.default_rng(seed).choice(np.flatnonzero(np.isfinite(limits.upper)))
    for place, sign in ((limits.upper[j] - 0.06, 1.0), (limits.lower[j] + 0.06, -1.0)):
        q[j] = place
        slow, fast = (brake_at(robot, q, sign * v * np.eye(len(q))[j]) for v in (0.150, 0.154))
        assert slow == pytest.approx(0.0, abs=1e-9)
        assert sign * fast[j] < -1e-4
        assert np.delete(fast, j) == pytest.approx(0.0, abs=1e-9)


@arms
def test_a_joint_above_half_of_its_velocity_limit_is_braked(robot):
    arm = smooth_arm(robot)
    limit, q = arm.limits.velocity[0], middle(arm)
    for sign in (1.0, -1.0):
        slow, fast = (brake_at(robot, q, np.eye(len(q))[0] * sign * share * limit)[0]
                      for share in (0.49, 0.51))
        assert slow == pytest.approx(0.0, abs=1e-9)
        assert sign * fast < -1e-3


def test_the_springs_extend_by_a_tenth_of_a_metre_and_half_a_radian():
    """The posture by half a radian of all joints; the rotors are so large that no mode is fast."""
    arm = rotored(smooth_arm('panda'), 50.0)
    law, dynamics, q = law_of(arm, force_limit=1e4, torque_limit=1e4), UncheckedArmDynamics(
        arm), np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    law._K, law._D = law.gains(dynamics, q)
    state = LawInput(dynamics, 0, q, 0.0 * q, q, None, law.feedback)
    J = TaskSpace(arm, last_link(arm)).at(q).jacobian
    _, _, Vt = np.linalg.svd(J)
    for direction, longest in (
            (np.linalg.pinv(J)[:, 0], 0.1), (np.linalg.pinv(J)[:, 4], 0.5), (Vt[6], 0.5)):
        near, far, further = (
            law.spring(state, share * longest * direction) for share in (0.99, 1.01, 2.0))
        if direction is Vt[6]:
            assert np.abs(near).max() > 0.1
            assert far == pytest.approx(further)
        else:  # that of the posture is small there
            assert np.linalg.pinv(J.T) @ far == pytest.approx(
                np.linalg.pinv(J.T) @ further, rel=0.02, abs=0.1)
        assert np.abs(near) == pytest.approx(0.99 * np.abs(far), rel=2e-3, abs=1e-3)
    law = law_of(arm, translation_stiffness=1500.0, force_limit=40.0, torque_limit=5.0)
    law._K, law._D = law.gains(dynamics, q)
    for direction, part, limit in (
            (np.linalg.pinv(J)[:, 0], slice(3), 40.0),
            (np.linalg.pinv(J)[:, 4], slice(3, 6), 5.0)):
        wrench = np.linalg.pinv(J.T) @ law.spring(state, 0.3 * direction)
        assert np.linalg.norm(wrench[part]) == pytest.approx(limit, rel=1e-3)


@pytest.mark.parametrize(('robot', 'stiffness', 'rotors'), [
    ('panda', 1e6, False), ('z1', 1e5, True),
    *(pytest.param(robot, 1e6, True, marks=pytest.mark.soak) for robot in ROBOTS)])
def test_late_contact_with_a_wall_hardly_gains_energy(robot, stiffness, rotors):
    """At 250 Hz with 8 ms, without any friction."""
    one = CartesianArm(robot, 250, 8, rotors)
    energy = one.press_on_a_wall(stiffness, (1.0, 1.0, 3.0))
    assert (energy - np.minimum.accumulate(energy)).max() <= 0.06  # the largest rise
    assert energy[-1] < 0.5**2 + 0.06  # that of the spring at the wall, and a rest
    assert one.controller.laws.oscillation.factor > 0.48  # at most two doubts


def test_a_rotation_error_of_half_a_turn_does_not_jump():
    arm = smooth_arm('ur5')
    loop = ControlLoop.of_arm(
        arm, command='cartesian_impedance', conditions_references=False, scales_gains=False)
    controller, q0 = loop.controller, np.array([0.0, -1.2, 1.6, -1.9, -1.57, 0.0])
    update(controller, FIRST_STAMP, q0, 0.0 * q0)
    update(controller, FIRST_STAMP + 2 * MS, q0, 0.0 * q0)
    before = None
    for k, angle in enumerate(np.linspace(2.9, 3.4, 1000)):  # the last joint turns past 180°
        q = q0 + np.array([0.0] * 5 + [angle])
        tau = update(controller, FIRST_STAMP + (4 + 2 * k) * MS, q, 0.0 * q).law.effort[5]
        assert before is None or k < 100 or abs(tau - before) < 1e-3
        before = tau


def test_a_push_does_not_move_a_joint_past_its_limit():
    arm = rotored(smooth_arm('panda'))
    q = middle(arm)
    q[5] = arm.limits.upper[5] - 0.15
    one = LockStep(arm, q=q, rate=500.0, command='cartesian_impedance')
    one.run(0.3)
    one.push = lambda t: np.array([0.0] * 5 + [4.0, 0.0]) if 0.3 < t < 0.6 else 0.0
    trace = one.run(2.0)
    assert trace.q[:, 5].max() > q[5] + 0.05
    assert (trace.q <= arm.limits.upper).all()
    assert one.loop.supervisor.fault is None
