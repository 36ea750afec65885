# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Computed torque along several segments, for many joints, and without friction of the robot."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.gains.gain_scaling import LOOP_DELAY
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import LawInput
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Gains, make_gains
from robot_dynamics.control.laws.rate_limited_feedback import CHANGE_FRACTION, REVERSAL_TIME
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_limiter import EffortLimiter, EffortLimits
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.follower import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
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
        one.update(START + 5 * (k - 20) * MS, zero, zero)
    one.follow(make_trajectory(NAMES, (0.3, 0.6, 0.9), POINTS, VELOCITIES, (), NAMES), START)
    return [one.update(START + 5 * k * MS, zero, zero) for k in range(1, 200)]


def test_each_segment_of_a_path_is_followed():
    dynamics, zero = ArmDynamics(ARM), np.zeros(2)
    for output in along_a_path():
        reference = output.reference
        a = reference.acceleration + GAINS.kd * reference.velocity + GAINS.kp * reference.position
        assert output.computed_torque == pytest.approx(dynamics.inverse_dynamics(zero, zero, a))


def feedback_of(
    error: float, speed: float, rate: float, softens: bool = True,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return K_p e and K_d ė of the feedback (2,) [1/s²], as in full, and s."""
    one = Controller(ARM, ControllerOptions(GAINS, effort_rate=rate, scales_gains=softens))
    q, body = np.zeros(2), ArmDynamics(ARM).rigid_body
    for k in range(20):
        one.update(START + 2 * k * MS, q, q)
    one.follow(make_trajectory(NAMES, (0.0,), [[error, -error]], (), (), NAMES), 0)
    v = np.full(2, speed)
    output = one.update(START + 40 * MS, q, v)
    effort, terms = output.computed_torque, output.terms
    assert terms.effort == pytest.approx(effort)
    K_p_e, K_d_e_dot, s = GAINS.kp * [error, -error], -GAINS.kd * v, output.scale
    M, rest = body.mass_matrix(q), body.nonlinear(q, v)
    largest = np.abs(M @ K_p_e).max()
    of_position = min(1.0, 0.5 * REVERSAL_TIME * rate / max(largest, 1e-300))
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
    of_change = CHANGE_FRACTION * rate / max(change, 1e-300)
    of_size = 0.5 * REVERSAL_TIME * rate / max(size, 1e-300)
    assert s == pytest.approx(min(1.0, max(math.sqrt(of_change), of_size)), rel=1e-6)


@pytest.mark.parametrize('error', [1e-3, 0.5, 3.0])
def test_a_steady_error_is_fed_back_in_full(error):
    """That under a load, for example, of any size."""
    assert feedback_of(error, 0.0, 10.0)[2] == 1.0


def test_without_softening_or_a_rate_limit_nothing_is_limited():
    assert feedback_of(0.5, 5.0, 10.0, softens=False)[2] == 1.0
    assert feedback_of(0.5, 5.0, np.inf)[2] == 1.0


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('gains', [
    Gains(np.zeros(2), np.zeros(2)), Gains(np.zeros(2), np.array([5e-324, 1e-310])),
    Gains(np.full(2, 1e8), np.full(2, 1e8))])
def test_gains_of_any_size_give_finite_efforts(gains):
    one = Controller(ARM, ControllerOptions(gains, effort_rate=1e3, scales_gains=True))
    zero = np.zeros(2)
    one.update(START, zero, zero)
    one.stop()
    for k in range(1, 20):
        output = one.update(START + 2 * k * MS, zero, np.full(2, 0.1))
    assert np.isfinite(output.command).all()
    assert (output.scale < 1.0) == bool(gains.kp.any())


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
    one.update(now, q, v)
    one.follow(make_trajectory(NAMES, (duration,), [goal], (), (), NAMES), 0)
    acts = one.update(now, q, v).holding_effort()
    for _ in range(round(seconds / period)):
        now += round(1e9 * period)
        output = one.update(now, q, v)
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
    ([1.0, 0.5], 0.01, {}),
    ([3.0, -2.0], 0.01, {}),
    ([1.0, 0.5], 2.0, {'rate': 300.0}),
    ([2.0, 1.0], 0.5, {'frequency': 60.0}),
])
def test_an_arm_arrives_at_any_set_point(goal, duration, options):
    """One point without velocities: the reference is a line, and its velocity has a step."""
    assert final_error(goal, duration, **options) < 1e-3  # type: ignore[arg-type]


def test_feedback_that_is_not_limited_lets_it_diverge():
    assert final_error([1.0, 0.5], 0.01, softens=False) > 1.0


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


@pytest.mark.parametrize(('period', 'is_slow'), [(0.05, True), (0.002, False)])
def test_at_slow_rates_bandwidth_and_position_are_those_of_the_delay(period, is_slow):
    """M, C and g are those of the position half of the delay ahead, but not at fast rates."""
    one = Controller(ARM, ControllerOptions(GAINS, scales_gains=True))
    q, v = np.array([0.8, 0.5]), np.array([0.4, -0.3])
    for k in range(20):
        one.update(START + round(1e9 * period) * k, q, v)
    one.follow(make_trajectory(NAMES, (0.0,), [[1.0, 0.4]], (), (), NAMES), 0)
    output = one.update(START + round(1e9 * period) * 20, q, v)
    s = one.gains.least
    assert output.scale == s
    assert (s < 0.5) if is_slow else (s == 1.0)
    a = s * GAINS.kd * -v + s**2 * GAINS.kp * ([1.0, 0.4] - q)
    q_ahead = q + 0.5 * (period + LOOP_DELAY) * v if is_slow else q
    assert output.computed_torque == pytest.approx(
        ArmDynamics(ARM).inverse_dynamics(q_ahead, v, a))


@pytest.mark.parametrize('scale', [[0.5, 0.5], [0.2, 1.0], [1.0, 1.0]])
def test_each_joint_has_its_own_scale(scale):
    feedback, zero = ErrorFeedback(GAINS, ARM.joint_kinds), np.zeros(2)
    law, s = ComputedTorque(feedback, ControllerOptions(GAINS)), np.array(scale)
    law.scale_gains(np.array([0.1, 0.1]))  # replaced, not accumulated
    law.scale_gains(s)
    for full, expected in zip(law.closed_loop(np.eye(2)), (GAINS.kp, GAINS.kd)):
        assert full.tolist() == np.diag(expected).tolist()  # of the unscaled law
    point = [[0.1, -0.2]]
    active = ActiveTrajectory(
        make_trajectory(NAMES, (0.0,), point, [[0.0, 0.0]], (), NAMES), START, START,
        Reference(*np.zeros((3, 2))))
    v = np.array([0.3, 0.4])
    output = law(LawInput(UncheckedArmDynamics(ARM), START, zero, v, zero, active, feedback))
    assert output.effort == pytest.approx(ArmDynamics(ARM).inverse_dynamics(
        zero, v, s**2 * GAINS.kp * point[0] - s * GAINS.kd * v))


def test_the_law_itself_needs_a_reference_and_a_velocity():
    feedback, zero = ErrorFeedback(GAINS, ARM.joint_kinds), np.zeros(2)
    law = ComputedTorque(feedback, ControllerOptions(GAINS))
    active = ActiveTrajectory(
        make_trajectory(NAMES, (0.3,), POINTS[:1], (), (), NAMES), START, START,
        Reference(zero, zero, zero))
    dynamics = UncheckedArmDynamics(ARM)
    for v, reference in ((None, active), (zero, None)):
        with pytest.raises(ValueError, match='needs a reference and a velocity'):
            law(LawInput(dynamics, START, zero, v, zero, reference, feedback))
    output = law(LawInput(dynamics, START, zero, zero, zero, active, feedback))
    with pytest.raises(ValueError, match='read-only'):
        output.friction[0] = 1.0  # the next outputs share it
