# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What follows from the external effort: `~/external_wrench` and `~/contacts`."""

from collections.abc import Callable

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.external_effort_fault import contact_levels
from robot_dynamics.ros.middleware.conversions import floats_to_ros, stamp_to_ros
from robot_dynamics.ros.middleware.rclpy_internals import subscription_count
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics_interfaces.msg import Contact, WrenchCovariance
from robot_dynamics_tools.monitoring.contact_detector import ContactDetector
from robot_dynamics_tools.monitoring.external_wrench import ExternalWrenchEstimator
from std_msgs.msg import Header
from std_srvs.srv import Trigger

UNKNOWN = -1.0
"""First element of a covariance that is not known."""


class Output:
    """A topic: `publish`, and `count`, which returns the number of its subscribers."""

    def __init__(self, node: Node, message_type: type, topic: str, depth: int = 1) -> None:
        publisher = node.create_publisher(message_type, topic, QoSProfile(depth=depth))
        self.publish, self.count = publisher.publish, subscription_count(publisher)


class LiveWrench:
    """Publishes the wrench; the thread of the states calls `publish`, the executor the service."""

    def __init__(self, node: Node, is_wanted: Callable[[], bool]) -> None:
        """`is_wanted` returns whether the node itself needs the wrench."""
        self._node, self._is_wanted = node, is_wanted
        self._wrench = Output(node, WrenchStamped, '~/external_wrench')
        self._covariance = Output(node, WrenchCovariance, '~/external_wrench_covariance')
        self.estimator: ExternalWrenchEstimator | None = None
        """The estimator in use, None without a model."""
        self.newest: FloatArray | None = None
        """Wrench of the newest state (6,), None if it is not estimated."""
        node.create_service(Trigger, '~/zero_external_wrench', self._zero)

    @property
    def has_subscribers(self) -> bool:
        """Whether one of the topics has a subscriber."""
        return self._wrench.count() > 0 or self._covariance.count() > 0

    def publish(self, estimator: ExternalWrenchEstimator, stamp_ns: int, dt: float) -> None:
        """Publish the wrench dt [s] after the previous state; nothing if nothing needs it."""
        self.newest = None
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
            if self._covariance.count():
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


class LiveContacts:
    """Publishes the beginnings of contacts; for the thread of the states."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._output = Output(node, Contact, '~/contacts', depth=10)
        self._detector: ContactDetector | None = None

    def set_levels(self, values: Values, arm: ArmModel) -> None:
        """Use the levels of the parameters of `dynamics` from the next state on."""
        levels = contact_levels(values, arm)
        self._detector = None if levels is None else ContactDetector(levels, arm.joint_names)

    @property
    def is_on(self) -> bool:
        """Whether contacts are detected: there are levels and a subscriber."""
        return self._detector is not None and self._output.count() > 0

    def update(self, stamp_ns: int, dt: float, v: FloatArray, effort: FloatArray) -> None:
        """Publish a contact that begins at a state dt [s] after the previous one."""
        detector = self._detector
        contact = None if detector is None else detector.update(dt, v, effort)
        if contact is not None:
            message = Contact(
                joint_name=contact.joint, effort=contact.effort, level=contact.level,
                message=str(contact))
            message.header.stamp = stamp_to_ros(stamp_ns)
            self._output.publish(message)
            self._node.get_logger().info(f'~/contacts: {contact}')
