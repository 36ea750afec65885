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

"""For any messages, the reference is continuous, within limits, and follows with little lag."""

from collections.abc import Callable
from typing import Any, NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.trajectories.follower import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    make_trajectory,
    nanoseconds,
)
from robot_dynamics.trajectories.motion_limits import MotionLimits
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points
from robot_dynamics.trajectories.reference_generator import (
    HORIZON,
    ON_PATH,
    PERIODS,
    ReferenceGenerator,
    whole,
)

NAMES = ('a', 'b')
SECOND = 1_000_000_000
NOW = 1_790_000_000 * SECOND
ZERO = np.zeros(2)
TOLERANCE = 1.05

laws = settings(deadline=None, derandomize=True, max_examples=25)
angles = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2).map(np.array)
Motion = Callable[[float], tuple[FloatArray, FloatArray]]


def limits_of(v: float = 1.0, a: float = 5.0, j: float = 90.0, box: float = 10.0) -> MotionLimits:
    return MotionLimits(*np.full((2, 5), (-box, box, v, a, j)).T)


def generator(limits: MotionLimits | None = None) -> ReferenceGenerator:
    return ReferenceGenerator(NAMES, (), limits or limits_of())


def set_point(q: Any, v: Any = None, a: Any = None, wait: float = 0.0) -> JointTrajectory:
    velocities, accelerations = (
        () if x is None else [np.asarray(x).tolist()] for x in (v, a))
    return make_trajectory(
        NAMES, [wait], [np.asarray(q).tolist()], velocities, accelerations, NAMES)


def ns(t: float) -> int:
    return NOW + nanoseconds(t)


def at(one: ReferenceGenerator, t: float) -> Reference:
    reference = one.sample(ns(t))
    assert reference is not None
    return reference


