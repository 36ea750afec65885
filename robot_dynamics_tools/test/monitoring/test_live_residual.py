# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The causal filter, the filtered residual, and the noise of the estimates."""

from dataclasses import replace
import math

from counted_calls import calls_of
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.model.unchecked_rigid_body import HAS_PARALLEL_RNEA
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.monitoring.live_residual import LiveResidual
from robot_dynamics_tools.monitoring.low_pass import LowPass

CUTOFF = 5.0
OMEGA = 2.0 * math.pi * CUTOFF
ARM = load_arm(default_arm_urdf())


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
    assert not {'check_vector', 'check_samples', 'check_states'} & calls.keys()


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
