# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The payloads of `dynamics`: kept after `cleanup` and for new models; published if active."""

from collections.abc import Callable, Sequence

from geometry_msgs.msg import InertiaStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_dynamics.control.controller import Controller
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import (
    describe_change,
    describe_payloads,
    Payload,
    with_payload_on,
)
from robot_dynamics.ros.middleware.conversions import payload_to_ros
from robot_dynamics.ros.middleware.diagnostics import ERROR, OK, Status
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics.ros.parameters.payloads import (
    changed_payloads,
    check_all,
    payload_warnings,
    payloads_at_start,
)

ALL_PAYLOADS = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Number of messages for late subscribers: the largest number of loaded links."""


class PayloadKeeper:
    """
    The payloads of the parameters and those that ~/set_payload has set.

    They persist if the model changes. A new model that cannot carry them is rejected until they
    are removed.
    """

    def __init__(self, node: Node, values: Callable[[], Values]) -> None:
        """
        Publish on ~/payload: one message per payload, all with one stamp; m = 0 without a payload.

        `values` returns the parameters of the node.
        """
        self._node, self._values = node, values
        self.payloads = payloads_at_start(values())
        """All payloads that were set, at most one per link."""
        self._start = describe_payloads(self.payloads)
        self.obstacle = ''
        """Reason why the newest model cannot carry the payloads, empty if it can."""
        self._publisher = node.create_publisher(InertiaStamped, '~/payload', ALL_PAYLOADS)

    def check(self, arm: ArmModel) -> None:
        """Raise InvalidInputError if an arm cannot carry the kept payloads."""
        try:
            check_all(arm, self.payloads, self._values())
        except RobotDynamicsError as error:
            self.obstacle = (
                f'the payloads that were set ({describe_payloads(self.payloads)}) are invalid '
                f'for the model {arm.name!r}: {describe_error(error)}; expected a call of '
                '~/set_payload that removes them (m = 0)')
            raise InvalidInputError(self.obstacle) from None

    def suit(self, arm: ArmModel) -> bool:
        """Return whether an arm can carry the kept payloads."""
        try:
            self.check(arm)
        except InvalidInputError:
            return False
        return True

    def publish(self) -> None:
        """Publish the kept payloads, which an arm carries from now on."""
        self.obstacle = ''
        self._in_force(self.payloads)

    def change(
        self, controller: Controller, message: InertiaStamped, transition_time: float,
    ) -> str:
        """Set or remove the payload of a link; return a report; raise InvalidInputError."""
        state = controller.state
        payloads = changed_payloads(
            controller.load.planning.arm.with_payloads(()), self.payloads, message,
            self._values(), state[1] if state is not None else None)
        controller.set_payloads(payloads, transition_time, self._in_force)
        report = describe_change(self.payloads, payloads)
        self.payloads, self.obstacle = payloads, ''
        return f'{report}; a restart begins with {self._start}'

    def remove(self, link: str) -> str:
        """Do the same without a model: remove the payload of a link, or all if it is empty."""
        self.payloads, self.obstacle = with_payload_on(self.payloads, link, None), ''
        self._in_force(self.payloads)
        return describe_payloads(self.payloads)

    def warnings(self, arm: ArmModel) -> list[str]:
        """Return why the payloads are implausible on an arm, if that is permitted."""
        return payload_warnings(arm, self.payloads, self._values())

    def status(self) -> Status:
        """Return the status for the diagnostics."""
        payloads = self.payloads
        return Status(
            'payload', ERROR if self.obstacle else OK,
            self.obstacle or describe_payloads(payloads),
            {'payloads': len(payloads), 'mass': sum(one.mass for one in payloads),
             'a restart begins with': self._start})

    def _in_force(self, payloads: Sequence[Payload]) -> None:
        stamp = self._node.get_clock().now().to_msg()
        for payload in payloads or (None,):
            message = payload_to_ros(payload)
            message.header.stamp = stamp
            self._publisher.publish(message)
