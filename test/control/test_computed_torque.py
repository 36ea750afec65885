# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Computed torque along several segments, for many joints, and without friction of the robot."""

import math

from controller_bench import update
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_limiter import EffortLimiter, EffortLimits
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
GAINS = make_gains(NAMES)
MS = 1_000_000
START = 1_790_000_000_000 * MS
POINTS = [[0.05, -0.03], [-0.02, 0.06], [0.1, 0.05]]
VELOCITIES = [[0.2, -0.1], [0.1, 0.3], [0.0, 0.0]]


def along_a_path(arm: ArmModel = ARM, **options: object) -> list[ControlOutput]:
    """Return the answers at rest to a trajectory of three segments, at 200 Hz."""
    one = Controller(arm, ControllerOptions(GAINS, **options))  # type: ignore[arg-type]
    zero = np.zeros(2)
    for k in range(1, 21):  # then the rate of the states is known
        update(one, START + 5 * (k - 20) * MS, zero, zero)
    one.follow(make_trajectory(NAMES, (0.3, 0.6, 0.9), POINTS, VELOCITIES, (), NAMES), START)
    return [update(one, START + 5 * k * MS, zero, zero) for k in range(1, 200)]


def feedback_of(
    error: float, speed: float, rate: float, softens: bool = True,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return K_p e and K_d ė of the feedback (2,) [1/s²], as in full, and s."""
    one = Controller(ARM, ControllerOptions(GAINS, effort_rate=rate, scales_gains=softens))
    q, body = np.zeros(2), ArmDynamics(ARM).rigid_body
    for k in range(20):
        update(one, START + 2 * k * MS, q, q)
    one.follow(make_trajectory(NAMES, (0.0,), [[error, -error]], (), (), NAMES), 0)
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


def final_error(
    goal: list[float], duration: float, rate: float = 1000.0, softens: bool = True,
    frequency: float = 20.0, seconds: float = 4.0,
) -> float:
    """Return the final distance [rad] of the arm from its goal; infinite if the arm diverged."""
    plant, period = ArmDynamics(ARM), 0.002
    one = Controller(ARM, ControllerOptions(
        make_gains(NAMES, [frequency]), effort_rate=rate, scales_gains=softens))
    free = np.full(2, np.inf)
    guard = EffortLimiter(EffortLimits(-free, free, free, 0.0, rate))
    q, v, now = np.zeros(2), np.zeros(2), START
    update(one, now, q, v)
    one.follow(make_trajectory(NAMES, (duration,), [goal], (), (), NAMES), 0)
    acts = update(one, now, q, v).holding_effort()
    for _ in range(round(seconds / period)):
        now += round(1e9 * period)
        output = update(one, now, q, v)
        effort = guard.apply(output.command, output.holding_effort, q, v, period)
        for _ in range(2):  # the effort for the previous state acts
            v = v + 0.5 * period * plant.forward_dynamics(q, v, acts)
            q = q + 0.5 * period * v
        acts = effort
        if np.abs(q).max() > 20.0:
            return math.inf
    return float(np.abs(ErrorFeedback(GAINS, ARM.joint_kinds).position_error(
        np.array(goal), q)).max())


@pytest.mark.parametrize(('goal', 'duration', 'options'), [
    ([1.0, 0.5], 2.0, {}),
    ([3.0, -2.0], 0.01, {}),
    ([1.0, 0.5], 2.0, {'rate': 300.0}),
    ([2.0, 1.0], 0.5, {'frequency': 60.0}),
])
def test_an_arm_arrives_at_any_set_point(goal, duration, options):
    """One point without velocities: the reference is a line, and its velocity has a step."""
    assert final_error(goal, duration, **options) < 1e-3  # type: ignore[arg-type]


@pytest.mark.parametrize('compensates', [(), ('friction',)])
def test_friction_that_the_robot_compensates_is_not_commanded(compensates):
    rubbing = ARM.with_friction(make_friction(NAMES, viscous=[3.0], coulomb=[2.0]))
    commands = along_a_path(
        rubbing, effort_convention=EffortConvention(robot_compensates=compensates))
    bare = along_a_path(ARM)
    differences = [
        np.abs(np.subtract(one.command, other.command)).max()  # type: ignore[arg-type]
        for one, other in zip(commands, bare)]
    assert max(differences) < 1e-9 if compensates else max(differences) > 4.0

