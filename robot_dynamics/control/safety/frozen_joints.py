# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction of joints whose driver no longer updates their position and velocity."""

import math

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.control.controller import Controller

LONGEST_PERIOD, STEP = 0.05, 0.002
"""[s] between two states for which the motion of a frozen joint is predicted, and its step."""
STEADY_TIME = 0.05
"""[s] of the mean of the feedback of the other joints."""
_MOST_STEPS = 100


class FrozenJoints:
    """
    The motion of joints without a signal, predicted by their closed loop with the reference.

    Until the fault is found, the feedback acts on the error of the frozen sample; afterwards on
    the predicted error e = q_r − q, which then decays by ë = −K_d ė − K_p e whatever the inertia.
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
        self.since = 0.0
        """Time [s] of the steady clock at which the fault was found."""
        self.moved_until = 0.0
        """Time [s] of the steady clock at which the planned stop had not ended yet."""
        v = v if v is not None else np.zeros_like(q)
        self._q = q
        self._e, self._e_dot, self._steady = np.zeros((3, len(q)))
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

    def predict(
        self, stamp_ns: int, dt: float, q: FloatArray, v: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray | None]:
        """Return q and v (n,) with the predicted values of these joints, dt [s] later."""
        trajectory, velocity = self._controller.trajectory, np.zeros_like(q)
        if trajectory is not None:
            self._follow(min(max(dt, 0.0), LONGEST_PERIOD))
            q_r, v_r, _ = trajectory.sample(stamp_ns)
            self._q, velocity = q_r - self._e, v_r - self._e_dot
        return np.where(self.marks, self._q, q), (
            None if v is None else np.where(self.marks, velocity, v))

    def steady_feedback(self, e: FloatArray, e_dot: FloatArray, dt: float) -> FloatArray:
        """
        Return the steady feedback (n,) of the other joints to their errors, dt [s] later.

        It does not accelerate them, because friction or a load holds them. The coupling torque for
        this acceleration would accelerate the joints without a signal.
        """
        K_p, K_d = self._controller.feedback_gains
        weight = 1.0 - math.exp(-dt / STEADY_TIME)
        self._steady = self._steady + weight * (
            np.where(self.marks, 0.0, K_p * e + K_d * e_dot) - self._steady)
        return self._steady

    def _follow(self, dt: float) -> None:
        """Let the error follow the closed loop, ë = −K_d ė − K_p e, for dt [s]."""
        K_p, K_d = self._controller.feedback_gains
        count = max(1, math.ceil(dt / STEP))
        h = dt / count
        for _ in range(count):
            self._e = self._e + 0.5 * h * self._e_dot
            self._e_dot = self._e_dot - h * (K_d * self._e_dot + K_p * self._e)
            self._e = self._e + 0.5 * h * self._e_dot
