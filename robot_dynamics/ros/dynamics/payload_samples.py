# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Measured states on their way from the control path to the payload estimation, without a lock."""

from collections import deque
from typing import NamedTuple

from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.monitoring.state_plausibility import StateVerdict
from robot_dynamics.ros.cdr_templates import SensedState
from robot_dynamics.ros.joint_state_reader import JointStateReader

MOST_SAMPLES = 5000
"""Number of waiting states; if more arrive, the oldest are discarded."""


class Sample(NamedTuple):
    """A measured state: `stamp` [ns], others (n,); `robot_gravity` is g(q) without a load."""

    stamp: int
    q: FloatArray
    v: FloatArray
    effort: FloatArray
    robot_gravity: FloatArray
    is_restart: bool


class PayloadSamples:
    """
    A buffer of states while an estimation is active.

    The thread of the control path calls `take`, another thread the other methods. A deque is safe
    for one thread at each end.
    """

    def __init__(self) -> None:
        self.is_on = False
        self.obstacle = ''
        """Reason why the newest state cannot be used, empty if it can."""
        self._waiting: deque[Sample] = deque(maxlen=MOST_SAMPLES)

    def begin(self) -> None:
        """Take states from now on."""
        self._waiting.clear()
        self.obstacle, self.is_on = 'no joint state since the start', True

    def end(self) -> None:
        """Take no more states."""
        self.is_on = False
        self._waiting.clear()

    def take(
        self, reader: JointStateReader, state: SensedState, q: FloatArray, v: FloatArray | None,
        verdict: StateVerdict, robot_gravity: FloatArray,
    ) -> None:
        """Keep a state whose command is published, if an estimation is active; do not raise."""
        if not (self.is_on and verdict.is_new):
            return
        try:
            effort = reader.effort(state)
        except RobotDynamicsError as error:
            self.obstacle = str(error)
            return
        if effort is None or not all_finite(effort):
            self.obstacle = 'joint states have no effort'
        elif v is None:
            self.obstacle = 'joint states have no velocity'
        else:
            self.obstacle = ''
            self._waiting.append(Sample(
                verdict.stamp, q, v, effort, robot_gravity, bool(verdict.restart)))

    def drain(self) -> list[Sample]:
        """Return the waiting states, oldest first, and remove them."""
        samples = []
        while True:
            try:
                samples.append(self._waiting.popleft())
            except IndexError:
                return samples
