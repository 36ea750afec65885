# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Prediction of joints whose driver no longer updates their position and velocity."""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.followed_reference import FASTEST_STOP

LONGEST_STEP = 0.05
"""[s] between two states for which the motion of a frozen joint is predicted."""
_MOST_STEPS = 100


class FrozenJoints:
    """
    The motion of joints without a signal, predicted by the equation of motion.

    Until the fault is found, the feedback acts on the error of the frozen sample; afterwards the
    commanded effort accelerates the arm.
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
        self.torque: FloatArray | None = None
        """The torque (n,) that accelerates the arm since the last state, None at the first one."""
        v = v if v is not None else np.zeros_like(q)
        self._q, self._v = q, v
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
        q_r, v_r, _ = trajectory.sample(stamp_ns)
        self._q, self._v = q_r - e, v_r - e_dot

    def predict(
        self, dt: float, q: FloatArray, v: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray | None]:
        """Return q and v (n,) with the predicted values of these joints, dt [s] later."""
        reference, marks = self._controller.reference, self.marks
        if self.torque is not None:
            h = min(max(dt, 0.0), LONGEST_STEP)
            a = self._controller.rigid_body.acceleration(self._q, self._v, self.torque)
            fastest = FASTEST_STOP * self._controller.arm.limits.velocity
            before, self._v = self._v, np.clip(self._v + h * a, -fastest, fastest)
            self._q = self._q + 0.5 * h * (before + self._v)
        used = v if v is not None or reference is None else reference.velocity
        self._q = np.where(marks, self._q, q)
        self._v = np.where(marks, self._v, 0.0 if used is None else used)
        return self._q, None if v is None else self._v
