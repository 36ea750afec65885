# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Hand guiding in closed loop: the push that it needs, rest after it, speed, position limits.

Friction yields before it slides (`bristled_arm`), and the loop knows it, or too much of it. Of
the random arms that a hand moves and releases, the loop knows 0.6 to 1.4 times the friction, and
not the rotors. The force of a follower at its leader gives a bounded energy.
"""

from typing import Any

from bristled_arm import BristledArm, Case, COULOMB, ROTORS
from lock_step_loop import FIRST_STAMP, LockStep, middle, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.force_feedback import ForceFeedback
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload


@pytest.mark.parametrize('case', [
    Case('default', 100, 20, 3e-3, 1.2),
    pytest.param(Case('panda', 100, 20, 1e-3, 1.2, True), marks=pytest.mark.soak)],
    ids=lambda case: case.arm)
def test_no_limit_cycle_with_too_much_friction_and_two_periods_of_delay(case):
    one = BristledArm(smooth_arm(case.arm), case, command='hand_guiding')
    one.loop.controller.law.friction_share = 0.7
    one.v = np.random.default_rng(1).uniform(-0.1, 0.1, len(one.q))
    trace = one.run(4.0)
    moved = np.diff(trace.last(1.0).q, axis=0)
    to_and_fro = np.abs(moved).sum(axis=0) - np.abs(moved.sum(axis=0))
    assert to_and_fro.max() < 1e-5
    assert one.loop.supervisor.fault_count == 0


def test_a_released_arm_with_a_wrong_mass_creeps_less_than_5_mrad():
    """The error is an unknown load, whose gravity takes 60 % of the dry friction of a joint."""
    name, arm, case = 'z1', smooth_arm('z1'), Case('z1', 500, 4, 1e-3)
    q = middle(arm)
    last = arm.pinocchio_model.getJointId(arm.joint_names[-1])
    link = next(name for name in arm.link_names if arm.link_frame(name).parentJoint == last)

    def with_load(mass: float) -> ArmModel:
        return arm.with_payloads([make_payload(link, mass)])

    per_kg = np.abs(ArmDynamics(with_load(1.0)).gravity(q) - ArmDynamics(arm).gravity(q))
    mass = 0.6 / float((per_kg / COULOMB[name]).max())
    one = BristledArm(arm, case, command='hand_guiding', true_arm=with_load(mass))
    one.run(3.0)
    assert np.abs(one.q - q).max() < 5e-3
    assert one.loop.supervisor.fault_count == 0


@pytest.mark.parametrize(('name', 'rate'), [('panda', 500.0), ('ur10', 100.0)])
def test_a_strong_push_is_braked_and_held_within_the_position_limit(name, rate):
    arm = smooth_arm(name)
    q = middle(arm)
    q[0] = arm.limits.upper[0] - 1.0
    one = LockStep(arm, q=q, rate=rate, command='hand_guiding')
    one.run(0.2)
    body = ArmDynamics(arm)
    unit = np.zeros(len(one.q))
    unit[0] = 9.0 * (1.0 if rate > 200.0 else 0.3)
    one.push = lambda t: body.mass_matrix(one.q) @ unit
    trace = one.run(3.0)
    assert np.abs(trace.v[:, 0]).max() < 2.0  # [rad/s]; the default speed limit is 1
    assert (trace.q[:, 0] < arm.limits.upper[0] + 1e-3).all()
    assert one.loop.supervisor.fault_count == 0
    assert np.abs(trace.last(0.5).v[:, 0]).max() < 0.05


def answer_in_motion(arm: ArmModel, q: FloatArray, v: FloatArray, **options: Any) -> LoopAnswer:
    """Return the answer at q (n,) after a second at the velocity v (n,), with states at 100 Hz."""
    loop = ControlLoop.of_arm(arm, command='hand_guiding', **options)
    for k in range(101):
        answer = loop.answer(FIRST_STAMP + 10 * MS * k, q + 0.01 * (k - 100) * v, v)
    return answer


def effort_in_motion(arm: ArmModel, q: FloatArray, v: FloatArray, **options: Any) -> FloatArray:
    """Return its effort (n,)."""
    effort = answer_in_motion(arm, q, v, **options).effort
    assert effort is not None
    return effort


@pytest.mark.parametrize('side', [-1.0, 1.0])
def test_friction_is_not_compensated_towards_a_position_limit(side):
    arm = smooth_arm('z1')
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=COULOMB['z1']))
    q, v = middle(arm), np.zeros(arm.joint_count)
    q[-1] = (arm.limits.upper if side > 0.0 else arm.limits.lower)[-1] - side * 0.02
    v[-1] = side * 0.02
    push = effort_in_motion(arm, q, v) - ArmDynamics(arm).gravity(q)
    assert side * push[-1] < 0.0
    q[-1] -= side * 0.5
    push = effort_in_motion(arm, q, v) - ArmDynamics(arm).gravity(q)
    assert side * push[-1] > 0.1


def test_gravity_is_that_of_the_position_at_which_the_effort_acts():
    arm = smooth_arm('default')
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=COULOMB['default']))
    q, v = np.array([0.8, 0.5]), np.array([0.3, -0.2])
    assert answer_in_motion(arm, q, v).output.law.gravity == pytest.approx(
        ArmDynamics(arm).gravity(q + 0.009 * v), abs=1e-9)


@pytest.mark.parametrize(('name', 'signs'), [('default', 1.0), ('panda', -1.0)])
def test_the_brake_of_an_arm_that_is_too_fast_accelerates_no_joint(name, signs):
    """It is limited by one factor: limits of each joint by itself threw an elbow to 13 rad/s."""
    arm = smooth_arm(name)
    n = arm.joint_count
    v = 0.27 * arm.limits.velocity * np.where(np.arange(n) % 2, signs, 1.0)
    one = LockStep(arm, q=middle(arm, 0.4), v=v, rate=250.0, command='hand_guiding')
    trace = one.run(1.0)
    assert (np.abs(trace.v) < 0.6 * arm.limits.velocity).all()
    assert one.loop.supervisor.fault is None


def test_a_joint_whose_gravity_takes_its_whole_limit_leaves_a_brake_to_the_others():
    """The brake is shared by all joints, and the elbow turns at half its limit."""
    arm = smooth_arm('default').with_payloads([make_payload('link2', 20.0)])
    q, v = np.array([1.4, -1.3]), np.array([0.0, 5.0])
    gravity = ArmDynamics(arm).gravity(q + 0.009 * v)
    effort = effort_in_motion(arm, q, v)
    assert effort[0] == -arm.limits.effort[0] > gravity[0]
    assert effort[1] < gravity[1] - 0.1 * arm.limits.effort[1]


ARMS = ('default', 'panda', 'ur5', 'ur10', 'xarm7')
LAST = {'panda': 3, 'xarm7': 5, 'ur5': 3, 'ur10': 3}
"""Last joint that the hand moves, the last one by default: links behind it are light."""


class Released(BristledArm):
    """An arm that a hand has moved at random speeds up to 1 rad/s, and released."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        name = ARMS[seed % len(ARMS)]
        case = Case(
            name, int(rng.choice([125, 250, 500, 1000])), int(rng.integers(5)), 1e-3,
            float(rng.choice([0.6, 1.0, 1.4])), bool(name in ROTORS and rng.uniform() < 0.5))
        arm = smooth_arm(name)
        q = middle(arm) + rng.uniform(-0.4, 0.4, arm.joint_count)
        super().__init__(arm, case, q=q, command='hand_guiding')
        self._dynamics = ArmDynamics(arm)
        goal = rng.uniform(-1.0, 1.0, arm.joint_count)
        goal[LAST.get(name, 6) + 1:] = 0.0
        goal *= rng.uniform(0.3, 1.0) / np.abs(goal).max()
        self.run(0.1)

        def hand(t: float) -> FloatArray:
            speed = goal * min(1.0, 4.0 * (t - 0.1))
            return self.inertia @ (40.0 * (speed - self.v)) + 0.4 * self.coulomb * np.sign(goal)
        self.push = hand
        self.run(0.4)
        self.push = lambda t: 0.0

    @property
    def inertia(self) -> FloatArray:
        return np.asarray(self._dynamics.mass_matrix(self.q) + self._rotors)

    @property
    def energy(self) -> float:
        """Of links, rotors and bristles [J]; the loop compensates gravity exactly."""
        bristles = self.coulomb / self._d @ self._z**2
        return float(0.5 * (self.v @ self.inertia @ self.v + bristles))


