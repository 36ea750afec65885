# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control law: gains, the feedback along a trajectory, its limit, and the error dynamics.

Computed torque limits the feedback by the rate of the effort. The compensation of friction with
known parameters improves the tracking and does not chatter.
"""

import math
from typing import NamedTuple

from controller_bench import update
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import wrap_angle, wrap_to_pi
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Gains, make_gains, Tracking
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics.trajectories.quintics import quintic_via_points
from robots import robot_urdf
from simulated_arms import released

NAMES = ('shoulder', 'elbow', 'wrist')

SECOND = 1_000_000_000

few = settings(max_examples=50)


def tracked(
    feedback: ErrorFeedback, reference: Reference, q: np.ndarray, v: np.ndarray,
) -> Tracking:
    """Return the feedback at a state for a constant reference."""
    names = [f'joint{j}' for j in range(len(q))]
    trajectory = make_trajectory(names, [0.0], *([x.tolist()] for x in reference), names)
    return feedback.track(ActiveTrajectory(trajectory, 0, 0, reference), 1, q, v)


# --- gains ---------------------------------------------------------------------------------------

def test_gains_follow_from_frequency_and_damping_ratio():
    gains = make_gains(NAMES, [1.0, 2.0, 3.0], [0.5])
    assert gains.kp.tolist() == [1.0, 4.0, 9.0]
    assert gains.kd.tolist() == [1.0, 2.0, 3.0]
    assert make_gains(NAMES, [0.0]).kp.tolist() == [0.0] * 3  # not the default


@pytest.mark.parametrize('ratio', [[0.0], [1.0, 0.29, 1.0]])
def test_gains_that_oscillate_are_refused(ratio):
    assert make_gains(NAMES, damping_ratio=0.3).kd == pytest.approx([12.0] * 3)
    with pytest.raises(InvalidInputError, match=r'^gains\.damping_ratio is .*at least 0\.3'):
        make_gains(NAMES, damping_ratio=ratio)


@pytest.mark.parametrize('field', ['natural_frequency', 'damping_ratio'])
@pytest.mark.parametrize(('value', 'words'), [
    ([1.0, 2.0], 'has 2 values, expected 3, one for each of'),
    ([1.0, 2.0, -1e-9], 'expected no value below 0'),
    ([float('nan')], 'is nan, expected a finite number'),
    ([1.0, float('inf'), 1.0], r'\[1\] \(elbow\) is inf'),
    ([1.0, 1.1e9, 1.0], r' is 1.1e\+09, expected'),
])
def test_bad_gains_are_refused_by_name(field, value, words):
    with pytest.raises(InvalidInputError, match=rf'^gains\.{field}.*{words}'):
        make_gains(NAMES, **{field: value})


# --- the position error --------------------------------------------------------------------------

@few
@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_are_whole_turns_away_and_within_half_a_turn(angle):
    wrapped = float(wrap_to_pi(np.array([angle]))[0])
    turns = (angle - wrapped) / (2.0 * np.pi)
    assert abs(wrapped) <= np.pi
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-9)
    assert abs(turns - round(turns)) < 1e-12


def test_only_continuous_joints_take_the_shortest_angular_distance():
    feedback = ErrorFeedback(make_gains(NAMES), ('continuous', 'revolute', 'prismatic'))
    reference, q = np.array([3.0, 3.0, 30.0]), np.array([-3.0, -3.0, -30.0])
    error = feedback.position_error(reference, q)
    assert error == pytest.approx([6.0 - 2.0 * np.pi, 6.0, 60.0])
    assert reference.tolist() == [3.0, 3.0, 30.0]  # unchanged
    assert q.tolist() == [-3.0, -3.0, -30.0]


def test_the_error_that_is_largest_relative_to_its_limit_is_named():
    feedback = ErrorFeedback(
        make_gains(NAMES), ('revolute', 'continuous', 'prismatic'), np.array([1.0, 0.1, 2.0]))
    error = feedback.position_error(np.array([0.5, 3.0, 1.5]), np.array([0.0, -3.1, 3.0]))
    words = feedback.worst_error(error, NAMES)
    assert words == (
        "position of 'elbow' is 0.183 from its reference, expected at most 0.1 "
        '(following_error_limit)')


# --- along a trajectory --------------------------------------------------------------------------

def segment_of(n: int, kind: str, rng: np.random.Generator) -> ActiveTrajectory:
    """Return a trajectory from 1 s to 3 s."""
    names = [f'joint{j}' for j in range(n)]
    p, v, a = rng.uniform(-3.0, 3.0, (3, 2, n))
    v[-1] = 0.0  # the end position is held
    p, v, a = p.tolist(), v.tolist(), a.tolist()
    trajectory = make_trajectory(
        names, (0.0, 2.0), p, v if kind != 'linear' else (), a if kind == 'quintic' else (), names)
    return ActiveTrajectory(trajectory, SECOND, SECOND, Reference(*np.zeros((3, n))))


@few
@given(
    n=st.integers(1, 14), kind=st.sampled_from(['linear', 'cubic', 'quintic']),
    joint=st.sampled_from(['revolute', 'continuous', 'prismatic']), seed=st.integers(0, 2**32 - 1),
    phase=st.floats(-0.5, 1.5), has_damping=st.booleans(), limit=st.floats(0.0, 20.0))
def test_the_feedback_along_a_segment_is_that_of_the_sampled_reference(
    n, kind, joint, seed, phase, has_damping, limit,
):
    rng = np.random.default_rng(seed)
    active = segment_of(n, kind, rng)
    kp, kd = rng.uniform(0.1, 400.0, (2, n))
    gains = Gains(kp, kd * has_damping)
    feedback = ErrorFeedback(gains, [joint] * n, np.full(n, limit))
    q, v = rng.uniform(-9.0, 9.0, (2, n))
    now = SECOND + round(2e9 * phase)
    found, reference = feedback.track(active, now, q, v), active.sample(now)
    e = feedback.position_error(reference.position, q)
    assert (np.abs(e) <= math.pi).all() or joint != 'continuous'
    assert found.acceleration == pytest.approx(
        reference.acceleration + gains.kd * (reference.velocity - v) + kp * e, rel=1e-9, abs=1e-8)
    assert found.velocity == pytest.approx(reference.velocity, rel=1e-9, abs=1e-8)
    assert found.error == pytest.approx(e, rel=1e-9, abs=1e-8)
    assert found.exceeds_limit == bool((np.abs(e) > limit).any())
    assert found.largest == pytest.approx(np.abs(reference.velocity - v).max(), rel=1e-9)


def test_each_segment_is_followed_also_if_the_time_goes_back():
    """Before the arrival, and after the end, the reference is constant."""
    names = ['joint']
    trajectory = make_trajectory(names, (0.0, 1.0, 3.0), [[0.0], [1.0], [2.0]])
    late = ActiveTrajectory(trajectory, 0, SECOND // 2, Reference(*np.full((3, 1), 7.0)))
    zero = np.zeros(1)
    feedback = ErrorFeedback(Gains(np.ones(1), zero), ['revolute'])
    for t, expected in (
            (0.25, 14.0), (0.5, 0.5), (0.75, 0.75), (0.25, 14.0), (1.0, 1.0), (2.0, 1.5),
            (0.5, 0.5), (3.0, 2.0), (99.0, 2.0), (2.0, 1.5)):
        found = feedback.track(late, round(t * SECOND), zero, zero)
        assert found.acceleration == pytest.approx([expected]), t  # 14: with its acceleration


# --- the closed loop -----------------------------------------------------------------------------

@pytest.mark.parametrize('zeta', [0.3, 1.0, 2.5])
@pytest.mark.parametrize('name', ['default', 'ur10'])
def test_error_obeys_its_differential_equation(name, zeta):
    """With an exact model ë + K_d ė + K_p e = 0 at each joint (Siciliano et al. 2009, 8.5.2)."""
    arm, omega = load_arm(robot_urdf(name)), 8.0
    dynamics, rng = ArmDynamics(arm), np.random.default_rng(0)
    feedback = ErrorFeedback(make_gains(arm.joint_names, [omega], [zeta]), arm.joint_kinds)
    for _ in range(10):
        q, v, *reference = rng.uniform(-1.0, 1.0, (5, arm.joint_count))
        effort = dynamics.inverse_dynamics(
            q, v, tracked(feedback, Reference(*reference), q, v).acceleration)
        e, e_dot, e_ddot = reference - np.array((q, v, dynamics.forward_dynamics(q, v, effort)))
        assert e_ddot + 2.0 * zeta * omega * e_dot + omega**2 * e == pytest.approx(0.0, abs=1e-5)


ARM = load_arm(default_arm_urdf())
JOINTS = ARM.joint_names
GAINS = make_gains(JOINTS)
MS = 1_000_000
START = 1_790_000_000_000 * MS


def feedback_of(
    error: float, speed: float, rate: float, softens: bool = True,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return K_p e and K_d ė of the feedback (2,) [1/s²], as in full, and s."""
    one = Controller(ARM, ControllerOptions(GAINS, effort_rate=rate, scales_gains=softens))
    q, body = np.zeros(2), ArmDynamics(ARM).rigid_body
    for k in range(20):
        update(one, START + 2 * k * MS, q, q)
    one.follow(make_trajectory(JOINTS, (0.0,), [[error, -error]], (), (), JOINTS), 0)
    v = np.full(2, speed)
    output = update(one, START + 40 * MS, q, v)
    effort, terms = output.computed_torque, output.terms
    assert terms.effort == pytest.approx(effort)
    K_p_e, K_d_e_dot, s = GAINS.kp * [error, -error], -GAINS.kd * v, output.scale
    M, rest = body.mass_matrix(q), body.nonlinear(q, v)
    largest = np.abs(M @ K_p_e).max()
    of_position = min(1.0, 0.06 * rate / max(largest, 1e-300))
    leaves = K_p_e * K_d_e_dot > 0.0
    share = max(s * s, of_position) * np.where(leaves, 1.0, s) if softens else 1.0
    assert effort == pytest.approx(M @ (share * K_p_e + s * K_d_e_dot) + rest)
    return K_p_e, K_d_e_dot, s


