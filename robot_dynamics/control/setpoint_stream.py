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
Whether set-points stream, and when the stream has ended.

One set-point is a pose to go to and hold. Several in a row, each within the timeout of the one
before, are a stream, whose sender steers: when it falls silent, holding its last would be wrong.
"""

import math

STREAM_LENGTH = 5
"""Set-points in a row that make a stream; fewer may be a change of mind."""


class SetPointStream:
    """Hears of each reference; times [s] of a steady clock."""

    def __init__(self, timeout: float = 0.1) -> None:
        self.timeout = timeout
        self._last = -math.inf
        self._in_a_row = 0

    def arrived(self, is_set_point: bool, now: float) -> None:
        """Take note of a reference: a set-point, or a trajectory, which ends any stream."""
        follows = is_set_point and now - self._last <= self.timeout
        self._in_a_row = self._in_a_row + 1 if follows else 1
        self._last = now if is_set_point else -math.inf

    def end(self) -> None:
        """Forget the stream."""
        self._in_a_row, self._last = 0, -math.inf

    def is_over(self, now: float) -> bool:
        """Tell whether there was a stream and its sender has fallen silent."""
        return self._in_a_row >= STREAM_LENGTH and now - self._last > self.timeout