@pytest.mark.parametrize('seed', [
    *range(3), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(3, 205))])
def test_a_released_arm_gains_no_energy_and_stands_within_a_second(seed):
    one = Released(seed)
    least = one.energy
    gain = 0.84e-3 * one.coulomb.sum()  # 0.84 of the true friction along 1 mrad, where it yields
    assert np.abs(one.v).max() > 0.05
    for _ in range(100):
        one.run(0.01)
        assert one.energy <= least + gain, seed
        least = min(least, one.energy)
    assert np.abs(one.v).max() < 0.01, seed
    assert one.loop.supervisor.fault_count == 0, seed


def test_a_hand_at_a_constant_speed_feels_no_brake():
    """It pushes at 0.9 rad/s with the 40 % of 0.6 N·m that are not compensated."""
    one = BristledArm(smooth_arm('panda'), Case('panda', 500, 2, 1e-3), command='hand_guiding')
    body, start, pushes = ArmDynamics(one.arm), one.q.copy(), list[float]()

    def hand(t: float) -> FloatArray:
        way = np.zeros(7)
        way[0] = 0.9
        t = max(t - 0.2, 0.0)
        effort = body.mass_matrix(one.q) @ (
            400.0 * (start + way * t - one.q) + 40.0 * (way - one.v))
        pushes.append(float(effort[0]))
        return np.asarray(effort)
    one.push = hand
    one.run(1.0)
    assert np.mean(pushes[-300:]) == pytest.approx(0.24, abs=0.01)


