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

"""When the scale of the gains changes, and when it stays: state by state, without an arm."""

import math

import numpy as np
import pytest
from robot_dynamics.control.control_law import make_gains
from robot_dynamics.control.gain_adaptation import GainAdaptation
from robot_dynamics.control.stable_gains import CROSSOVER, DELAY_LAG, LOOP_DELAY

KINDS = ('revolute', 'revolute')
OMEGA = 20.0
GAINS = make_gains(KINDS, [OMEGA])
MASS, NO_LIMIT = np.diag([2.0, 0.5]), np.full(2, math.inf)
Q, V = np.array([0.3, -0.2]), np.array([0.1, 0.4])
FAST, SLOW = 0.002, 0.05


def scale_at(period: float, omega: float = OMEGA) -> float:
    """Return the scale for states without noise."""
    return min(1.0, DELAY_LAG / (CROSSOVER * omega * (0.5 * period + LOOP_DELAY)))


def after(period: float, count: int = 100) -> GainAdaptation:
    """Return an adaptation that has taken `count` states at rest with this period [s]."""
    one = GainAdaptation(KINDS)
    one.use(GAINS, MASS, NO_LIMIT)
    for k in range(count):
        one.take(period if k else 0.0, Q, np.zeros(2))
    return one


def changes(one: GainAdaptation, period: float, count: int) -> list[int]:
    """Take more states at rest; return which of them changed a scale."""
    changed = []
    for k in range(count):
        before = one.scale, one.reference_scale
        has_changed = one.take(period, Q, np.zeros(2))[1]
        assert has_changed == ((one.scale, one.reference_scale) != before)
        if has_changed:
            changed.append(k)
    return changed


@pytest.mark.parametrize('is_used', [False, True])
def test_without_gains_to_adapt_the_scale_is_1_and_no_state_changes_it(is_used: bool) -> None:
    one = GainAdaptation(KINDS)
    if is_used:
        one.use(None, MASS, NO_LIMIT)
    for k in range(20):
        v, has_changed = one.take(SLOW if k else 0.0, Q, V)
        assert v is V
        assert not has_changed
    assert one.scale == 1.0


@pytest.mark.parametrize('period', [FAST, 0.02, SLOW])
def test_the_scale_is_that_of_the_period(period: float) -> None:
    """The velocities count as measured: without the delay of an estimate."""
    one = after(period)
    assert one.scale == pytest.approx(scale_at(period))
    assert 'measured velocities' in str(one.quality)
    assert changes(one, period, 100) == []


def test_states_that_come_slower_lower_the_gains_at_once() -> None:
    one = after(FAST)
    assert one.scale == 1.0
    for period in (0.02, SLOW):  # twice: compared with the period of the last evaluation
        assert changes(one, period, 1) == [0]
        assert not one.quality.is_due
        assert one.scale == pytest.approx(scale_at(period))


def test_a_period_that_changes_the_scale_by_less_than_a_tenth_leaves_it() -> None:
    one = after(SLOW)
    scale = one.scale
    assert 1.0 < scale / scale_at(1.1 * SLOW) < 1.1
    assert changes(one, 1.1 * SLOW, 200) == []  # some of them are evaluated
    assert one.scale == scale
    assert scale / scale_at(1.2 * SLOW) > 1.1
    assert changes(one, 1.2 * SLOW, 200) != []
    assert one.scale == pytest.approx(scale_at(1.2 * SLOW))


def test_states_that_come_faster_raise_the_gains_when_the_next_evaluation_is_due() -> None:
    one = after(SLOW)
    raised = 0
    for _ in range(500):
        if one.take(FAST, Q, np.zeros(2))[1]:
            assert one.quality.is_due
            raised += 1
    assert raised > 1
    assert one.scale == 1.0


@pytest.mark.parametrize('scale', [0.92, 0.97])
def test_full_gains_begin_and_end_with_any_change(scale: float) -> None:
    period = 2.0 * (DELAY_LAG / (CROSSOVER * OMEGA * scale) - LOOP_DELAY)
    one = after(FAST)
    assert changes(one, period, 1) == [0]
    assert one.scale == pytest.approx(scale)
    changes(one, FAST, 500)
    assert one.scale == 1.0


def test_other_gains_are_scaled_at_once_for_any_change() -> None:
    one = after(SLOW)
    omega = 1.02 * OMEGA
    one.use(make_gains(KINDS, [omega]), MASS, NO_LIMIT)
    assert one.scale == pytest.approx(scale_at(SLOW, omega))


def noisy(effort_rate: float) -> tuple[GainAdaptation, float, float]:
    """Take states until their noise is known; return the last scales that were reported."""
    one, rng = GainAdaptation(KINDS), np.random.default_rng(1)
    one.use(GAINS, MASS, np.full(2, effort_rate))
    scale, reference_scale = one.scale, one.reference_scale
    for k in range(16):
        q, v = Q + rng.normal(0.0, 0.002, 2), rng.normal(0.0, 0.5, 2)
        if one.take(FAST if k else 0.0, q, v)[1]:
            scale, reference_scale = one.scale, one.reference_scale
    assert not one.quality.is_known
    if one.take(FAST, Q, np.zeros(2))[1]:
        scale, reference_scale = one.scale, one.reference_scale
    assert one.quality.is_known
    return one, scale, reference_scale


def test_references_are_slowed_down_if_noise_allows_no_more_than_the_first_scale() -> None:
    """Until the noise is known, gains have half of the bandwidth, and references full speed."""
    one, scale, _ = noisy(100.0)
    assert one.reference_scale == one.scale == scale < 0.5
    one, scale, reference_scale = noisy(100.0 * (0.52 / scale) ** 2)
    assert one.scale == scale == pytest.approx(0.52)
    assert one.reference_scale == reference_scale == scale
