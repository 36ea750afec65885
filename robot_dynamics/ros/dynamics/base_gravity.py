# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Gravity of `dynamics` at run time: from the parameter `gravity`, or from an IMU of the base."""

from collections.abc import Callable
import math
import time

import numpy as np
import pinocchio as pin
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.parameters.declared_parameters import numbers, Values
from robot_dynamics.urdf.values import rotation
from sensor_msgs.msg import Imu

TOPIC = 'base_imu'
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
SHORTEST_PERIOD = 0.02
"""[s] between two changes of gravity by the IMU: each recomputes the limits of references."""
SILENCE = 1.0
"""[s] without a valid message of the IMU after which the diagnostics warn."""
FILTER_TIME = 0.1
"""Time constant [s] of the low-pass filter of a measured acceleration."""
PLAUSIBLE = (0.5, 2.0)
"""Range of a measured acceleration, as multiples of the gravity of the parameter."""

GRAVITY_RATE = 20.0
"""Largest rate of change of gravity [m/s³] in commands, that of a base that tilts at 2 rad/s."""
IMU_SPEC = numbers('imu_rpy', -math.tau, math.tau, (
    'Take gravity from the topic base_imu (sensor_msgs/msg/Imu) of an IMU whose frame has this '
    'roll, pitch and yaw [rad] in the base frame of the arm, as in a URDF: from its orientation, '
    'or from its linear acceleration if it has no orientation. For arms on mobile or tilting '
    'bases. If empty, gravity is the parameter gravity, whose magnitude is used in any case.'),
    read_only=True)


class BaseGravity:
    """Observes the gravity of the base; called in the executor."""

    def __init__(
        self, node: Node, values: Callable[[], Values], use: Callable[[FloatArray], None],
    ) -> None:
        """
        Subscribe to the IMU if the parameters demand it; `values` returns the parameters.

        `use` is called with each new gravity (3,) [m/s²].
        """
        self._node, self._values, self._use = node, values, use
        self.measured: FloatArray | None = None
        """Gravity (3,) [m/s²] of the newest valid message of the IMU."""
        self._received_at, self._changed_at = -math.inf, -math.inf
        self._refused, self._refusal = 0, ''
        self._has_imu = bool(values()['imu_rpy'])
        if self._has_imu:
            self._R = rotation(np.array(values()['imu_rpy']))
            node.create_subscription(Imu, TOPIC, self._on_imu, NEWEST)

    def take(self, values: Values) -> None:
        """Use the changed parameter `gravity`; the IMU takes precedence."""
        if not self._has_imu and values['gravity'] != self._values()['gravity']:
            self._use(np.array(values['gravity']))

    def _on_imu(self, message: Imu) -> None:
        now = time.monotonic()
        try:
            measured = self._R @ gravity_from_imu(
                message, float(np.linalg.norm(self._values()['gravity'])))
        except InvalidInputError as error:
            self._refused, self._refusal = self._refused + 1, str(error)
            self._node.get_logger().warning(
                f'Rejected a message on {TOPIC}: {error}', throttle_duration_sec=LOG_PERIOD)
            return
        dt, self._received_at = now - self._received_at, now
        share = 1.0 if self.measured is None or has_orientation(message) else (
            dt / (dt + FILTER_TIME))
        before = self.measured if self.measured is not None else measured
        self.measured = before + share * (measured - before)
        if now - self._changed_at >= SHORTEST_PERIOD:
            self._changed_at = now
            self._use(self.measured)

    def status(self) -> Status:
        """Return the status for the diagnostics."""
        silence = time.monotonic() - self._received_at
        gravity = self._values()['gravity'] if self.measured is None else self.measured
        level, words = OK, ', '.join(f'{g:.3g}' for g in gravity) + ' m/s²' + (
            f', of {TOPIC}' if self._has_imu else '')
        if self._has_imu and silence > SILENCE:
            level = WARN
            words = (f'no valid message on {TOPIC} yet: the parameter gravity is used'
                     if self.measured is None else
                     f'no valid message on {TOPIC} for {silence:.1f} s: its last gravity is used')
        return Status('gravity', level, words, {
            'gravity': [round(float(g), 3) for g in gravity], 'refused': self._refused,
            'refusal of the latest': self._refusal})


def has_orientation(message: Imu) -> bool:
    """Return whether a message contains an orientation: −1 in its covariance states that not."""
    q = message.orientation
    return bool(message.orientation_covariance[0] != -1.0 and any((q.w, q.x, q.y, q.z)))


def gravity_from_imu(message: Imu, magnitude: float) -> FloatArray:
    """
    Return gravity (3,) [m/s²] in the frame of an IMU.

    The orientation R of the IMU in a frame whose z axis points up gives Rᵀ (0, 0, −g), with the
    `magnitude` g > 0. Without an orientation, gravity is the negative linear acceleration: at rest
    an accelerometer measures −g, and on an accelerating base the arm experiences the same sum.
    Raises InvalidInputError for values that are not finite or not plausible.
    """
    if has_orientation(message):
        q = message.orientation
        turn = pin.Quaternion(q.w, q.x, q.y, q.z)
        norm = turn.norm()
        if not 0.99 < norm < 1.01:
            raise InvalidInputError(f'orientation has the norm {norm:g}, expected 1')
        return np.asarray(-magnitude * turn.normalized().toRotationMatrix()[2])
    f = message.linear_acceleration
    acceleration = np.array([f.x, f.y, f.z])
    norm = float(np.linalg.norm(acceleration))
    low, high = (limit * magnitude for limit in PLAUSIBLE)
    if message.linear_acceleration_covariance[0] == -1.0 or not low <= norm <= high:
        raise InvalidInputError(
            f'linear_acceleration is {acceleration.tolist()}, expected a norm of {low:.3g} to '
            f'{high:.3g} m/s², or an orientation')
    return -acceleration
