# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/contacts`: an event when an external effort exceeds its level."""

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import per_joint
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import check_order_is_given
from robot_dynamics.monitoring.contact_levels import ContactDetector, ContactLevels
from robot_dynamics.ros.middleware.conversions import stamp_to_ros
from robot_dynamics.ros.middleware.rclpy_internals import subscription_count
from robot_dynamics.ros.parameters.declared_parameters import flag, numbers_per_joint, Values
from robot_dynamics_interfaces.msg import Contact

EVENTS = QoSProfile(depth=10)

CONTACT_SPECS = (
    numbers_per_joint('contact.effort', 0.0, 1e9, (
        'External effort [N·m] or [N] at rest above which ~/contacts is published'), (
        ', 0 for a joint without a level. If empty, contacts are not detected. ros2 dynamics '
        'learn_contact_levels writes it.')),
    numbers_per_joint('contact.effort_per_velocity', 0.0, 1e9, (
        'Increase of contact.effort with the speed [N·m·s/rad] or [N·s/m]'), (
        '. If empty, 0.')),
    flag('contact.is_fault', False, (
        'Whether a contact is the fault external_effort, in addition to external_effort_limit.')),
)


def contact_levels(values: Values, arm: ArmModel) -> ContactLevels | None:
    """Return the levels of the parameters, None without levels; raise InvalidInputError."""
    names = 'contact.effort', 'contact.effort_per_velocity'
    for name in names:
        check_order_is_given(values, name, arm)
    if not any(values[names[0]]):
        if values['contact.is_fault']:
            raise InvalidInputError(
                'contact.is_fault is true without levels, expected contact.effort (ros2 dynamics '
                'learn_contact_levels)')
        return None
    return ContactLevels(*(
        per_joint(name, values[name] or [0.0], arm.joint_names) for name in names))


class LiveContacts:
    """Publishes the beginnings of contacts; for the control thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(Contact, '~/contacts', EVENTS)
        self.count = subscription_count(self._publisher)
        """Function that returns the number of subscribers."""
        self._detector: ContactDetector | None = None
        self.is_fault = False
        """Whether a contact is a fault."""

    def set_levels(self, values: Values, arm: ArmModel) -> None:
        """Use the levels of the parameters from the next state on."""
        levels = contact_levels(values, arm)
        self._detector = None if levels is None else ContactDetector(levels, arm.joint_names)
        self.is_fault = bool(values['contact.is_fault'])

    @property
    def is_on(self) -> bool:
        """Whether contacts are detected: there are levels, and a subscriber or the fault."""
        return self._detector is not None and (self.is_fault or self.count() > 0)

    def fault_levels(self, v: FloatArray) -> FloatArray | None:
        """Return the levels (n,) at a velocity above which a fault occurs, None for none."""
        detector = self._detector
        return detector.levels.at(v) if detector is not None and self.is_fault else None

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
