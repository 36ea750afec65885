# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Motions of one joint with bounded jerk: hull, bounds, arrival, durations; ruckig as oracle."""

from collections.abc import Iterator
import math
import random
from typing import NamedTuple

from jerk_motion import evaluate
from optional_library import library
import pytest
from robot_dynamics.references.jerk_profile import (
    Bounds,
    duration,
    end,
    Extremes,
    extremes,
    Phases,
    smooth_to_rest,
    stop,
    to_rest,
)

NEAR_STOP = (0.0, 1e-13, -1e-13, 1e-12, -1e-11, 1e-9, -1e-9, 1e-6, -1e-6, 1e-4, -1e-4)
"""Distances of goals from the stop position."""
LATER = (1.0 + 1e-9, 1.001, 1.1, 1.5, 3.0)
"""Factors on the shortest duration."""

counts = pytest.mark.parametrize('count', [200, pytest.param(100_000, marks=pytest.mark.soak)])
kinds = pytest.mark.parametrize(('largest', 'symmetric'), [
    pytest.param(0.95, True, id='within'), pytest.param(3.0, True, id='beyond'),
    pytest.param(0.95, False, id='within asymmetric'),
    pytest.param(3.0, False, id='beyond asymmetric')])


class Problem(NamedTuple):
    distance: float
    v: float
    a: float
    bounds: Bounds

    def extremes(self, phases: Phases) -> Extremes:
        return extremes(phases, 0.0, self.v, self.a)

    def reached(self) -> float:
        """Return the velocity after the removal of the acceleration."""
        return self.v + self.a * abs(self.a) / (2.0 * self.bounds.jerk)


def problems(
    count: int, largest: float = 0.95, symmetric: bool = True, near_stop: float = 0.0,
) -> Iterator[Problem]:
    """Yield problems with velocities and accelerations up to `largest` times their bounds."""
    r = random.Random(count)
    for _ in range(count):
        v = 10.0 ** r.uniform(-0.5, 0.7)
        a = v * 10.0 ** r.uniform(0.0, 1.5)
        j = a * 10.0 ** r.uniform(0.0, 1.8)
        lower_v, lower_a = (1.0, 1.0) if symmetric else (r.uniform(0.1, 1.0), r.uniform(0.1, 1.0))
        bounds = Bounds(-lower_v * v, v, -lower_a * a, a, j)
        v, a = (largest * r.uniform(*bounds[k:k + 2]) for k in (0, 2))
        distance = r.choice((-1.0, 1.0)) * 10.0 ** r.uniform(-3.0, 0.3)
        if r.random() < near_stop:
            distance = end(stop(v, a, bounds), 0.0, v, a)[0] + r.choice(NEAR_STOP)
        yield Problem(distance, v, a, bounds)


def check_motion(problem: Problem, phases: Phases, tolerance: float = 1e-9) -> None:
    """Check arrival, hull and bounds; `tolerance` is that of a path of at most 100 rad."""
    distance, v, a, bounds = problem
    stopping, found = problem.extremes(stop(v, a, bounds)), problem.extremes(phases)
    tolerance *= max(1.0, (found.q_max - found.q_min) / 100.0)
    assert end(phases, 0.0, v, a) == pytest.approx((distance, 0.0, 0.0), abs=tolerance)
    assert all(T > 0.0 for T, _ in phases)
    assert found.q_min >= min(stopping.q_min, distance) - tolerance
    assert found.q_max <= max(stopping.q_max, distance) + tolerance
    # A start beyond a bound, or that must pass it, is the only reason to exceed it.
    near = 1.0 + 1e-9
    assert found.v_min >= near * min(bounds.v_min, v, problem.reached())
    assert found.v_max <= near * max(bounds.v_max, v, problem.reached())
    assert found.a_min >= near * min(bounds.a_min, a)
    assert found.a_max <= near * max(bounds.a_max, a)
    assert all(abs(j) <= near * bounds.jerk for _, j in phases)


# --- laws ----------------------------------------------------------------------------------------

@counts
@kinds
def test_motions_arrive_within_hull_and_bounds_also_if_they_arrive_later(
    count, largest, symmetric,
):
    r = random.Random(1)
    for problem in problems(count, largest, symmetric, near_stop=0.3):
        shortest = to_rest(*problem)
        check_motion(problem, shortest)
        earliest = r.choice(LATER) * duration(shortest)
        if earliest < 100.0:  # The rounding error of the position grows with the square.
            phases = to_rest(*problem, earliest)
            assert duration(phases) == pytest.approx(earliest, rel=1e-6)
            check_motion(problem, phases)


@counts
def test_any_finite_problem_has_a_finite_motion(count):
    r = random.Random(2)
    for _ in range(count):
        bounds = Bounds(*(sign * 10.0 ** r.uniform(-3.0, 4.0) for sign in (-1, 1, -1, 1, 1)))
        distance, v, a = (r.choice((-1, 0, 1)) * 10.0 ** r.uniform(-12.0, 6.0) for _ in range(3))
        phases = to_rest(distance, v, a, bounds, r.choice((0.0, 10.0 ** r.uniform(-6.0, 5.0))))
        assert all(0.0 < T < math.inf and abs(j) <= 1.000001 * bounds.jerk for T, j in phases)
        found = extremes(phases, 0.0, v, a)
        assert all(map(math.isfinite, found))
        if duration(phases) < 100.0:
            size = max(1.0, abs(distance), -found.q_min, found.q_max)
            check_motion(Problem(distance, v, a, bounds), phases, 1e-9 * max(size, abs(v), abs(a)))


