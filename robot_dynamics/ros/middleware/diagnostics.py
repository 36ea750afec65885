# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The publisher of `dynamics` on /diagnostics: once per second, and after a change."""

from collections.abc import Callable, Iterable, Mapping, Sequence
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


def values_per_joint(values: Iterable[KeyValue], beginning: str) -> dict[str, float]:
    """Return the values per joint whose keys have this beginning."""
    return {
        pair.key.removeprefix(f'{beginning} ').rpartition(' [')[0]: float(pair.value)
        for pair in values if pair.key.startswith(f'{beginning} ')}


class Diagnostics:
    """Publishes the statuses of `look` by a steady clock, which a paused /clock does not stop."""

    def __init__(self, node: Node, look: Callable[[], Sequence[Status]]) -> None:
        """`look` returns all statuses; it is called once per second, and by `look_now`."""
        self._node = node
        self._look = look
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._reported: dict[str, tuple[bytes, object]] = {}
        node.create_timer(PERIOD, self._report)
        self.look_now = node.create_guard_condition(
            partial(self._report, even_unchanged=False)).trigger
        """Check for a change at once; may be called in any thread."""

    def _report(self, even_unchanged: bool = True) -> None:
        statuses = self._look()
        found = {status.name: (status.level, status.event) for status in statuses}
        if not even_unchanged and found == self._reported:
            return
        self._reported = found
        message = DiagnosticArray(status=[self._to_ros(status) for status in statuses])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _to_ros(self, status: Status) -> DiagnosticStatus:
        full_name = self._node.get_fully_qualified_name()
        return DiagnosticStatus(
            name=f'{full_name}: {status.name}',
            hardware_id=full_name.strip('/'),
            level=status.level,
            message=status.message,
            values=[KeyValue(key=key, value=str(value)) for key, value in status.values.items()])
