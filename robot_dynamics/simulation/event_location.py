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
When a motion of which both ends are known crosses zero: polynomials of Hermite, by their roots.

Coefficients c_k are those of Σ c_k s^k with s = t/h in [0, 1].
"""

from collections.abc import Sequence

_ITERATIONS = 40
_ACCURACY = 1e-9


def cubic(h: float, start: Sequence[float], end: Sequence[float]) -> tuple[float, ...]:
    """Return the cubic with these values and rates at both ends of h."""
    c0, c1 = start[0], h * start[1]
    P, V = end[0] - c0 - c1, h * end[1] - c1
    return c0, c1, 3.0 * P - V, V - 2.0 * P


def quintic(h: float, start: Sequence[float], end: Sequence[float]) -> tuple[float, ...]:
    """Return the quintic with these values, rates and second derivatives at both ends of h."""
    c0, c1, c2 = start[0], h * start[1], 0.5 * h * h * start[2]
    P, V, A = end[0] - c0 - c1 - c2, h * end[1] - c1 - 2.0 * c2, h * h * end[2] - 2.0 * c2
    return (c0, c1, c2, 10.0 * P - 4.0 * V + 0.5 * A, 7.0 * V - 15.0 * P - A,
            6.0 * P - 3.0 * V + 0.5 * A)


def first_crossing(coefficients: Sequence[float], h: float) -> float:
    """Return t in (0, h) where a polynomial is 0: positive at first, negative at last."""
    low, high, s = 0.0, 1.0, 1.0
    for _ in range(_ITERATIONS):
        value = slope = 0.0
        for c in reversed(coefficients):
            slope = slope * s + value
            value = value * s + c
        low, high = (s, high) if value > 0.0 else (low, s)
        newton = s - value / slope if slope else low
        step = newton if low < newton < high else 0.5 * (low + high)
        if abs(step - s) <= _ACCURACY * high:
            break
        s = step
    return s * h
