# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/contacts`: an event when an external effort exceeds its level."""

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.external_effort_fault import contact_levels
from robot_dynamics.ros.middleware.conversions import stamp_to_ros
from robot_dynamics.ros.middleware.rclpy_internals import subscription_count
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics_interfaces.msg import Contact
from robot_dynamics_tools.monitoring.contact_detector import ContactDetector

EVENTS = QoSProfile(depth=10)


class LiveContacts:
    """Publishes the beginnings of contacts; for the thread of the states."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(Contact, '~/contacts', EVENTS)
        self.count = subscription_count(self._publisher)
        """Function that returns the number of subscribers."""
        self._detector: ContactDetector | None = None

    def set_levels(self, values: Values, arm: ArmModel) -> None:
        """Use the levels of the parameters of `dynamics` from the next state on."""
        levels = contact_levels(values, arm)
        self._detector = None if levels is None else ContactDetector(levels, arm.joint_names)

    @property
    def is_on(self) -> bool:
        """Whether contacts are detected: there are levels and a subscriber."""
        return self._detector is not None and self.count() > 0

    def update(self, stamp_ns: int, dt: float, v: FloatArray, effort: FloatArray) -> None:
        """Publish a contact that begins at a state dt [s] after the previous one."""
        detector = self._detector
        contact = None if detector is None else detector.update(dt, v, effort)
        if contact is not None:
            message = Contact(
                joint_name=contact.joint, effort=contact.effort, level=contact.level,
                message=str(contact))
            message.header.stamp = stamp_to_ros(stamp_ns)
            self._publisher.publish(message)
            self._node.get_logger().info(f'~/contacts: {contact}')
