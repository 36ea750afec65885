# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The external wrench from joint efforts, and its covariance.

The causal filter, the filtered residual, and the noise of the estimates.
"""

from dataclasses import replace
import math

from controller_bench import ARM
from counted_calls import calls_of
import numpy as np
from one_joint_arm import arm_of
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.unchecked_rigid_body import HAS_PARALLEL_RNEA
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics_tools.monitoring.external_wrench import ExternalWrenchEstimator, WrenchEstimate
from robot_dynamics_tools.monitoring.live_residual import LiveResidual
from robot_dynamics_tools.monitoring.low_pass import LowPass
from robot_dynamics_tools.pictures.stick_figure import tool_link
from robots import robot_urdf
from wrong_arms import model_arm

TILTED = np.array([0.3, -1.2, 1.4, -0.7, 0.9, 0.2])
"""A position of the UR10 far from singular ones."""


class Efforts:
    """An estimator that is given efforts at rest, without the dynamics of the observer."""

    def __init__(self, arm: ArmModel, frame: str, **options: float) -> None:
        dynamics = ArmDynamics(arm)
        self.body, self.n = dynamics.rigid_body, arm.joint_count
        self.observer = ExternalEffort(dynamics, 1e3)
        self.estimator = ExternalWrenchEstimator(dynamics, self.observer, frame, **options)

    def __call__(self, q: np.ndarray, r: np.ndarray, dt: float = 1.0) -> WrenchEstimate:
        """Return the estimate at an external effort that acts for dt [s]."""
        self.observer.restart()
        for _ in range(2):
            self.observer.update(1.0, q, np.zeros(self.n), self.body.gravity(q) - r)
        return self.estimator.update(dt)


def certain(name: str, deviation: float) -> ArmModel:
    """Return an arm whose measured efforts have this deviation [N·m], and no other error."""
    arm = load_arm(robot_urdf(name))
    return replace(arm, uncertainty=make_uncertainty(
        arm, noise_deviation=[deviation], noise_bandwidth=1e6))


@pytest.mark.parametrize('name', ['panda', 'kinova', 'tiago_no_hand'])
def test_the_jacobian_maps_a_wrench_to_its_joint_efforts(name):
    """With mimic, prismatic and continuous joints; the oracle is the recursive Newton–Euler."""
    arm = load_arm(robot_urdf(name))
    rng = np.random.default_rng(1)
    for frame in {tool_link(arm), arm.link_names[len(arm.link_names) // 2]}:
        efforts = Efforts(arm, frame)
        q, F = rng.normal(size=arm.joint_count), rng.normal(size=6)
        r = -efforts.body.external(q, [ExternalWrench(frame, F[:3], F[3:])])
        assert pytest.approx(r, abs=1e-9) == efforts.estimator.jacobian(q).T @ F


@pytest.mark.parametrize(('kind', 'effect'), [('revolute', 4), ('prismatic', 1)])
def test_one_joint_determines_one_component(kind, effect):
    """About or along y."""
    efforts = Efforts(load_arm(arm_of(kind=kind)), 'arm')
    found = efforts(np.array([0.3]), np.array([2.0]))
    assert found.wrench == pytest.approx(2.0 * np.eye(6)[effect], rel=0.02)
    assert len(found.unobservable) == 5


def test_the_estimate_is_the_damped_pseudo_inverse_of_the_scaled_jacobian():
    """λ = 1 N·m / 100 N for a force in efforts of deviation 1 N·m: without an uncertainty."""
    efforts = Efforts(load_arm(robot_urdf('ur10')), 'tool0', largest_force=100.0,
                      largest_torque=100.0)
    r = np.array([3.0, -8.0, 5.0, 2.0, 1.0, -0.5])
    J = efforts.estimator.jacobian(TILTED)
    found = efforts(TILTED, r)
    assert found.wrench == pytest.approx(
        np.linalg.solve(J @ J.T + 0.01**2 * np.eye(6), J @ r), rel=1e-9)
    assert found.covariance is None


def test_the_error_is_within_the_covariance_for_every_expected_wrench():
    """Noise and shrinkage together: E[e eᵀ] <= P for |D⁻¹ F| <= 1, also near singularities."""
    sigma, D = 2.0, np.repeat([100.0, 10.0], 3)
    efforts = Efforts(certain('ur10', sigma), 'tool0')
    rng = np.random.default_rng(0)
    for _ in range(15):
        q = rng.uniform(-2.0, 2.0, 6)
        q[4] *= rng.choice([1.0, 1e-2, 0.0])
        J = efforts.estimator.jacobian(q)
        columns = [efforts(q, unit).wrench for unit in np.eye(6)]
        K, P = np.array(columns).T, efforts(q, np.zeros(6)).covariance
        w = rng.normal(size=6)
        bias = (K @ J.T - np.eye(6)) @ (D * w / np.linalg.norm(w))
        excess = P - sigma**2 * K @ K.T - np.outer(bias, bias)
        assert np.linalg.eigvalsh(excess / np.outer(D, D)).min() > -1e-5


def test_directions_without_an_effect_are_listed():
    arm = certain('default', 0.1)
    found = Efforts(arm, 'tool0')(np.array([0.3, 0.9]), np.array([1.0, 2.0]))
    # of a planar arm: the force across the plane, and all torques but for a combination
    assert len(found.unobservable) == 4
    assert np.abs(found.wrench[[1, 3, 5]]).max() < 1e-6
    assert np.sqrt(np.diag(found.covariance))[[1, 3, 5]] == pytest.approx([100.0, 10.0, 10.0])
    # a UR10 with aligned wrist axes
    efforts = Efforts(certain('ur10', 0.1), 'tool0')
    aligned = TILTED * [1, 1, 1, 1, 0, 1]
    lost = efforts(aligned, np.zeros(6)).unobservable
    assert len(lost) == 1
    assert np.abs(efforts.estimator.jacobian(aligned).T @ lost[0]).max() < 1.0
    # an arm stretched out bears any force along itself
    stretched = Efforts(arm, 'tool0')(np.zeros(2), np.zeros(2)).unobservable
    along = np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    assert np.abs(stretched @ along).max() == pytest.approx(along @ along)


def test_the_bias_at_a_request_is_subtracted():
    efforts = Efforts(certain('ur10', 0.1), 'tool0')
    bias, F = np.array([0.5, -2.0, 1.0, 0.3, -0.2, 0.1]), np.array([0.0, 8.0, 0.0, 0.5, 0.0, 0.0])
    with pytest.raises(InvalidInputError, match=r'estimated for 0\.0 s, expected at least 1\.0 s'):
        efforts.estimator.zero()
    for _ in range(5):
        efforts(TILTED, bias)
    efforts.estimator.zero()
    other = TILTED + 0.4
    for q in (TILTED, other):
        found = efforts(q, bias + efforts.estimator.jacobian(q).T @ F)
        assert found.wrench == pytest.approx(F, abs=0.05)
    efforts.estimator.restart()
    assert efforts(TILTED, bias).wrench == pytest.approx(np.zeros(6), abs=0.01)


def test_the_bias_is_the_mean_of_the_last_200_ms():
    efforts, F = Efforts(certain('ur10', 0.1), 'tool0'), np.array([0.0, 8.0, 0.0, 0.5, 0.0, 0.0])
    for _ in range(5):
        efforts(TILTED, np.zeros(6))
    effort = efforts.estimator.jacobian(TILTED).T @ F
    efforts(TILTED, effort, 0.2)
    efforts.estimator.zero()
    assert efforts(TILTED, effort).wrench == pytest.approx(np.exp(-1.0) * F, abs=0.05)


def test_errors_of_the_model_cancel_in_the_pose_of_the_zero():
    """The parameters' part of the covariance is that of the difference of both poses."""
    arm = model_arm('ur10')
    efforts = Efforts(replace(arm, uncertainty=replace(
        arm.uncertainty, friction_deviation=np.zeros(6))), 'tool0')
    for _ in range(5):
        before = efforts(TILTED, np.zeros(6)).covariance
    efforts.estimator.zero()
    here, there = (efforts(q, np.zeros(6)).covariance for q in (TILTED, TILTED + 1.0))
    here, before, there = (np.trace(one[:3, :3]) for one in (here, before, there))
    assert here < 0.1 * before
    assert here < 0.5 * there


