# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/external_wrench` with its covariance, and `~/zero_external_wrench`."""

from collections.abc import Callable

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware.conversions import floats_to_ros, stamp_to_ros
from robot_dynamics.ros.middleware.rclpy_internals import subscription_count
from robot_dynamics_interfaces.msg import WrenchCovariance
from robot_dynamics_tools.monitoring.external_wrench import ExternalWrenchEstimator
from std_msgs.msg import Header
from std_srvs.srv import Trigger

NEWEST_ONLY = QoSProfile(depth=1)
UNKNOWN = -1.0
"""First element of a covariance that is not known."""


class LiveWrench:
    """Publishes the wrench; the thread of the states calls `publish`, the executor the service."""

    def __init__(self, node: Node, is_wanted: Callable[[], bool]) -> None:
        """`is_wanted` returns whether the node itself needs the wrench."""
        self._node, self._is_wanted = node, is_wanted
        self._wrench = node.create_publisher(WrenchStamped, '~/external_wrench', NEWEST_ONLY)
        self._covariance = node.create_publisher(
            WrenchCovariance, '~/external_wrench_covariance', NEWEST_ONLY)
        self.counts = [subscription_count(one) for one in (self._wrench, self._covariance)]
        """Functions that return the number of subscribers of each topic."""
        self.estimator: ExternalWrenchEstimator | None = None
        """The estimator in use, None without a model."""
        self.newest: FloatArray | None = None
        """Wrench of the newest state (6,), None if it is not estimated."""
        node.create_service(Trigger, '~/zero_external_wrench', self._zero)

    @property
    def has_subscribers(self) -> bool:
        """Whether one of the topics has a subscriber."""
        return any(count() > 0 for count in self.counts)

    def publish(self, stamp_ns: int, dt: float) -> None:
        """Publish the wrench dt [s] after the previous state; nothing if nothing needs it."""
        estimator, self.newest = self.estimator, None
        if estimator is None:
            return
        if not self.has_subscribers and not self._is_wanted():
            estimator.restart()
            return
        estimate = estimator.update(dt)
        if estimate is not None:
            self.newest = estimate.wrench
            header = Header(stamp=stamp_to_ros(stamp_ns), frame_id=estimator.frame)
            message = WrenchStamped(header=header)
            force, torque = message.wrench.force, message.wrench.torque
            force.x, force.y, force.z, torque.x, torque.y, torque.z = estimate.wrench.tolist()
            self._wrench.publish(message)
            if self.counts[1]():
                C = estimate.covariance
                self._covariance.publish(WrenchCovariance(
                    header=header, unobservable=floats_to_ros(estimate.unobservable),
                    covariance=[UNKNOWN, *[0.0] * 35] if C is None else C.ravel()))

    def _zero(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.estimator is None:
            raise InvalidInputError(
                'no model yet, expected a running node dynamics (parameter dynamics)')
        self.estimator.zero()
        response.success, response.message = True, (
            'the mean external effort of the last 0.2 s is subtracted from now on')
        self._node.get_logger().info(f'~/zero_external_wrench: {response.message}')
        return response
