# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Backlash compared with theory: dead zone, describing function, limit cycle."""

from backlash_theory import (
    after,
    AMPLITUDE,
    CYCLE_DRAG,
    feed_back,
    HALF_GAP,
    LOAD,
    measured_cycle,
    MOTOR,
    play_operator,
    predicted_cycle,
    swing,
    Way,
)
import numpy as np
import pytest


@pytest.fixture(scope='module')
def way() -> Way:
    return swing(4.0)


def test_the_load_follows_the_play_operator(way):
    settled = after(way, 2.0)
    theory = play_operator(settled.theta, settled.q[0])
    assert settled.q == pytest.approx(theory, abs=1e-9)
    # It stands still while the motor crosses the gap.
    crossing = np.abs(settled.theta - settled.q) < HALF_GAP - 1e-9
    inside = crossing[1:] & crossing[:-1]
    assert inside.sum() > 0.2 * len(inside)
    assert (np.diff(settled.q)[inside] == 0.0).all()
    # The motor crosses the gap after each reversal in acos(1 − 2b/A)/ω.
    fraction = 2.0 * np.arccos(1.0 - 2.0 * HALF_GAP / AMPLITUDE) / (2.0 * np.pi)
    assert inside.mean() == pytest.approx(fraction, rel=0.01)


# --- the limit cycle -----------------------------------------------------------------------------

def test_feedback_through_the_gap_cycles_as_harmonic_balance_predicts():
    predicted = predicted_cycle()
    # As the describing function assumes: friction acts on the load, and hardly on the motor.
    effort = MOTOR * predicted.amplitude * predicted.frequency**2
    assert 2.0 * LOAD / MOTOR * effort < CYCLE_DRAG
    assert effort > 100.0 * CYCLE_DRAG
    way = feed_back(12.0, start=predicted.amplitude)
    cycle, later = measured_cycle(after(way, 6.0)), measured_cycle(after(way, 9.0))
    amplitude = later.amplitude / predicted.amplitude - 1.0
    frequency = later.frequency / predicted.frequency - 1.0
    print(f'{predicted} predicted, {later} measured: {amplitude:+.2%}, {frequency:+.2%}')
    assert later == pytest.approx(cycle, rel=1e-3)  # the amplitude neither grows nor decays
    assert later.amplitude == pytest.approx(predicted.amplitude, rel=0.05)
    assert later.frequency == pytest.approx(predicted.frequency, rel=0.03)


def test_without_the_gap_there_is_no_cycle():
    last = after(feed_back(10.0, 0.0), 9.0)
    assert np.ptp(last.theta) < 1e-9
    assert np.ptp(last.q) < 1e-9
