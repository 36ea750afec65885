# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Timeout of commands that are received in a loop.

The time without a command is the sum over the steps of that loop. Each step counts with its
duration by a steady clock, but at most with its nominal period. If the loop itself was delayed (by
a busy computer, or because the process was suspended), it could not have received a command, and
the delay does not count.
"""

FEWEST_STEPS = 3
"""Smallest number of steps without a command, because a single command may have been late."""


class CommandTimeout:
    """Measures the time since the last command; there is no timeout before the first command."""

    def __init__(self, timeout: float = 0.0) -> None:
        """Take the `timeout` [s]; 0 disables it."""
        self.timeout = timeout
        self.reset()

    def reset(self) -> None:
        """Wait for a first command, without a timeout."""
        self._waits_for_next = self._received = False
        self.silence, self.silent_steps = 0.0, 0
        """Time [s] and number of steps since the last command."""

    def receive(self) -> None:
        """Register a command in the current step."""
        self._waits_for_next = self._received = True

    def end_step(self, passed: float, period: float) -> bool:
        """
        Return whether the timeout has occurred; True only once per timeout.

        `passed` [s] is the duration of the step, `period` [s] its nominal duration.
        """
        if self._received:
            self._received, self.silence, self.silent_steps = False, 0.0, 0
            return False
        if not self._waits_for_next:
            return False
        self.silence += min(passed, period)
        self.silent_steps += 1
        if self.timeout <= 0.0 or self.silence < self.timeout or self.silent_steps < FEWEST_STEPS:
            return False
        self._waits_for_next = False
        return True
