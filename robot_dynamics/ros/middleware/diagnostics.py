# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The publisher of `dynamics` on /diagnostics: once per second, and after a change."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
PERIOD = 1.0
"""[s] between two messages without a change."""


STIFFNESS, FRICTION_ERROR = 'stiffness of', 'error that known dry friction can hold at'
DRIVE_STIFFNESS = 'assumed stiffness of the drive of'
"""Beginnings of the keys of values per joint; name and unit of the joint follow."""


class Status(NamedTuple):
    """
    One status: name, level, message in one line, and values by key.

    A changed level or `event` is published at once.
    """

    name: str
    level: bytes
    message: str
    values: Mapping[str, object]
    event: object = None


def joint_key(beginning: str, joint: str, unit: str) -> str:
    """Return the key of a value of a joint."""
    return f'{beginning} {joint} [{unit}]'


def publish_diagnostics(
    node: Node, look: Callable[[], Sequence[Status]],
) -> Callable[[], None]:
    """
    Publish the statuses of `look` once per second, and those that have changed on a call.

    Returns the function to call after a change, in any thread.
    """
    publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    reported: dict[str, tuple[bytes, object]] = {}

    def report(even_unchanged: bool = True) -> None:
        nonlocal reported
        statuses = look()
        found = {status.name: (status.level, status.event) for status in statuses}
        if not even_unchanged and found == reported:
            return
        reported = found
        message = DiagnosticArray(status=[
            _to_ros(node.get_fully_qualified_name(), status) for status in statuses])
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    node.create_timer(PERIOD, report)
    report_changes: Callable[[], None] = node.create_guard_condition(
        partial(report, even_unchanged=False)).trigger
    return report_changes


def _to_ros(full_name: str, status: Status) -> DiagnosticStatus:
    return DiagnosticStatus(
        name=f'{full_name}: {status.name}', hardware_id=full_name.strip('/'),
        level=status.level, message=status.message,
        values=[KeyValue(key=key, value=str(value)) for key, value in status.values.items()])
