# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction of joints without a signal, and the effort of their stop, with the real loop."""

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

from lock_step_loop import directions, FIRST_STAMP, frozen, LockStep, MS
import numpy as np
import pytest
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.safety.frozen_joint_observer import FrozenJointObserver
from robot_dynamics.control.safety.frozen_joints import (
    CALM,
    DISTURBANCE_TIME,
    FrozenJoints,
    HELD_CALM,
    STOP_TIME,
)
from robot_dynamics.joints.effort_calibration import EffortCalibration, make_effort_calibration
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robots import robot_urdf

DT = 0.002
HOLD = 2.5
"""[s]"""


def in_motion(
    rate: float = 500.0, seconds: float = 0.3, drive: EffortCalibration | None = None,
    coulomb: Sequence[float] = (),
) -> LockStep:
    """Return a UR10 that has moved for this time on its way of 1 rad at all joints."""
    arm = load_arm(robot_urdf('ur10'))
    if drive is not None:
        arm = arm.with_drive(drive)
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=coulomb))
    one = LockStep(arm, q=np.array([0.0, -1.0, 1.0, 0.0, 1.0, 0.0]), rate=rate)
    one.run(0.2)
    one.follow(one.q - directions(6))
    one.run(seconds)
    return one


class Case(NamedTuple):
    """Joints that are frozen now, and the state at which the law is evaluated."""

    frozen: FrozenJoints
    controller: Controller
    marks: BoolArray
    output: ControlOutput


def case_at(
    marks: list[int], e: FloatArray, e_dot: FloatArray, drive: EffortCalibration | None = None,
    coulomb: Sequence[float] = (),
) -> Case:
    """Return a moving arm with these joints frozen, at these errors."""
    one = in_motion(drive=drive, coulomb=coulomb)
    controller, n = one.loop.controller, len(one.q)
    mask = np.isin(np.arange(n), marks)
    stamp = FIRST_STAMP + one.k * MS
    frozen = FrozenJoints(
        mask, np.full(n, stamp - 10 * MS), controller, stamp, DT, one.q, one.v)
    reference = controller.trajectory.sample(stamp)
    output = controller.update(stamp, reference.position - e, reference.velocity - e_dot)
    return Case(frozen, controller, mask, output)


E = np.array([0.01, -0.02, 0.015, 0.01, -0.01, 0.02])
E_DOT = np.array([0.1, 0.05, -0.1, 0.02, 0.05, -0.03])


@pytest.mark.parametrize('marks', [[0], [2], [1, 4], [5]])
def test_a_disturbance_takes_the_coupling_from_frozen_joints_only(marks):
    """The others keep their accelerations; the frozen ones miss M_mm⁻¹ (M d)_m."""
    frozen, controller, mask, output = case_at(marks, E, E_DOT)
    K_p, K_d = controller.feedback_gains
    d = np.where(mask, 0.0, K_p * E + K_d * E_DOT)
    for _ in range(2):  # ë = 0: the disturbance is steady
        effort = frozen.stopping_effort(output, DT, output.state.q, output.state.v, np.zeros(6))
        M, _ = controller.motion_equation(output, output.state.q, output.state.v)
        missing = np.linalg.solve(M, output.command - effort)
        assert missing[~mask] == pytest.approx(np.zeros((~mask).sum()), abs=1e-9)
        expected = np.linalg.solve(M[np.ix_(mask, mask)], (M @ d)[mask])
        assert missing[mask] == pytest.approx(expected)
        assert np.abs(expected).max() > 0.1


def test_an_acceleration_that_happens_is_no_disturbance():
    """The part with ë = −K_d ė − K_p e decays with DISTURBANCE_TIME."""
    e, e_dot = E.copy(), E_DOT.copy()
    frozen, controller, mask, first = case_at([2], e, e_dot)
    K_p, K_d = controller.feedback_gains
    state = first.state
    reference = state.trajectory.sample(state.stamp_ns)
    largest = []
    for _ in range(round(6.0 * DISTURBANCE_TIME / DT)):
        state = first.state._replace(
            q=reference.position - e, v=reference.velocity - e_dot)
        output = controller.update(state.stamp_ns, state.q, state.v)
        effort = frozen.stopping_effort(output, DT, state.q, state.v, np.zeros(6))
        largest.append(np.abs(output.command - effort).max())
        before = e_dot
        e_dot = e_dot - DT * (K_d * e_dot + K_p * e)
        e = e + 0.5 * DT * (before + e_dot)
    assert largest[0] > 0.1
    assert largest[-1] < 0.02 * largest[0]
    assert mask.tolist() == [j == 2 for j in range(6)]