@settings(max_examples=60)
@given(error=st.floats(-1.0, 1.0), speed=st.floats(-5.0, 5.0), rate=st.floats(1.0, 1e5))
def test_the_change_or_the_size_of_the_feedback_is_within_the_rate_limit(error, speed, rate):
    """The change is s² M (K_p + K_d²) ė per second, the size s M (K_p e + K_d ė)."""
    proportional, damping, s = feedback_of(error, speed, rate)
    M = ArmDynamics(ARM).rigid_body.mass_matrix(np.zeros(2))
    change = float(np.abs(M @ ((GAINS.kp + GAINS.kd**2) * speed)).max())
    size = float(np.abs(M @ (proportional + damping)).max())
    of_change = 0.3 * rate / max(change, 1e-300)
    of_size = 0.06 * rate / max(size, 1e-300)
    assert s == pytest.approx(min(1.0, max(math.sqrt(of_change), of_size)), rel=1e-6)


@pytest.mark.parametrize('error', [1e-3, 0.5, 3.0])
def test_a_steady_error_is_fed_back_in_full(error):
    """That under a load, for example, of any size."""
    assert feedback_of(error, 0.0, 10.0)[2] == 1.0


def test_without_softening_or_a_rate_limit_nothing_is_limited():
    assert feedback_of(0.5, 5.0, 10.0, softens=False)[2] == 1.0
    assert feedback_of(0.5, 5.0, np.inf)[2] == 1.0


