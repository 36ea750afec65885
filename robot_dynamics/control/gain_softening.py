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
Gains that an arm can follow whose effort may change only so fast.

A large error asks PD feedback for a large effort, and soon after for its reverse. Where the rate
of change of effort is limited, that comes late, and an effort that lags behind its error feeds an
oscillation instead of damping it: beyond a certain error the loop diverges. So the feedback is
slowed down for large errors to the share s of its bandwidth,

    q̈_fb = s² K_p e + s K_d ė,    0 < s <= 1,

which leaves the damping ratio as it is. It crosses over below s ω_c, ω_c = max(K_d + K_p/K_d), so
that an effort of size |M q̈_fb| changes by |M q̈_fb| s ω_c a second: s is the largest share at which
the rate limit lets that through. Small errors are fed back with s = 1; and a steady error that
holds a load which the model does not know grows faster than the load.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import Gains

_HALVINGS = 30


def crossover_frequency(gains: Gains) -> float:
    """Return ω_c [rad/s], a bound of where the feedback of these gains crosses over."""
    K_p, K_d = gains.kp, gains.kd
    slow = np.where(K_d > 0.0, gains.ratio, np.sqrt(K_p))
    return float((K_d + slow).max(initial=0.0))


def gain_scale(
    proportional: FloatArray, damping: FloatArray, rate: FloatArray | float,
) -> float:
    """
    Return s in (0, 1] for the efforts M K_p e and M K_d ė, each (n,) [N·m] or [N].

    `rate` is the largest change of effort by ω_c [N·m] or [N], (n,) or one for all joints.
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