@pytest.mark.parametrize(('options', 'words'), [
    ({'frame': 'tool1'}, "external_wrench.frame is 'tool1', expected one of the links ['base"),
    ({'largest_force': 0.0}, 'external_wrench.largest_force is 0, expected a number > 0'),
    ({'largest_torque': np.nan}, 'external_wrench.largest_torque is nan, expected'),
])
def test_bad_input_is_rejected(options, words):
    dynamics = ArmDynamics(load_arm(robot_urdf('ur10')))
    with pytest.raises(InvalidInputError) as caught:
        ExternalWrenchEstimator(
            dynamics, ExternalEffort(dynamics, 10.0), **{'frame': 'tool0', **options})
    assert words in str(caught.value)


CUTOFF = 5.0
OMEGA = 2.0 * math.pi * CUTOFF


# ------------------------------------------------------------------------------ the filter

def test_it_is_the_butterworth_filter_of_scipy():
    signal = pytest.importorskip('scipy.signal')
    t = np.arange(400) * 2e-3
    u = np.random.default_rng(0).normal(size=400)
    u[0] = 0.0
    _, expected, states = signal.lsim(([OMEGA**2], [1.0, math.sqrt(2.0) * OMEGA, OMEGA**2]), u, t)
    low_pass = LowPass(CUTOFF)
    values = [low_pass.update(sample, 2e-3).copy() for sample in u[:, None]]
    assert np.array(values)[:, 0] == pytest.approx(expected, abs=1e-10)
    assert low_pass.rate[0] == pytest.approx(OMEGA**2 * states[-1, 0], abs=1e-8)


