# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The joint states of a robot of two joints that is held at rest."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import time
from typing import Any

from robot_dynamics.ros.middleware.conversions import stamp_to_ros
from ros_harness import DYNAMICS, MONITOR, NodeProcess, RosClient, running, UNHURRIED
from sensor_msgs.msg import JointState

STEP = 0.01
"""[s] between two states."""


class HeldRobot:
    """A robot at rest that sends states on request; a node answers each of them."""

    def __init__(
        self, client: RosClient, namespace: str, is_paced: bool = False, **fields: Any,
    ) -> None:
        """
        Send joint states with these fields.

        With `is_paced`, states are as far apart as their stamps, for a node that may skip some.
        """
        self._is_paced = is_paced
        self._fields = {'name': ['joint1', 'joint2'], 'velocity': [0.0, 0.0], **fields}
        self._client = client
        self._states = client.publisher(JointState, f'{namespace}/joint_states')
        self._answers = client.collect(JointState, f'{namespace}/dynamics/gravity_compensation')
        self._answers.wait_matched()
        self.stamp = round(1e9)

    def say(self, count: int = 1, step: float = STEP, **fields: Any) -> int:
        """Publish `count` states, each `step` [s] after the previous; return the last stamp."""
        for _ in range(count):
            self.stamp += round(1e9 * step)
            message = JointState(**{**self._fields, **fields})
            message.header.stamp = stamp_to_ros(self.stamp)
            self._client.answer_to(self._states, message, self._answers)
            if self._is_paced:
                time.sleep(step)
        return self.stamp


@contextmanager
def monitored(
    namespace: str, dynamics: Mapping[str, Any], monitor: Mapping[str, Any] | None = None,
) -> Iterator[NodeProcess]:
    """Run `dynamics` and its monitor with these parameters; yield the process of the monitor."""
    process = NodeProcess(MONITOR, monitor, namespace=namespace)
    with running(NodeProcess(DYNAMICS, {**UNHURRIED, **dynamics}, namespace=namespace), process):
        yield process