def test_the_effort_without_a_command_holds_the_arm():
    frozen, controller, _, output = case_at([2], E, E_DOT)
    output.command = None
    hold = np.arange(6.0)
    assert frozen.stopping_effort(output, DT, output.state.q, None, hold) is hold
    resting = controller.update(output.state.stamp_ns, output.state.q, None)
    effort = frozen.stopping_effort(resting, DT, output.state.q, None, hold)
    assert effort is resting.command


class Predictions:
    """The predicted states of an arm with one frozen joint, 2 ms apart; two at first."""

    def __init__(self, scale: float = 1.0) -> None:
        """Drives deliver `scale` times their command."""
        arm = load_arm(robot_urdf('ur10'))
        self.case = case_at([1], E, E_DOT, make_effort_calibration(
            arm.joint_names, [scale], (), arm.limits.effort))
        state, body = self.case.output.state, self.case.controller.dynamics.rigid_body
        self.command = body.nonlinear(state.q, state.v) / scale
        self.states: list[tuple[FloatArray, FloatArray]] = []
        self.predict(DT, self.command)
        self.observer = self.case.frozen._observer
        self.observer._weight = 1.0  # as after FILTER_TIME
        self.predict(DT, self.command)

    def predict(self, dt: float, command: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Predict at the next stamp."""
        state = self.case.output.state
        stamp = state.stamp_ns + len(self.states) * 2 * MS
        self.states.append(self.case.frozen.predict(stamp, dt, state.q, state.v, command))
        return self.states[-1]


def test_the_estimate_is_used_and_continues_as_a_prediction_when_it_is_invalid():
    found = Predictions()
    q, v = found.states[-1]
    assert (q[1], v[1]) == (found.observer.q[1], found.observer.v[1])
    used = found.case.output.state.v
    assert found.observer.v[[0, 2, 3, 4, 5]].tolist() == used[[0, 2, 3, 4, 5]].tolist()
    found.observer.is_valid = False
    further = found.predict(DT, found.command)
    assert further[0][1] == pytest.approx(q[1] + DT * v[1], abs=2e-4)
    assert further[1][1] == pytest.approx(v[1], abs=0.1)
    assert found.observer.q[1] == q[1]


@pytest.mark.parametrize(('dt', 'has_command'), [(0.0, True), (DT, False)])
def test_without_a_period_or_a_command_the_motion_is_predicted(dt, has_command):
    found = Predictions()
    q, v = found.states[-1]
    further = found.predict(dt, found.command if has_command else None)
    assert found.observer.q[1] == q[1]
    assert further[0][1] == pytest.approx(q[1] + DT * v[1], abs=2.5e-3)
    assert np.isfinite(further).all()


def test_the_observer_takes_the_torque_that_the_drives_deliver():
    found = Predictions(2.0)
    dynamics, state = found.case.controller.dynamics, found.case.output.state
    expected = FrozenJointObserver(found.case.marks, dynamics, *found.states[0])
    expected.update(dynamics, 2.0 * found.command, DT, state.q, state.v)
    assert found.observer.q.tolist() == expected.q.tolist()
    assert found.observer.v.tolist() == expected.v.tolist()


@pytest.mark.parametrize('joint', range(6))
@pytest.mark.parametrize('rate', [500.0, 250.0])
def test_the_predicted_motion_is_the_true_one(joint, rate):
    """Until the fault is found, and for 0.1 s of the stop."""
    one = in_motion(rate)
    q, v = one.q[joint], one.v[joint]
    one.sensor = frozen(joint)
    loop = one.loop
    while loop.supervisor.fault is None:
        one.run(DT)
    for share in (0.2, 0.5):
        used = loop.controller.state
        moved = abs(one.q[joint] - q)
        assert used[1][joint] == pytest.approx(one.q[joint], abs=0.004 + 0.2 * moved)
        assert used[2][joint] == pytest.approx(one.v[joint], abs=share * abs(v))
        one.run(0.1)
    assert moved > 0.01


def test_an_effort_that_is_limited_accelerates_the_predicted_joints():
    """ë changes by −M_mm⁻¹ Δτ_m; a joint with a signal, and its effort, change nothing."""
    frozen, controller, mask, output = case_at([2, 4], E, E_DOT)
    asked = frozen.stopping_effort(output, DT, output.state.q, output.state.v, np.zeros(6))
    M, _ = controller.motion_equation(output, output.state.q, output.state.v)
    found = []
    for change in (np.zeros(6), np.array([9.0, -4.0, 20.0, 3.0, -2.0, 1.0])):
        one = copy(frozen)
        one._follow(DT, asked + change)
        found.append(one._e_dot)
    expected = np.zeros(6)
    expected[mask] = -DT * np.linalg.solve(M[np.ix_(mask, mask)], [20.0, -2.0])
    assert found[1] - found[0] == pytest.approx(expected, rel=0.05, abs=1e-12)
    assert np.abs(expected).max() > 1e-3
    one = copy(frozen)
    one._follow(DT, None)
    assert one._e_dot.tolist() == found[0].tolist()


def after(stamp_ns: int, seconds: float) -> int:
    """Return a later stamp."""
    return stamp_ns + round(1e9 * seconds)


def test_the_arm_is_lost_after_its_hold_time_or_if_other_joints_move():
    """An observer, or friction that it found, holds the arm for any time."""
    frozen, controller, mask, output = case_at([2], 0.0 * E, 0.0 * E)
    limit, still = controller.arm.limits.velocity, np.zeros(6)
    start = output.state.stamp_ns
    assert not controller.has_stopped
    fast = np.where(mask, 0.0, 2.0 * CALM * limit)
    assert not frozen.is_lost(fast, after(start, STOP_TIME), HOLD)
    assert frozen.is_lost(fast, after(start, STOP_TIME + 0.1), HOLD)
    frozen, controller, mask, output = case_at([2], 0.0 * E, 0.0 * E)
    stamp = output.state.stamp_ns
    controller.stop()
    while not controller.has_stopped:
        assert not frozen.is_lost(fast, stamp, HOLD)
        stamp += 2 * MS
        controller.update(stamp, output.state.q, still)
    assert not frozen.is_lost(None, stamp, HOLD)
    assert not frozen.is_lost(0.99 * CALM * limit, stamp, HOLD)
    assert not frozen.is_lost(np.where(mask, limit, 0.0), stamp, HOLD)
    for j in np.flatnonzero(~mask):
        assert frozen.is_lost(np.where(np.arange(6) == j, -1.01 * CALM * limit, 0.0), stamp, HOLD)
    assert not frozen.is_lost(still, after(stamp, HOLD - DT), HOLD)
    assert frozen.is_lost(still, after(stamp, HOLD + DT), HOLD)
    frozen.predict(stamp, DT, output.state.q, still, None)
    observer = frozen._observer
    assert frozen.is_lost(still, after(stamp, HOLD + DT), HOLD)
    observer._weight = 1.0  # as after FILTER_TIME
    assert not frozen.is_lost(still, after(stamp, HOLD + DT), HOLD)
    observer.is_valid = False
    assert frozen.is_lost(still, after(stamp, HOLD + DT), HOLD)
    observer.is_held = True
    assert not frozen.is_lost(still, after(stamp, HOLD + DT), HOLD)
    others = np.where(mask, 0.0, HELD_CALM * limit)
    assert not frozen.is_lost(0.99 * others, stamp, HOLD)
    assert frozen.is_lost(1.01 * others, stamp, HOLD)


@pytest.mark.parametrize(('coulomb', 'is_held'), [
    ((0.0, 0.0, 0.0), False), ((4.0, 4.0, 0.0), False), ((4.0, 4.0, 1.4), False),
    ((0.0, 3.4, 1.6), True)])
def test_known_friction_at_all_frozen_joints_holds_the_arm(coulomb, is_held):
    """Joints 1 and 2 are frozen; 1 % of their limits is 3.3 and 1.5 N·m."""
    frozen, controller, mask, output = case_at(
        [1, 2], 0.0 * E, 0.0 * E, coulomb=(*coulomb, 0.0, 0.0, 0.0))
    stamp, still = output.state.stamp_ns, np.zeros(6)
    controller.stop()
    while not controller.has_stopped:
        assert not frozen.is_lost(still, stamp, HOLD)
        stamp += 2 * MS
        controller.update(stamp, output.state.q, still)
    assert frozen.is_lost(still, after(stamp, 100.0 * HOLD), HOLD) is not is_held
    limit = controller.arm.limits.velocity
    others = np.where(mask, 0.0, (HELD_CALM if any(coulomb[1:]) else CALM) * limit)
    assert not frozen.is_lost(0.99 * others, stamp, HOLD)
    assert frozen.is_lost(1.01 * others, stamp, HOLD)