@pytest.mark.parametrize('held', [False, True])
def test_steps_may_be_cut_anywhere(held):
    """The signal between two samples is known, so that additional samples change nothing."""
    random = np.random.default_rng(1)
    whole, cut = LowPass(CUTOFF), LowPass(CUTOFF)
    last = random.normal(size=3)
    whole.update(last, 0.0)
    cut.update(last, 0.0)
    for dt in (1e-4, 0.003, 0.05, 0.4, 2.0):
        sample = random.normal(size=3)
        whole.update(sample, dt, held)
        cut.update(sample if held else last + 0.3 * (sample - last), 0.3 * dt, held)
        assert cut.update(sample, 0.7 * dt, held) == pytest.approx(whole.value, abs=1e-12)
        assert cut.rate == pytest.approx(whole.rate, abs=1e-10)
        last = sample


@pytest.mark.parametrize('cutoff', [0.0, -2.0, math.nan])
def test_a_cutoff_has_to_be_positive(cutoff):
    with pytest.raises(InvalidInputError, match='cutoff'):
        LowPass(cutoff)


# ------------------------------------------------------------------------------ the residual

def motion(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a slow motion, of 0.3 and 0.5 Hz."""
    w, A = 2.0 * math.pi * np.array([0.3, 0.5]), np.array([0.8, 0.6])
    return A * np.sin(w * t), A * w * np.cos(w * t), -A * w**2 * np.sin(w * t)


def residuals(
    true: ArmDynamics, model: ArmDynamics, dt: float = 2e-3, wrapped: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the last residuals (m, n), and the velocities at the same times."""
    live, found = LiveResidual(model, CUTOFF), []
    lag = math.sqrt(2.0) / OMEGA
    for k in range(1000):
        q, v, a = motion(k * dt)
        effort = true.inverse_dynamics(*motion((k - 0.5) * dt))  # held since the previous state
        q_seen = np.mod(q, 2.0 * np.pi) if wrapped else q
        residual = live.update(dt, q_seen, v, effort)
        assert (residual is None) == (k * dt < 7.0 / OMEGA)
        if residual is not None and k > 500:
            found.append((residual, motion(k * dt - lag)[1]))
    return np.array([pair[0] for pair in found]), np.array([pair[1] for pair in found])


def test_the_right_model_leaves_little_also_if_encoders_step_by_whole_turns():
    assert set(ARM.joint_kinds) == {'continuous'}
    dynamics = ArmDynamics(ARM)
    left, _ = residuals(dynamics, dynamics)
    assert np.abs(left).max() < 0.25  # of 60 N·m: the filter and the nonlinear M(q) do not commute
    assert residuals(dynamics, dynamics, wrapped=True)[0] == pytest.approx(left, abs=1e-9)


def test_what_the_model_lacks_is_left():
    friction = make_friction(ARM.joint_names, [2.0, 1.0])
    left, v = residuals(ArmDynamics(ARM.with_friction(friction)), ArmDynamics(ARM))
    assert left == pytest.approx(friction.viscous * v, abs=0.25)
    assert np.abs(friction.viscous * v).max(axis=0) == pytest.approx([3.0, 1.9], rel=0.1)


def test_a_residual_is_one_batch_and_checks_no_state():
    live = LiveResidual(ArmDynamics(ARM), CUTOFF)

    def work() -> object:
        return live.update(0.1, np.zeros(2), np.zeros(2), np.zeros(2))

    for _ in range(20):  # then the filters have settled
        work()
    calls = calls_of(work)
    assert calls['_rnea_in_parallel' if HAS_PARALLEL_RNEA else '_rnea_one_by_one'] == 4
    assert not {'check_vector', 'check_samples'} & calls.keys()


@pytest.mark.parametrize('estimator', [ExternalEffort, LiveResidual])
def test_the_noise_of_an_estimate_is_that_of_its_bandwidth(estimator):
    # effort noise of 2 N·m in each sample at 200 Hz, which is 100 Hz of bandwidth
    rate, band = 200.0, 20.0
    uncertainty = make_uncertainty(
        ARM, noise_deviation=[2.0 * np.sqrt(band / (0.5 * rate))], noise_bandwidth=band)
    dynamics = ArmDynamics(replace(ARM, uncertainty=uncertainty))
    estimate = estimator(dynamics, 25.0)
    q, rest = np.array([0.4, 0.3]), np.zeros(2)
    gravity = dynamics.rigid_body.gravity(q)
    rng = np.random.default_rng(0)
    found = [estimate.update(1.0 / rate, q, rest, gravity + 2.0 * noise)
             for noise in rng.normal(size=(1000, 2))]
    measured = np.std([each for each in found[50:] if each is not None])
    expected = uncertainty.noise(estimate.noise_bandwidth, 1.0 / rate)
    assert measured == pytest.approx(expected[0], rel=0.1)
    # noise of a narrower band has all its power, that of a wider one ends at the sampling rate
    assert uncertainty.noise(1.0, 1.0 / rate) == pytest.approx(uncertainty.noise_deviation)
    assert uncertainty.noise(1e6, 1.0 / rate) == pytest.approx([2.0, 2.0])