class Samples(NamedTuple):
    """Times (m,) [s] after NOW, and the references at these times, (m, n) each."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray

    @property
    def jerk(self) -> float:
        return float(np.abs(np.diff(self.a, axis=0) / np.diff(self.t)[:, np.newaxis]).max())

    def after(self, t: float) -> 'Samples':
        return Samples(*(x[self.t >= t] for x in self))


def samples(one: ReferenceGenerator, start: float, end: float, count: int = 200) -> Samples:
    ts = np.linspace(start, end, count)
    return Samples(ts, *(np.array(x) for x in zip(*(at(one, t) for t in ts.tolist()))))


def stream(
    one: ReferenceGenerator, motion: Motion, h: float, end: float, with_v: bool,
    measured: FloatArray = ZERO,
) -> Samples:
    """Send a set-point every h [s]; sample at least 4 times per period, and every 5 ms."""
    parts, count = [], max(4, round(h / 0.005))
    for i in range(round(end / h)):
        q, v = motion(i * h)
        one.start(set_point(q, v if with_v else None), ns(i * h), measured, ZERO)
        parts.append(samples(one, i * h, (i + 1) * h - 1e-9, count))
    return Samples(*(np.concatenate(x) for x in zip(*parts)))


def sine(t: float) -> tuple[FloatArray, FloatArray]:
    phase = OMEGA * t + np.array((0.0, 1.0))
    return AMPLITUDE * np.sin(phase), AMPLITUDE * OMEGA * np.cos(phase)


def ramp(t: float) -> tuple[FloatArray, FloatArray]:
    v = np.array((0.2, -0.1))
    return v * t, v


OMEGA, AMPLITUDE = 4.0, 0.1


# --- the first reference -------------------------------------------------------------------------

@st.composite
def trajectories(draw: Any) -> JointTrajectory:
    kind = draw(st.sampled_from(['position', 'velocity', 'wait', 'path', 'positions']))
    q, v = draw(angles), 0.2 * draw(angles)
    if kind == 'position':
        return set_point(q)
    if kind == 'velocity':
        return set_point(q, v)
    if kind == 'wait':
        return set_point(q, wait=draw(st.floats(0.0, 3.0)))
    first, last = draw(st.floats(0.0, 2.0)), draw(st.floats(3.0, 6.0))
    if kind == 'positions':
        return make_trajectory(
            NAMES, [first, last], [q.tolist(), draw(angles).tolist()], (), (), NAMES)
    return quintic_via_points(NAMES, [first, 2.5, last], [q, 0.5 * q, draw(angles)])


@laws
@given(st.lists(st.tuples(trajectories(), st.floats(0.0, 1.5)), min_size=2, max_size=5))
def test_whenever_it_is_retargeted_position_velocity_and_acceleration_are_continuous(
    sent: list[tuple[JointTrajectory, float]],
) -> None:
    one, t = generator(), 0.0
    for trajectory, pause in sent:
        before = one.sample(ns(t)) or Reference(ZERO, ZERO, ZERO)
        one.start(trajectory, ns(t), ZERO, ZERO)
        for old, new in zip(before, at(one, t)):
            assert new == pytest.approx(old, abs=1e-9)
        t += pause


@laws
@given(st.lists(st.tuples(angles, st.floats(0.0, 1.0)), min_size=2, max_size=5),
       st.floats(0.0, 1.0))
def test_goals_at_any_time_are_reached_within_the_limits(
    sent: list[tuple[FloatArray, float]], wait: float,
) -> None:
    one, t, limits = generator(), 0.0, limits_of()
    for goal, pause in sent:
        active = one.start(set_point(goal, wait=wait), ns(t), ZERO, ZERO)
        found = samples(one, t, (active.end_ns - NOW) / SECOND)
        for values, most in ((found.v, limits.velocity), (found.a, limits.acceleration)):
            assert (np.abs(values) <= TOLERANCE * most).all()
        assert found.jerk <= TOLERANCE * 90.0
        assert active.sample(active.end_ns).position == pytest.approx(goal)
        t += pause


def test_without_limits_trajectories_are_followed_as_they_are() -> None:
    one = ReferenceGenerator(NAMES, (), None)
    one.start(set_point((1.0, 2.0)), NOW, ZERO, ZERO)
    assert at(one, 0.0).position.tolist() == [1.0, 2.0]


def test_what_is_cleared_starts_from_the_measured_state() -> None:
    one = generator()
    one.start(set_point((1.0, 1.0)), NOW, ZERO, ZERO)
    one.clear()
    assert one.sample(NOW) is None
    one.start(set_point((1.0, 1.0)), NOW, np.array((0.4, 0.4)), ZERO)
    assert at(one, 0.0).position.tolist() == [0.4, 0.4]


# --- trajectories --------------------------------------------------------------------------------

@laws
@given(angles, angles, st.floats(2.0, 10.0), st.floats(0.0, 2.0))
def test_a_trajectory_from_the_present_state_passes_unchanged(
    start: FloatArray, goal: FloatArray, duration: float, wait: float,
) -> None:
    sent, one = quintic_point_to_point(NAMES, start, goal, duration), generator()
    one.start(sent, NOW, start, ZERO, stamp_ns=ns(wait))
    exact = ActiveTrajectory(sent, ns(wait), NOW, Reference(start, ZERO, ZERO))
    for t in np.linspace(0.0, wait + duration + 0.1, 60).tolist():
        for found, expected in zip(at(one, t), exact.sample(ns(t))):
            assert found == pytest.approx(expected, abs=1e-9)


@laws
@given(angles, angles, st.floats(0.0, 0.9), st.floats(-0.3, 0.3))
def test_a_trajectory_that_is_entered_late_is_met_on_its_path(
    start: FloatArray, goal: FloatArray, late: float, away: float,
) -> None:
    sent, one = quintic_via_points(
        NAMES, [0.0, 4.0, 10.0], [start, 0.5 * (start + goal), goal]), generator()
    measured = start + away
    one.start(sent, ns(10.0 * late), measured, ZERO, stamp_ns=NOW)
    active = one.active
    assert active is not None
    assert at(one, 10.0 * late).position == pytest.approx(measured, abs=2.0 * ON_PATH)
    # A trajectory that starts now waits for the arm; other trajectories keep their times.
    assert ns(10.0 * late) == NOW or active.start_ns == NOW
    exact = ActiveTrajectory(sent, active.start_ns, NOW, Reference(start, ZERO, ZERO))
    times = np.linspace(ns(10.0 * late), active.end_ns, 200).astype(int).tolist()
    deviation = np.array([
        np.abs(active.sample(t).position - exact.sample(t).position).max() for t in times])
    on_path = deviation <= 1e-9
    assert on_path[-1]
    assert on_path[int(np.argmax(on_path)) + 1:].all()
    found = samples(one, 10.0 * late, (active.end_ns - NOW) / SECOND)
    most, own = whole(limits_of()), samples_of(exact)
    assert (np.abs(found.v) <= TOLERANCE * np.maximum(most.velocity, own.velocity)).all()
    assert (np.abs(found.a) <= TOLERANCE * np.maximum(
        most.acceleration, own.acceleration)).all()


def samples_of(exact: ActiveTrajectory) -> Reference:
    rows = [exact.sample(ns(t)) for t in np.linspace(0.0, 10.0, 200).tolist()]
    return Reference(*(np.abs(x).max(axis=0) for x in map(np.array, zip(*rows))))


def test_a_path_far_beyond_what_can_be_met_in_time_ends_at_its_goal() -> None:
    slow, goal = limits_of(v=0.02, a=0.1, j=2.0), np.array((3.0, 3.0))
    one = generator(slow)
    active = one.start(quintic_point_to_point(NAMES, goal, goal, 5.0), NOW, ZERO, ZERO)
    end = (active.end_ns - NOW) / SECOND
    found = samples(one, 0.0, end)
    assert (np.abs(found.v) <= TOLERANCE * whole(slow).velocity).all()
    assert at(one, end).position == pytest.approx(goal)


# --- streams with velocities ---------------------------------------------------------------------

@pytest.mark.parametrize('rate', [50, 100, 500, 1000])
def test_a_stream_with_velocities_is_followed_with_one_period_of_delay(rate: int) -> None:
    h = 1.0 / rate
    found = stream(generator(), sine, h, 0.8, True).after(0.4)
    exact = [sine(t - h) for t in found.t.tolist()]
    q, v = (np.array(x) for x in zip(*exact))
    a = -OMEGA**2 * q
    largest_jerk = AMPLITUDE * OMEGA**3
    # The acceleration is a difference of velocities, delayed by half a period.
    assert np.abs(found.q - q).max() < 1e-6 + 0.1 * largest_jerk * h**3
    assert np.abs(found.v - v).max() < largest_jerk * h**2
    assert np.abs(found.a - a).max() < 0.6 * largest_jerk * h
    assert found.jerk < 4.0 * largest_jerk


@pytest.mark.parametrize('rate', [50, 100, 500, 1000])
def test_a_stream_with_accelerations_is_followed_more_closely(rate: int) -> None:
    h, one = 1.0 / rate, generator()
    for i in range(round(0.6 / h)):
        q, v = sine(i * h)
        one.start(set_point(q, v, -OMEGA**2 * q), ns(i * h), q, v)
    found = samples(one, 0.6 - h, 0.6 - 1e-6, 20)
    exact = np.array([sine(t - h)[0] for t in found.t.tolist()])
    assert np.abs(found.q - exact).max() < 1e-7
    assert np.abs(found.a + OMEGA**2 * exact).max() < 0.01


@pytest.mark.parametrize('rate', [50, 1000])
@pytest.mark.parametrize('jump', [0.1, 1.0, 3.0])
def test_a_jump_in_a_stream_with_velocities_is_followed_within_the_limits(
    rate: int, jump: float,
) -> None:
    one, h, most = generator(), 1.0 / rate, whole(limits_of())
    found = stream(one, lambda t: (np.full(2, jump if t > 0.3 else 0.0), ZERO), h, 0.8, True)
    assert (np.abs(found.v) <= TOLERANCE * most.velocity).all()
    assert (np.abs(found.a) <= TOLERANCE * most.acceleration).all()
    assert found.jerk <= TOLERANCE * most.jerk[0]


def test_a_velocity_beyond_the_limit_is_not_followed() -> None:
    one, most = generator(), whole(limits_of())
    found = stream(one, lambda t: (50.0 * np.array((t, -t)), np.array((50.0, -50.0))),
                   0.01, 1.0, True)
    assert (np.abs(found.v) <= TOLERANCE * most.velocity).all()
    assert (np.abs(found.a) <= TOLERANCE * most.acceleration).all()


@pytest.mark.parametrize('rate', [50, 500])
@pytest.mark.parametrize('end', [0.5, 0.9, 1.1])
def test_the_end_of_a_stream_with_velocities_is_a_planned_stop(rate: int, end: float) -> None:
    one, limits = generator(), limits_of()
    stream(one, sine, 1.0 / rate, end, True)
    active = one.active
    assert active is not None
    stopped = (active.end_ns - NOW) / SECOND
    found = samples(one, end - 1.0 / rate, stopped + 0.1)
    assert stopped - end < one.stream_timeout + 1.0
    assert (np.abs(found.a) <= 2.0 * limits.acceleration).all()
    assert found.jerk <= 2.0 * limits.jerk[0]
    assert not at(one, stopped).velocity.any()
    later = found.after(end + one.stream_timeout)
    speed = np.abs(later.v)
    assert (np.diff(speed, axis=0) <= 1e-6).all()


# --- streams of positions ------------------------------------------------------------------------

def stated_lag(h: float, speed: float, limits: MotionLimits) -> float:
    """
    Return the largest lag [s] behind a ramp of this speed.

    The plan of each period ends at rest. Its duration T is the horizon, or the duration of the
    stop within the limits of jerk, 12 v / T², and acceleration; plus 15 %, the step of durations.
    """
    T = max(HORIZON, PERIODS * h, np.sqrt(12.0 * speed / limits.jerk[0]),
            1.5 * speed / limits.acceleration[0])
    return float(0.6 * 1.15 * T + h)


@pytest.mark.parametrize('rate', [10, 30, 50, 100, 500, 1000])
def test_a_ramp_of_positions_is_followed_smoothly_with_the_stated_lag(rate: int) -> None:
    h, limits = 1.0 / rate, limits_of()
    everything = stream(generator(), ramp, h, 1.0, False)
    found = everything.after(0.8)
    lag = (ramp(1.0)[1] * found.t[:, np.newaxis] - found.q) / ramp(1.0)[1]
    assert (lag > 0.0).all()
    assert lag.max() <= stated_lag(h, 0.2, limits)
    assert found.v[:, 0] == pytest.approx(0.2, rel=0.02)
    assert np.abs(everything.v).max() <= TOLERANCE * 1.0
    assert np.abs(everything.a).max() <= TOLERANCE * 5.0
    assert everything.jerk <= TOLERANCE * 90.0


@pytest.mark.parametrize('rate', [10, 50, 1000])
def test_the_lag_is_that_of_the_horizon_where_the_limits_do_not_matter(rate: int) -> None:
    h, limits = 1.0 / rate, limits_of(a=100.0, j=10_000.0)
    found = stream(generator(limits), ramp, h, 1.0, False).after(0.8)
    lag = (ramp(1.0)[1] * found.t[:, np.newaxis] - found.q) / ramp(1.0)[1]
    assert lag.max() <= 0.6 * max(HORIZON, PERIODS * h) + h


@pytest.mark.parametrize('rate', [10, 30, 100, 1000])
def test_a_sine_of_positions_is_followed_smoothly(rate: int) -> None:
    h, limits = 1.0 / rate, limits_of()
    everything = stream(generator(), sine, h, 1.8, False)
    assert np.abs(everything.v).max() <= TOLERANCE * limits.velocity[0]
    assert np.abs(everything.a).max() <= TOLERANCE * limits.acceleration[0]
    assert everything.jerk <= TOLERANCE * limits.jerk[0]
    found = everything.after(0.8)
    most = stated_lag(h, AMPLITUDE * OMEGA, limits)
    errors = [np.abs(found.q - np.array([sine(t - lag)[0] for t in found.t.tolist()])).max()
              for lag in np.linspace(0.0, most, 20).tolist()]
    assert min(errors) < 0.15 * AMPLITUDE


@pytest.mark.parametrize('rate', [2, 10, 50, 500])
@pytest.mark.parametrize('distance', [0.02, 0.3, 2.0])
def test_a_set_point_that_is_repeated_is_reached_exactly_without_overshoot(
    rate: int, distance: float,
) -> None:
    goal, one = np.array((distance, -0.5 * distance)), generator()
    end = 1.5 + 2.0 * distance
    found = stream(one, lambda t: (goal, ZERO), 1.0 / rate, end, False)
    assert found.q[0] != pytest.approx(goal)
    last = at(one, end)
    assert last.position == pytest.approx(goal, abs=1e-12)
    assert not last.velocity.any()
    assert (found.q / goal).max() <= 1.0 + 1e-9
    assert (np.diff(found.q / goal, axis=0) >= -1e-9).all()


@pytest.mark.parametrize('rate', [10, 50, 500])
def test_a_stream_that_stays_at_its_last_position_ends_there_with_little_overshoot(
    rate: int,
) -> None:
    one = generator()
    found = stream(one, lambda t: (ramp(min(t, 1.0))[0], ZERO), 1.0 / rate, 2.5, False)
    goal = ramp(1.0)[0]
    assert at(one, 2.5).position == pytest.approx(goal, abs=1e-12)
    assert (found.q / goal).max() <= 1.05


def test_after_a_stop_the_same_set_point_is_a_new_goal() -> None:
    one, goal = generator(), np.array((1.0, 1.0))
    one.start(set_point(goal), NOW, ZERO, ZERO)
    one.stop(ns(0.3), ZERO, ZERO)
    assert (at(one, 5.0).position < 0.9).all()
    one.start(set_point(goal), ns(5.0), ZERO, ZERO)
    assert at(one, 10.0).position == pytest.approx(goal)


def test_a_goal_is_followed_again_after_one_without_limits() -> None:
    one, limits = generator(), limits_of()
    for t, goal, used in ((0.0, (0.5, 0.0), limits), (10.0, (0.2, 0.1), None),
                          (20.0, (0.5, 0.0), limits)):
        one.limits = used
        one.start(set_point(goal, wait=1.0), ns(t), ZERO, ZERO)
        np.testing.assert_allclose(at(one, t + 9.0).position, goal)