PERIOD = 2e-3
FRICTION = {
    'viscous': [2.0, 0.8], 'coulomb': [4.0, 1.5], 'static': [6.0, 2.0],
    'stribeck_velocity': [0.05, 0.05]}


def with_friction(fraction: float) -> ArmModel:
    parameters = {
        name: value if name == 'stribeck_velocity' else [fraction * x for x in value]
        for name, value in FRICTION.items()}
    return ARM.with_friction(make_friction(ARM.joint_names, **parameters))


class Run(NamedTuple):
    """Error, command, friction compensation, measured and true velocity, (samples, 2) each."""

    error: np.ndarray
    command: np.ndarray
    friction: np.ndarray
    measured_velocity: np.ndarray
    velocity: np.ndarray


def run(
    known_fraction: float, seconds: float = 4.0, still: float = 0.0, velocity_noise: float = 0.0,
    position_noise: float = 0.0,
) -> Run:
    """Run the default arm with friction in closed loop: a motion, then a reference at rest."""
    model = with_friction(known_fraction)
    motion = quintic_via_points(
        ARM.joint_names, [0.0, 0.5 * seconds, seconds],
        [[0.785, 0.524], [1.585, 1.244], [0.785, 0.524]])
    controller = Controller(model, ControllerOptions(make_gains(ARM.joint_names)))
    update(controller, 1, motion.points[0].position, np.zeros(2))  # required before a trajectory
    controller.follow(motion, 1)
    simulation = released(with_friction(1.0), motion.points[0].position)
    random = np.random.default_rng(0)
    rows = []
    for k in range(int((seconds + still) / PERIOD)):
        q, v = simulation.state
        measured = v + velocity_noise * random.standard_normal(2)
        output = update(
            controller,
            1 + round(1e9 * k * PERIOD), q + position_noise * random.standard_normal(2), measured)
        rows.append(
            (output.reference.position - q, output.command, output.terms.friction, measured, v))
        simulation.step(output.command, PERIOD)
    return Run(*(np.array(column) for column in zip(*rows)))


def rms(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt((errors**2).mean(axis=0)))


def test_known_friction_is_tracked_twenty_times_better():
    without, known = rms(run(0.0).error), rms(run(1.0).error)
    print(f'RMS error without {without}, with {known}, ratio {without / known}')
    assert np.linalg.norm(without) >= 20.0 * np.linalg.norm(known)
    assert (without >= 10.0 * known).all()


REST = slice(-900, None)
"""The last 1.8 s of a run whose reference rests for the last 2 s."""
NOISE = {'position_noise': 1e-5, 'velocity_noise': 2e-3}


def sign_changes(friction: np.ndarray) -> list[int]:
    """Return the number of sign changes per column; zeros are ignored."""
    signs = [np.sign(column[column != 0.0]) for column in friction.T]
    return [int((np.diff(sign) != 0.0).sum()) for sign in signs]


def test_compensation_at_rest_does_not_chatter():
    """Under noise of both sensors the sign changes 0 times in 900 samples; sgn(v) 400 times."""
    noisy = run(1.0, seconds=3.0, still=2.0, **NOISE)
    naive = with_friction(1.0).friction.effort(noisy.measured_velocity[REST])
    print(f'sign changes of the compensation {sign_changes(noisy.friction[REST])}, '
          f'of the naive one on the same data {sign_changes(naive)}')
    assert sign_changes(noisy.friction[REST]) == [0, 0]
    assert min(sign_changes(naive)) > 400
    assert not noisy.velocity[REST].any()  # the arm stays at rest