@counts
def test_extremes_and_samples_agree(count):
    """
    The samples keep the rounding error of the acceleration, the extremes do not.

    An acceleration that falls from 80 rad/s² to 0 is then wrong by the last bit of 80, 1.4e-14: in
    380 s at constant velocity, the position of a sample by 0.5 · 1.4e-14 · 380² = 1.03e-9 rad.
    """
    for problem in problems(count // 4, 1.5, symmetric=False):
        phases = to_rest(*problem)
        times = [0.0]
        for T, _ in phases:
            times += [times[-1] + i * T / 50 for i in range(1, 51)]
        samples = list(zip(*(evaluate(phases, t, 0.0, *problem[1:3]) for t in times)))
        found = problem.extremes(phases)
        for values, low, high in zip(samples, found[::2], found[1::2]):
            tolerance = 1e-9 * max(1.0, duration(phases) / 100.0)**2
            near = 0.02 * (high - low) + tolerance
            assert low - tolerance <= min(values) <= low + near
            assert high - near <= max(values) <= high + tolerance


@counts
def test_a_smooth_motion_arrives_in_its_time_within_the_bounds(count):
    r, found = random.Random(4), 0
    for problem in problems(count, 1.5, symmetric=False):
        T = r.uniform(0.5, 3.0) * duration(to_rest(*problem))
        phases = smooth_to_rest(*problem, T)
        if phases is None:
            continue
        found += 1
        assert duration(phases) == pytest.approx(T)
        assert end(phases, 0.0, problem.v, problem.a) == pytest.approx(
            (problem.distance, 0.0, 0.0), abs=1e-9)
        most, (_, v, a, bounds) = problem.extremes(phases), problem
        assert min(v, bounds.v_min) <= most.v_min
        assert most.v_max <= max(v, bounds.v_max)
        assert min(a, bounds.a_min) <= most.a_min
        assert most.a_max <= max(a, bounds.a_max)
        assert all(abs(j) <= bounds.jerk for _, j in phases)
    assert found >= 0.2 * count


# --- known motions -------------------------------------------------------------------------------

REST = (0.0, 0.0)
WIDE = Bounds(-1e3, 1e3, -1e3, 1e3, 4.0)


def test_the_goal_at_the_stop_position_is_the_stop():
    v, a = 1.0, -0.5
    stopping = stop(v, a, WIDE)
    goal = end(stopping, 0.0, v, a)[0]
    assert to_rest(goal, v, a, WIDE) == stopping
    later = to_rest(goal, v, a, WIDE, 9.0)
    assert later[:-1] == stopping
    assert later[-1] == pytest.approx((9.0 - duration(stopping), 0.0))


def test_the_goal_at_the_start_needs_no_motion():
    assert to_rest(0.0, *REST, WIDE) == []
    assert to_rest(0.0, *REST, WIDE, 2.0) == [(2.0, 0.0)]
    assert extremes([], 0.5, *REST) == (0.5, 0.5, 0.0, 0.0, 0.0, 0.0)


# --- ruckig as oracle ----------------------------------------------------------------------------

class Oracle:
    """The plans of `ruckig` for one joint, whose inputs are built once."""

    def __init__(self) -> None:
        self.ruckig = library('ruckig')
        self._otg, self._plan = self.ruckig.Ruckig(1), self.ruckig.Trajectory(1)
        self._input = self.ruckig.InputParameter(1)
        self._input.current_position = self._input.target_acceleration = [0.0]

    def duration(self, problem: Problem) -> float:
        """Return the duration of the motion to rest."""
        one, (distance, v, a, bounds) = self._input, problem
        one.target_position = [distance]
        one.current_velocity, one.current_acceleration = [v], [a]
        one.min_velocity, one.max_velocity = [bounds.v_min], [bounds.v_max]
        one.min_acceleration, one.max_acceleration = [bounds.a_min], [bounds.a_max]
        one.max_jerk = [bounds.jerk]
        self._otg.calculate(one, self._plan)
        return float(self._plan.duration)


@counts
@pytest.mark.parametrize('symmetric', [True, False])
def test_no_motion_takes_longer_than_that_of_the_oracle(count, symmetric):
    """
    The durations are equal, unless the velocity must exceed its bound.

    The oracle then passes the bound in the shortest time and plans from there; this motion
    returns to the bound later, which can be faster in total. The largest speeds are equal.
    """
    oracle, beyond = Oracle(), 0
    for problem in problems(count, symmetric=symmetric):
        T = oracle.duration(problem)
        ratio = duration(to_rest(*problem)) / T
        assert ratio <= 1.0 + 1e-6
        if problem.bounds.v_min <= problem.reached() <= problem.bounds.v_max:
            assert ratio >= 1.0 - 1e-6
        else:
            beyond += ratio < 1.0 - 1e-6
    assert beyond <= 0.03 * count
