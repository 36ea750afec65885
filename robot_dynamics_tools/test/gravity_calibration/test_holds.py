# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Static holds in joint states: at rest, from which side, and which belong together."""

from dataclasses import replace

import numpy as np
import pytest
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.gravity_calibration.holds import find_holds, Hold, pair_holds
from robot_dynamics_tools.recordings.joint_series import JointSeries

RATE = 100.0
REVOLUTE = ('revolute',)


def series_of(*parts: np.ndarray, effort: float | None = 3.0) -> JointSeries:
    """Return joint states of one joint with these positions, one part after the other."""
    q = np.concatenate(parts)[:, None]
    return JointSeries(
        ('joint1',), np.round(1e9 / RATE * np.arange(len(q))).astype(np.int64), q, None,
        None if effort is None else np.full_like(q, effort), 0)


def motion(start: float, end: float, seconds: float = 1.0) -> np.ndarray:
    """Return a motion that begins and ends at rest."""
    x = np.linspace(0.0, 1.0, int(seconds * RATE))
    return start + (end - start) * (3.0 * x**2 - 2.0 * x**3)


def rest(at: float, seconds: float = 2.0) -> np.ndarray:
    return np.full(int(seconds * RATE), at)


def sides_of(series: JointSeries) -> list[int]:
    """Return the side from which the joint came to each hold."""
    return [int(hold.approach[0]) for hold in find_holds(series, REVOLUTE)]


def test_holds_have_times_means_and_sides():
    series = series_of(rest(0.0), motion(0.0, 0.5), rest(0.5), motion(0.5, 0.2), rest(0.2))
    holds = find_holds(series, REVOLUTE)
    assert [hold.approach[0] for hold in holds] == [0, 1, -1]
    np.testing.assert_allclose([hold.position[0] for hold in holds], [0.0, 0.5, 0.2], atol=1e-3)
    assert [hold.effort[0] for hold in holds] == [3.0, 3.0, 3.0]
    for hold, start, end in zip(holds, (0.0, 3.0, 6.0), (2.0, 5.0, 8.0)):
        assert abs(hold.start - start) < 0.3
        assert abs(hold.end - end) < 0.3


def test_the_ends_of_a_hold_do_not_count():
    """The effort of the motion before settles, and that of the next motion comes early."""
    series = series_of(motion(0.0, 0.5), rest(0.5), motion(0.5, 0.2))
    hold, = find_holds(series, REVOLUTE)
    series.effort[(series.times < hold.start + 0.3) | (series.times > hold.end - 0.2)] = 50.0
    assert find_holds(series, REVOLUTE)[0].effort[0] == 3.0
    series.effort[abs(series.times - hold.start - 0.45) < 0.1] = 5.0
    assert find_holds(series, REVOLUTE)[0].effort[0] > 3.1


def test_a_short_rest_and_a_creeping_joint_are_no_hold():
    # 1 s of rest, rounded to blocks of 0.2 s, in which the end of the motion is slow
    for seconds, sides in ((1.1, []), (1.2, [1])):
        assert sides_of(series_of(motion(0.0, 0.5), rest(0.5, seconds), motion(0.5, 1.0))) == sides
    for speed, sides in ((0.004, [1]), (0.006, [])):
        creeping = 0.5 + speed / RATE * np.arange(int(3.0 * RATE))
        assert sides_of(series_of(motion(0.0, 0.5), creeping)) == sides


@pytest.mark.parametrize(('overshoot', 'side'), [
    (0.0015, 1), (0.0025, 0), (0.004, 0), (0.006, -1)])
def test_the_last_motion_decides(overshoot, side):
    """A small reversal leaves the side unknown, a large one is the approach."""
    series = series_of(
        rest(0.0), motion(0.0, 0.5 + overshoot), motion(0.5 + overshoot, 0.5, 0.3), rest(0.5))
    assert sides_of(series)[-1] == side


def test_a_joint_that_stayed_has_no_side():
    """Friction of a joint at rest takes a part of the load that changes, which part is unknown."""
    moving = np.concatenate([motion(0.0, 0.5), rest(0.5), motion(0.5, 0.8), rest(0.8)])
    staying = np.concatenate([motion(0.3, 0.1), rest(0.1), rest(0.1, 1.0), rest(0.1)])
    q = np.column_stack([moving, staying])
    series = JointSeries(
        ('joint1', 'joint2'), np.arange(len(q)) * 10_000_000, q, None, np.ones_like(q), 0)
    holds = find_holds(series, ('revolute', 'revolute'))
    assert [hold.approach.tolist() for hold in holds] == [[1, -1], [1, 0]]


def test_noise_and_resolution_of_an_encoder_are_no_motion():
    rng = np.random.default_rng(0)
    series = series_of(motion(0.0, 0.5), rest(0.5), motion(0.5, 0.0), rest(0.0))
    resolution = 2.0 * np.pi / 4096
    noisy = series.position + rng.normal(scale=3e-4, size=series.position.shape)
    coarse = replace(series, position=resolution * np.round(noisy / resolution))
    assert sides_of(coarse) == [1, -1]


def test_a_gap_ends_a_hold():
    series = series_of(motion(0.0, 0.5), rest(0.5), rest(0.5))
    for seconds, sides in ((0.4, [1]), (0.6, [1, 0])):
        stamps = series.stamps_ns.copy()
        stamps[300:] += round(1e9 * seconds)
        assert sides_of(replace(series, stamps_ns=stamps)) == sides


def test_joint_states_without_effort_are_refused():
    with pytest.raises(RecordingError, match='has no effort'):
        find_holds(series_of(rest(0.0), effort=None), REVOLUTE)


def hold_at(q: float, effort: float, side: int) -> Hold:
    return Hold(0.0, 1.0, np.array([q]), np.array([effort]), np.array([side]))


def test_both_sides_have_the_same_weight():
    paired = pair_holds([
        hold_at(0.0, 5.0, 1), hold_at(0.09, 0.0, 1), hold_at(0.03, 1.0, -1),
        hold_at(0.045, 2.0, -1), hold_at(0.03, 99.0, 0)], REVOLUTE)
    assert paired.effort.tolist() == [[3.25]]
    assert paired.is_paired.tolist() == [[True]]
    np.testing.assert_allclose(paired.mean(paired.positions), [[0.01875]])
