# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Whether commands have failed to come for too long, as one who waits for them in a loop can tell.

Silence is counted in the steps of that loop: each with the time that it took by a steady clock,
but at most the period that it should take. A loop that was itself held up (a busy computer, a
process that was suspended) could not have heard anything: that time is nobody's silence.
"""

FEWEST_STEPS = 3
"""Steps without a command that there must be in any case: a single one may have been late."""


class CommandTimeout:
    """Counts the silence after a command; before the first one there is nothing to miss."""

    def __init__(self, timeout: float = 0.0) -> None:
        """`timeout` [s]; with 0 the silence is never too long."""
        self.timeout = timeout
        self.reset()

    def reset(self) -> None:
        """Wait for a first command, however long it takes."""
        self._waits_for_next = self._received = False
        self.silence, self.silent_steps = 0.0, 0
        """[s], and in steps, since the last command."""

    def receive(self) -> None:
        """Take note of a command, in the step that is under way."""
        self._waits_for_next = self._received = True

    def end_step(self, passed: float, period: float) -> bool:
        """
        Return whether the silence is too long, once for each silence.

        `passed` [s] is the time that the step took, `period` [s] the time that it should take.
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