@pytest.mark.parametrize('ratio', [0.6, 1.4])
def test_an_arm_that_is_released_at_1_rad_s_stops_in_0_6_s(ratio):
    one = BristledArm(
        smooth_arm('panda'), Case('panda', 500, 2, 1e-3, ratio), command='hand_guiding')
    body, way = ArmDynamics(one.arm), np.eye(7)[0]
    one.push = lambda t: np.asarray(body.mass_matrix(one.q) @ (40.0 * (way - one.v)))
    one.run(0.4)
    one.push = lambda t: 0.0
    for duration, least, most in ((0.25, 0.5, 1.0), (0.25, 0.1, 0.5), (0.15, -0.01, 0.01)):
        one.run(duration)
        assert least < one.v[0] < most


DT = 0.002


def feedback() -> ForceFeedback:
    """Return the feedback of one joint with a gain of 0.5 and at most 10 N·m."""
    return ForceFeedback(0.5, np.array([40.0]))


def force(
    one: ForceFeedback, external: float, moved: float = 0.0, v: float = 0.0,
    friction: float = 0.0,
) -> float:
    return float(one.effort(
        np.array([external]), np.array([moved]), np.array([v]), DT, np.array([friction]))[0])


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_force_at_rest_or_against_the_motion_is_the_scaled_effort_within_its_limit(sign):
    one = feedback()
    assert force(one, 6.0 * sign) == 3.0 * sign
    assert force(one, 6.0 * sign, -0.001 * sign, -0.5 * sign) == 3.0 * sign
    assert force(one, 30.0 * sign) == 10.0 * sign


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_force_along_the_motion_gives_half_of_the_energy_that_it_has_received(sign):
    """It may act for a period and 16 ms until it ends; then the tank is empty."""
    one = feedback()
    assert force(one, 8.0 * sign) == 4.0 * sign
    assert force(one, 8.0 * sign, -0.01 * sign, -5.0 * sign) == 4.0 * sign  # receives 0.04 J
    speed = 2.0
    found = force(one, 8.0 * sign, 0.0, speed * sign)
    assert found * sign * speed * (DT + 0.016) == pytest.approx(0.02)
    given = 0.0
    for _ in range(1000):
        moved = DT * speed * sign
        given += found * moved
        found = force(one, 8.0 * sign, moved, speed * sign)
    assert given == pytest.approx(0.02, rel=1e-3)
    assert abs(found) < 1e-6


def test_dry_friction_that_remains_may_be_overcome_and_an_empty_tank_gives_nothing_else():
    one = feedback()
    assert force(one, 8.0, 0.0, 1.0) == 0.0
    assert force(one, 8.0, 0.0, 1.0, friction=1.5) == pytest.approx(1.5)
    one.restart()
    assert force(one, 8.0, 0.0, 1.0) == 0.0


def test_a_tank_holds_the_energy_of_the_largest_force_over_a_twentieth_of_a_radian():
    one = feedback()
    force(one, 40.0)
    for _ in range(100):
        force(one, 40.0, -0.01, -1.0)
    speed = 50.0
    assert force(one, 40.0, 0.0, speed) * speed * (DT + 0.016) == pytest.approx(0.5)
    one.restart()
    assert force(one, 40.0, 0.0, speed) == 0.0
