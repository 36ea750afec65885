# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction of joints whose driver no longer updates their position and velocity."""

import math

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.safety.effort_bounds import NOTHING
from robot_dynamics.control.safety.frozen_joint_observer import FrozenJointObserver

LONGEST_PERIOD, STEP = 0.05, 0.002
"""[s] between two states for which the motion of a frozen joint is predicted, and its step."""
DISTURBANCE_TIME = 0.05
"""[s] of the low-pass filter of the disturbance of the other joints."""
STOP_TIME = 3.0
"""[s] for the stop of an arm with frozen joints, at most."""
CALM, HELD_CALM = 0.1, 0.3
"""Fractions of the velocity limit up to which joints count as held next to a frozen joint:
without friction at it, and with."""
LEAST_FRICTION = 0.01
"""Known dry friction that holds a predicted joint for any time, as a fraction of its limit."""
_MOST_STEPS = 100


class FrozenJoints:
    """
    The motion of joints without a signal, predicted by their closed loop with the reference.

    Until the fault is found, the feedback acts on the error of the frozen sample; afterwards on
    the predicted error e = q_r − q, which then decays by ë = −K_d ė − K_p e whatever the inertia.
    Without friction gravity lets such a prediction diverge: there `FrozenJointObserver` follows.

    Friction, a load or the frozen joint itself disturb the other joints: ë + K_d ė + K_p e = d is
    not 0. Computed torque would add M d, although the joints are not accelerated by d. The frozen
    joints m receive no effort for the coupling with it: with c_m = M_mm⁻¹ (M d)_m, the effort is
    lower by M c. The other joints then still follow their error equation.
    """

    def __init__(
        self, marks: BoolArray, since_ns: IntArray, controller: Controller, stamp_ns: int,
        dt: float, q: FloatArray, v: FloatArray | None,
    ) -> None:
        """
        Predict the joints `marks` (n,), whose samples (q, v) repeat since `since_ns` (n,).

        `dt` [s] is the period of the states, in which the feedback is constant.
        """
        self.marks, self._controller = marks, controller
        self._since_ns = self._moved_until_ns = stamp_ns
        self._observer: FrozenJointObserver | None = None
        self._robot = NOTHING
        v = v if v is not None else np.zeros_like(q)
        self._q = q
        self._e, self._e_dot, self._disturbance = np.zeros((3, len(q)))
        self._last_e_dot: FloatArray | None = None
        self._asked: tuple[FloatArray, FloatArray] | None = None
        """The last effort of the stop, before its rate was limited, and M."""
        trajectory = controller.trajectory
        if trajectory is None:
            return
        K_p, K_d = controller.feedback_gains
        start_ns = int(since_ns[marks].min())
        passed = 1e-9 * (stamp_ns - start_ns)
        count = min(max(round(passed / max(dt, 1e-4)), 1), _MOST_STEPS)
        h = passed / count
        q_r, v_r, _ = trajectory.sample(start_ns)
        e, e_dot = q_r - q, v_r - v
        for k in range(count):
            q_r, v_r, _ = trajectory.sample(start_ns + round(1e9 * k * h))
            e = e + 0.5 * h * e_dot
            e_dot = e_dot - h * (K_d * (v_r - v) + K_p * (q_r - q))
            e = e + 0.5 * h * e_dot
        self._e, self._e_dot = e, e_dot

    def mark(self, marks: BoolArray) -> None:
        """Change the joints (n,) without a signal; those of a new one begin another estimate."""
        if (marks != self.marks).any():
            self.marks, self._observer = marks, None

    def predict(
        self, stamp_ns: int, dt: float, q: FloatArray, v: FloatArray | None,
        command: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray | None]:
        """
        Return q and v (n,) with the predicted values of these joints, dt [s] later.

        `command` (n,) is the effort since the last state, None if there was none.
        """
        trajectory, velocity, m = self._controller.trajectory, np.zeros_like(q), self.marks
        if trajectory is not None:
            dt = min(max(dt, 0.0), LONGEST_PERIOD)
            q_r, v_r, _ = trajectory.sample(stamp_ns)
            observer = self._observed(dt, q, v, command)
            if observer is not None:
                self._q, velocity = observer.q, observer.v
                self._e, self._e_dot = q_r - self._q, v_r - velocity
            else:
                self._follow(dt, command)
                self._q, velocity = q_r - self._e, v_r - self._e_dot
        q, known = np.where(m, self._q, q), np.where(m, velocity, 0.0 if v is None else v)
        if self._observer is None and trajectory is not None:
            self._observer = FrozenJointObserver(m, self._controller.dynamics, q, known)
        return q, None if v is None else known

    def _observed(
        self, dt: float, q: FloatArray, v: FloatArray | None, command: FloatArray | None,
    ) -> FrozenJointObserver | None:
        """Update the observer, and return it if its estimate is used."""
        observer = self._observer
        if observer is None or not observer.is_valid or command is None or dt == 0.0:
            return None
        drive = self._controller.arm.drive
        effort = self._robot.effort(command if drive is None else drive.torque(command))
        observer.update(self._controller.dynamics, effort, dt, q, v)
        return observer if observer.is_used else None

    def stopping_effort(
        self, output: ControlOutput, dt: float, q: FloatArray, v: FloatArray | None,
        holding: FloatArray,
    ) -> FloatArray:
        """
        Return the effort (n,) of the planned stop at (q, v), dt [s] after the last state.

        Without a command the effort is `holding`.
        """
        command, state, m = output.command, output.state, self.marks
        self._robot = output.robot
        if command is None:
            return holding
        if state.trajectory is None or state.v is None:
            return command
        M, _ = self._controller.motion_equation(output, q, v)
        self._observe(state.position_error, state.velocity_error, dt)
        coupling = np.zeros_like(command)
        coupling[m] = np.linalg.lstsq(M[np.ix_(m, m)], (M @ self._disturbance)[m])[0]
        effort = np.asarray(command - M @ coupling)
        self._asked = effort, M
        return effort

    def is_lost(self, v: FloatArray | None, stamp_ns: int, hold_time: float) -> bool:
        """
        Return whether the arm is held no longer, at the velocity v (n,) of a state.

        The observer, and friction, hold the arm for any time, a prediction for `hold_time` [s].
        Other joints that move after the stop show that a joint has left its predicted position.
        Only with a law that follows references friction is found by its effort: a person who
        guides the arm pushes as well.
        """
        if not self._controller.has_stopped:
            self._moved_until_ns = stamp_ns
            return 1e-9 * (stamp_ns - self._since_ns) > STOP_TIME
        observer, arm = self._observer, self._controller.arm
        static, most = arm.friction.at_rest.static[self.marks], arm.limits.effort[self.marks]
        is_stuck = observer is not None and observer.is_held and self._controller.laws.follows
        has_friction = static.any() or is_stuck
        limit = (HELD_CALM if has_friction else CALM) * arm.limits.velocity
        if v is not None and bool((np.abs(v) > limit)[~self.marks].any()):
            return True
        is_held = is_stuck or (static >= LEAST_FRICTION * most).all() or (
            observer is not None and observer.is_used)
        return not is_held and 1e-9 * (stamp_ns - self._moved_until_ns) > hold_time

    def _observe(self, e: FloatArray, e_dot: FloatArray, dt: float) -> None:
        """Filter ë + K_d ė + K_p e of the joints with a signal."""
        K_p, K_d = self._controller.feedback_gains
        last, self._last_e_dot = self._last_e_dot, e_dot
        d, weight = K_d * e_dot + K_p * e, 1.0  # the first one, as if it had been steady
        if last is not None:
            d = d + (e_dot - last) / max(dt, 1e-9)
            weight = 1.0 - math.exp(-dt / DISTURBANCE_TIME)
        self._disturbance = self._disturbance + weight * (
            np.where(self.marks, 0.0, d) - self._disturbance)

    def _follow(self, dt: float, command: FloatArray | None) -> None:
        """
        Let the error follow the closed loop, ë = −K_d ė − K_p e − a, for dt [s].

        The limited `command` (n,) differs from the asked effort by Δτ: a_m = M_mm⁻¹ Δτ_m.
        """
        K_p, K_d = self._controller.feedback_gains
        m, a = self.marks, np.zeros_like(self._e)
        if self._asked is not None and command is not None:
            asked, M = self._asked
            a[m] = np.linalg.lstsq(M[np.ix_(m, m)], (command - asked)[m])[0]
        count = max(1, math.ceil(dt / STEP))
        h = dt / count
        for _ in range(count):
            self._e = self._e + 0.5 * h * self._e_dot
            self._e_dot = self._e_dot - h * (K_d * self._e_dot + K_p * self._e + a)
            self._e = self._e + 0.5 * h * self._e_dot
