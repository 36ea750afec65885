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
Gain scaling for an arm whose rate of change of effort is limited.

For a large error, PD feedback computes a large effort, and soon after an effort of opposite sign.
If the rate of change of effort is limited, the effort lags behind the error and excites an
oscillation instead of damping it: beyond a certain error the loop diverges. Therefore the
bandwidth of the feedback is scaled down for large errors by the factor s,

    q̈_fb = s² K_p e + s K_d ė,    0 < s <= 1,

which leaves the damping ratio unchanged. The crossover frequency is below s ω_c, with
ω_c = max(K_d + K_p/K_d), so that an effort of size |M q̈_fb| changes by |M q̈_fb| s ω_c per
second: s is the largest factor whose change the rate limit permits. For small errors s = 1. A
steady error that supports a load which is not in the model grows faster than the load.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import Gains

_HALVINGS = 30


def crossover_frequency(gains: Gains) -> float:
    """Return ω_c [rad/s], an upper bound of the crossover frequency of these gains."""
    K_p, K_d = gains.kp, gains.kd
    slow = np.where(K_d > 0.0, gains.ratio, np.sqrt(K_p))
    return float((K_d + slow).max(initial=0.0))


def gain_scale(
    proportional: FloatArray, damping: FloatArray, rate: FloatArray | float,
) -> float:
    """
    Return s in (0, 1] for the efforts M K_p e and M K_d ė, each (n,) [N·m] or [N].

    `rate` [N·m] or [N] is the rate limit of the effort divided by ω_c, (n,) or one for all joints.
    """
    def is_too_fast(s: float) -> bool:
        return bool((s * np.abs(s * s * proportional + s * damping) > rate).any())

    if not is_too_fast(1.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_too_fast(middle) else (middle, high)
    return low
