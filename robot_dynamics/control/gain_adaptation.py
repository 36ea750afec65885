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

"""Gains that follow the quality of the joint states while the arm runs, by `stable_gains`."""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import Gains
from robot_dynamics.control.stable_gains import longest_period, StateQuality, UNKNOWN

_STEP = 1.1
"""Ratio of two periods, or of two scales, below which the scale stays unchanged."""


class GainAdaptation:
    """The scale of the gains that rate and noise of the states allow, and the velocity to use."""

    def __init__(self, joint_kinds: tuple[str, ...]) -> None:
        self.quality = StateQuality(joint_kinds)
        self.scale = 1.0
        """Factor of the bandwidth of the feedback, in (0, 1]."""
        self._gains: Gains | None = None
        self._mass = self._effort_rate = np.empty(0)
        self._free_period = math.inf
        self._rated_period = 0.0

    def use(self, gains: Gains | None, mass: FloatArray, effort_rate: FloatArray) -> None:
        """
        Adapt these gains from now on, None for no adaptation; sets `scale`.

        `mass` (n, n) is the largest |M|, `effort_rate` (n,) [N·m/s] or [N/s] the rate limit.
        """
        self._gains, self._mass, self._effort_rate = gains, mass, effort_rate
        self._free_period = math.inf if gains is None else longest_period(gains)
        self._set_scale(is_forced=True)

    @property
    def reference_scale(self) -> float:
        """Factor by which references are slowed down, in (0, 1]."""
        return self.scale if self.quality.is_known else min(1.0, self.scale / UNKNOWN)

    def take(
        self, dt: float, q: FloatArray, v: FloatArray, velocity_delay: float = 0.0,
    ) -> tuple[FloatArray, bool]:
        """
        Take a state dt [s] after the last one, 0 if that is unknown; arrays are (n,).

        `velocity_delay` [s] is that of v if it is estimated. Returns the velocity to use, and
        whether `scale` or `reference_scale` has changed.
        """
        if self._gains is None:
            return v, False
        quality = self.quality
        quality.velocity_delay = velocity_delay
        v = quality.velocity(dt, q, v)
        period = quality.period
        if not (quality.is_due or (
                period > self._free_period and period > _STEP * self._rated_period)):
            return v, False
        self._rated_period = period
        return v, self._set_scale()

    def _set_scale(self, is_forced: bool = False) -> bool:
        was_known = self.quality.is_known
        scale = 1.0 if self._gains is None else self.quality.stable_scale(
            self._gains, self._mass, self._effort_rate)
        is_forced = is_forced or self.quality.is_known != was_known  # as for `reference_scale`
        if not is_forced and (scale == self.scale or scale < 1.0 and self.scale < 1.0 and (
                1.0 / _STEP < scale / self.scale < _STEP)):
            return False
        self.scale = scale
        return True
