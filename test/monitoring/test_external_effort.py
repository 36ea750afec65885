# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The momentum observer: its estimate is the external effort after a known filter."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.effort_convention import joint_from_measured, measured_from_joint
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import make_payload
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.monitoring.momentum_observer import MomentumObserver
from simulated_arms import released, three_links

BANDWIDTH = 8.0
K = 2.0 * math.pi * BANDWIDTH
START = np.array([0.8, 0.5, -0.4])
PUSH = ExternalWrench('tool0', np.array([15.0, 4.0, -6.0]), np.array([0.0, 2.0, 0.0]))


def with_everything(arm: ArmModel) -> ArmModel:
    """Return the arm with viscous friction and rotors; another test covers dry friction."""
    names = arm.joint_names
    motors = make_actuators(names, [0.1] * 3, [80.0] * 3, rotor_inertia=[2e-5] * 3)
    return arm.with_friction(make_friction(names, [1.5, 0.8, 0.3])).with_actuators(motors)


# ------------------------------------------------------------------------------ the filter

@pytest.mark.parametrize('gain_times_dt', [1e-9, 1e-3, 0.5, 2.0, 50.0, 1e6])
def test_a_constant_effort_is_approached_as_by_a_first_order_filter(gain_times_dt):
    observer, effort = MomentumObserver(2, BANDWIDTH), np.array([3.0, -7.0])
    t = 0.0
    for dt in np.random.default_rng(1).exponential(gain_times_dt / K, 100).tolist():
        t += dt
        estimate = observer.update(dt * (effort + 2.0), np.full(2, 2.0 * dt), dt)
        assert estimate == pytest.approx(effort * -math.expm1(-K * t), rel=1e-9)


@pytest.mark.parametrize('bandwidth', [0.0, -1.0, math.nan, math.inf])
def test_a_bandwidth_has_to_be_positive(bandwidth):
    with pytest.raises(InvalidInputError, match='bandwidth'):
        MomentumObserver(2, bandwidth)


# ------------------------------------------------------------------------------ with a model

class Run(NamedTuple):
    """
    Estimates (m + 1, n) at the ends of m steps.

    `off` (m, n) is the difference between the effort that entered the filter and the true effort
    in each step, `v` (m, n) the velocity in the middle of each step.
    """

    estimates: np.ndarray
    off: np.ndarray
    v: np.ndarray


def run(
    arm: ArmModel, model: ArmModel, dt: float, seconds: float, push_at: float = 0.05,
    load: Any = None,
) -> Run:
    """
    Run the observer on an arm with an external push.

    `arm` moves under efforts that are held for `dt` [s]; PUSH acts from `push_at` on, and a `load`
    is added to arm and model at half of the time.
    """
    simulation = released(arm, START, np.array([0.5, -0.4, 0.8]), max_step=5e-4)
    body = ArmDynamics(arm).rigid_body
    observer = ExternalEffort(ArmDynamics(model), BANDWIDTH)
    hold = body.gravity(START)
    estimates, off, velocities = [np.zeros(3)], [], []
    observer.update(dt, *simulation.state, np.zeros(3))
    decay = math.exp(-K * dt)
    for k in range(round(seconds / dt)):
        if load is not None and k == round(0.5 * seconds / dt):
            simulation.set_payloads([load])
            observer.set_dynamics(ArmDynamics(model.with_payloads([load])))
        wrenches = [PUSH] if k * dt >= push_at - 1e-9 else []
        before, v = simulation.state
        effort = hold + 5.0 * np.sin(3.0 * k * dt + np.arange(3))
        simulation.step(effort, dt, wrenches)
        estimate = observer.update(dt, simulation.q, simulation.v, effort)
        true = -body.external(0.5 * (before + simulation.q), wrenches)
        off.append((estimate - decay * estimates[-1]) / (1.0 - decay) - true)
        estimates.append(estimate)
        velocities.append(0.5 * (v + simulation.v))
    return Run(np.array(estimates), np.array(off), np.array(velocities))


def test_a_push_is_followed_as_by_a_first_order_filter():
    """The mean external effort of each step is found; the error decreases with the step."""
    arm = with_everything(three_links())
    runs = [run(arm, arm, dt, 0.2) for dt in (4e-3, 2e-3, 1e-3)]
    errors = [np.abs(one.off).max() for one in runs]
    assert np.abs(runs[-1].estimates[:50]).max() < 1e-3  # before the push
    assert errors[-1] < 2e-3  # compared with a push of up to 20 N·m
    assert errors[0] > 3.5 * errors[1] > 12.0 * errors[2]


def test_a_load_that_the_model_has_too_makes_no_step():
    arm, load = with_everything(three_links()), make_payload('tool0', 3.0, (0.0, 0.0, 0.1))
    off = run(arm, arm, 1e-3, 0.2, push_at=1.0, load=load).off
    # compared with 12 N·m of weight, and with 1 N·m·s of momentum within 1 ms
    assert np.abs(off).max() < 5e-3


def test_a_restart_resets_the_estimate():
    observer = ExternalEffort(ArmDynamics(three_links()), BANDWIDTH)
    state = START, np.zeros(3), np.zeros(3)
    assert observer.update(1e-3, *state) is None
    first = observer.update(1e-3, *state)
    observer.update(1e-3, *state)
    observer.restart()
    assert observer.update(7.0, *state) is None
    again = observer.update(1e-3, *state)
    assert first.tolist() == np.asarray(again).tolist()


# ------------------------------------------------------------------------------ the effort

@pytest.mark.parametrize('kind', [
    'joint_torque', 'joint_torque_without_gravity', 'motor_torque', 'motor_current'])
def test_what_is_measured_gives_the_joint_effort_back(kind):
    motors = make_actuators(('a', 'b'), [0.1, 0.2], [50.0, -80.0], efficiency=[0.8, 0.9])
    random = np.random.default_rng(3)
    for _ in range(20):
        effort, v, gravity = random.normal(size=(3, 2))
        measured = measured_from_joint(kind, effort, v, gravity, motors)
        assert joint_from_measured(kind, measured, v, gravity, motors) == pytest.approx(effort)
    with pytest.raises(InvalidInputError, match="measured_effort is 'none'"):
        joint_from_measured('none', np.zeros(0), np.zeros(2), np.zeros(2), None)


def test_friction_of_gears_that_press_harder_under_load_is_no_environment():
    bare = three_links()
    names = bare.joint_names
    dynamics = ArmDynamics(bare.with_friction(make_friction(
        names, sigmoid=[1.0] * 3, load_coefficient=[0.2, 0.1, 0.3])))

    def motion(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        w, A = np.array([3.0, 4.0, 5.0]), np.array([0.5, 0.6, 0.4])
        return START + A * np.sin(w * t), A * w * np.cos(w * t), -A * w**2 * np.sin(w * t)

    observer, dt = ExternalEffort(dynamics, BANDWIDTH), 1e-3
    frictionless = ExternalEffort(ArmDynamics(bare), BANDWIDTH)
    seen, unseen = [], []
    for k in range(500):
        q, v, _ = motion(k * dt)
        effort = dynamics.inverse_dynamics(*motion((k - 0.5) * dt))
        seen.append(observer.update(dt, q, v, effort))
        unseen.append(frictionless.update(dt, q, v, effort))
    assert np.abs(np.array(seen[1:])).max() < 0.02
    assert np.abs(np.array(unseen[1:])).max() > 5.0
