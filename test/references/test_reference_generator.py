# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""For any messages, the reference is continuous and within limits; paths are joined."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points
from sampled_references import (
    AMPLITUDE,
    angles,
    at,
    generator,
    laws,
    limits_of,
    NAMES,
    NOW,
    ns,
    OMEGA,
    ramp,
    samples,
    SECOND,
    set_point,
    sine,
    stream,
    TOLERANCE,
    ZERO,
)

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
        return make_trajectory(NAMES, [first, last], [q, draw(angles)])
    return quintic_via_points(NAMES, [first, 2.5, last], [q, 0.5 * q, draw(angles)])


@laws
@given(st.lists(st.tuples(trajectories(), st.floats(0.0, 1.5)), min_size=2, max_size=4))
def test_whenever_it_is_retargeted_position_velocity_and_acceleration_are_continuous(sent):
    one, t = generator(), 0.0
    for trajectory, pause in sent:
        before = one.sample(ns(t)) or Reference(ZERO, ZERO, ZERO)
        one.start(trajectory, ns(t), ZERO, ZERO)
        for old, new, tolerance in zip(before, at(one, t), (1e-9, 1e-6, 1e-6)):
            assert new == pytest.approx(old, abs=tolerance)
        t += pause


def test_without_limits_trajectories_are_followed_as_they_are():
    one = ReferenceGenerator(NAMES, (), None)
    one.start(set_point((1.0, 2.0)), NOW, ZERO, ZERO)
    assert at(one, 0.0).position.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(('interval', 'duration'), [
    (0.001, 0.1),  # [s] that each motion of a stream takes at least
    (0.05, 0.2), (0.49, 1.96),  # four periods
    (0.51, 0.0708)])  # the second one does not continue a stream: as early as possible
def test_set_points_at_most_half_a_second_apart_are_a_stream(interval, duration):
    one = generator()
    one.start(set_point((0.0, 0.001)), NOW, ZERO, ZERO)
    active = one.start(set_point((0.0002, 0.0)), ns(interval), ZERO, ZERO)
    assert (active.end_ns - ns(interval)) / SECOND == pytest.approx(duration, abs=1e-3)


def test_the_first_set_point_with_a_velocity_is_met_after_25_ms():
    one = ReferenceGenerator(NAMES, (), limits_of(), stream_timeout=1.0)
    one.start(set_point((0.01, 0.01), (0.05, 0.05)), NOW, ZERO, ZERO)
    assert at(one, 0.5).position == pytest.approx(
        np.full(2, 0.01 + 0.05 * (0.5 - 0.025)), abs=1e-6)


def test_a_target_beyond_the_velocity_limit_is_followed_with_95_percent_of_the_limit():
    """The limit of planned motions is 1.76 times that of the reference."""
    one = ReferenceGenerator(NAMES, (), limits_of(), stream_timeout=5.0)
    one.start(set_point(ZERO, (3.0, 0.0)), NOW, ZERO, ZERO)
    assert at(one, 3.0).velocity[0] == pytest.approx(0.95 * 1.76)


def test_a_stream_that_leaves_the_position_limits_ends_50_ms_before_them():
    one = generator(limits_of(box=1.0))
    found = stream(one, lambda t: tuple(5.0 * x for x in ramp(t)), 0.02, 1.5, True)
    assert at(one, 6.0).position[0] == pytest.approx(0.95, abs=1e-9)
    assert (found.q[:, 0] <= 0.95 + 1e-9).all()


@pytest.mark.parametrize(('q', 'v', 'end'), [
    (0.955, 0.1, 0.9683),  # it is followed for 0.1 s, and a stop
    (0.9499, 1.0, 0.9499),  # a motion to rest at it: no stop is possible 0.05 rad before
    (0.97, 1.0, 0.97)])  # the joint is closer already
def test_a_moving_set_point_is_followed_up_to_50_ms_before_a_position_limit(q, v, end):
    one = generator(limits_of(box=1.0))
    one.start(set_point((q, 0.0), (v, 0.0)), NOW, np.array((q, 0.0)), ZERO)
    assert at(one, 1.0).position[0] == pytest.approx(end, abs=1e-4)


def test_what_is_cleared_starts_from_the_measured_state():
    one = generator()
    one.start(set_point((1.0, 1.0)), NOW, ZERO, ZERO)
    one.clear()
    assert one.sample(NOW) is None
    one.start(set_point((1.0, 1.0)), NOW, np.array((0.4, 0.4)), ZERO)
    assert at(one, 0.0).position.tolist() == [0.4, 0.4]


def test_after_a_stop_the_same_set_point_is_a_new_goal():
    one, goal = generator(), np.array((1.0, 1.0))
    one.start(set_point(goal), NOW, ZERO, ZERO)
    one.stop(ns(0.3), ZERO, ZERO)
    assert (at(one, 5.0).position < 0.9).all()
    one.start(set_point(goal), ns(5.0), ZERO, ZERO)
    assert at(one, 10.0).position == pytest.approx(goal)


def test_the_same_goal_at_an_earlier_time_is_a_new_plan():
    one, goal = generator(), np.array((1.0, -0.5))
    for t, wait, end in ((0.0, 1000.0, 1000.0), (0.5, 999.5, 1000.0), (1.0, 5.0, 6.0),
                         (1.5, 20.0, 6.0)):
        active = one.start(set_point(goal, wait=wait), ns(t), ZERO, ZERO)
        assert (active.end_ns - NOW) / SECOND == pytest.approx(end, abs=1e-3)
    one.start(set_point(goal), ns(2.0), ZERO, ZERO)
    assert at(one, 5.0).position == pytest.approx(goal)


def test_after_an_imperceptible_motion_all_joints_arrive_at_the_time_of_the_goal():
    """In the first seconds of a slow motion the joints move, but too little to matter."""
    one, goal = generator(), np.array((0.01, -0.02))
    for t, q, wait in ((0.0, goal, 1000.0), (0.5, ZERO, 0.0), (0.51, goal, 2.0**31)):
        one.start(set_point(q, wait=wait), ns(t), ZERO, ZERO)
    for t in (2.0, 1e3, 1e6):
        assert at(one, t).position == pytest.approx(ZERO, abs=2e-5)
    assert at(one, 0.51 + 2.0**31).position == pytest.approx(goal)


# --- trajectories --------------------------------------------------------------------------------

@laws
@given(angles, angles, st.floats(2.0, 10.0), st.floats(0.0, 2.0))
def test_a_trajectory_from_the_present_state_passes_unchanged(start, goal, duration, wait):
    sent, one = quintic_point_to_point(NAMES, start, goal, duration), generator()
    one.start(sent, NOW, start, ZERO, stamp_ns=ns(wait))
    exact = ActiveTrajectory(sent, ns(wait), NOW, Reference(start, ZERO, ZERO))
    for t in np.linspace(0.0, wait + duration + 0.1, 60).tolist():
        for found, expected in zip(at(one, t), exact.sample(ns(t))):
            assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(('away', 'is_joined'), [(9e-7, False), (2e-6, True)])
def test_a_reference_that_is_a_microradian_away_from_a_path_is_on_it(away, is_joined):
    sent, one = quintic_point_to_point(NAMES, (away, 0.0), (1.0, 1.0), 3.0), generator()
    one.start(sent, NOW, ZERO, ZERO)
    assert at(one, 0.0).position[0] == pytest.approx(0.0 if is_joined else away, abs=1e-9)


@laws
@given(angles, angles, st.floats(0.0, 0.9), st.floats(-0.3, 0.3))
def test_a_trajectory_that_is_entered_late_is_met_on_its_path(start, goal, late, away):
    sent, one = quintic_via_points(
        NAMES, [0.0, 4.0, 10.0], [start, 0.5 * (start + goal), goal]), generator()
    measured = start + away
    one.start(sent, ns(10.0 * late), measured, ZERO, stamp_ns=NOW)
    active = one.active
    assert at(one, 10.0 * late).position == pytest.approx(measured, abs=2e-6)
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
    most, own = limits_of().whole, samples_of(exact)
    assert (np.abs(found.v) <= TOLERANCE * np.maximum(most.velocity, own.velocity)).all()
    assert (np.abs(found.a) <= TOLERANCE * np.maximum(most.acceleration, own.acceleration)).all()


def samples_of(exact: ActiveTrajectory) -> Reference:
    rows = [exact.sample(ns(t)) for t in np.linspace(0.0, 10.0, 200).tolist()]
    return Reference(*(np.abs(x).max(axis=0) for x in map(np.array, zip(*rows))))


def test_a_path_far_beyond_what_can_be_met_in_time_ends_at_its_goal():
    slow, goal = limits_of(v=0.02, a=0.1, j=2.0), np.array((3.0, 3.0))
    one = generator(slow)
    active = one.start(quintic_point_to_point(NAMES, goal, goal, 5.0), NOW, ZERO, ZERO)
    end = (active.end_ns - NOW) / SECOND
    assert (np.abs(samples(one, 0.0, end).v) <= TOLERANCE * slow.whole.velocity).all()
    assert at(one, end).position == pytest.approx(goal)


# --- streams of set-points, within limits, smoothly and with little lag --------------------------

CORRECTION = 0.05
"""Shortest time [s] in which a deviation from a moving set-point is corrected."""

# --- streams with velocities ---------------------------------------------------------------------

@pytest.mark.parametrize('rate', [50, 500])
def test_a_stream_with_velocities_is_followed_with_one_period_of_delay(rate):
    h = 1.0 / rate
    found = stream(generator(), sine, h, 0.8, True).after(0.4)
    exact = [sine(t - h) for t in found.t.tolist()]
    q, v = (np.array(x) for x in zip(*exact))
    a = -OMEGA**2 * q
    largest_jerk = AMPLITUDE * OMEGA**3
    # The acceleration is a difference of velocities, delayed by half a period. Deviations are
    # corrected in 0.05 s, with a jerk of 32 times the deviation per cube of that time.
    T = max(h, CORRECTION)
    assert np.abs(found.q - q).max() < largest_jerk * T**3 / 32.0
    assert np.abs(found.v - v).max() < largest_jerk * T**2 / 10.0
    assert np.abs(found.a - a).max() < largest_jerk * (0.6 * h + 0.15 * T)
    assert found.jerk < 4.0 * largest_jerk


@pytest.mark.parametrize('rate', [50, 500])
def test_a_stream_with_accelerations_is_followed_more_closely(rate):
    h, one = 1.0 / rate, generator()
    for i in range(round(0.6 / h)):
        q, v = sine(i * h)
        one.start(set_point(q, v, -OMEGA**2 * q), ns(i * h), q, v)
    found = samples(one, 0.6 - h, 0.6 - 1e-6, 20)
    exact = np.array([sine(t - h)[0] for t in found.t.tolist()])
    largest_jerk = AMPLITUDE * OMEGA**3
    assert np.abs(found.q - exact).max() < largest_jerk * CORRECTION**3 / 32.0
    assert np.abs(found.a + OMEGA**2 * exact).max() < 0.1 * largest_jerk * CORRECTION


@pytest.mark.parametrize(('rate', 'end'), [(50, 0.5), (200, 0.9)])
def test_the_end_of_a_stream_with_velocities_is_a_planned_stop(rate, end):
    one, limits = generator(), limits_of()
    stream(one, sine, 1.0 / rate, end, True)
    active = one.active
    stopped = (active.end_ns - NOW) / SECOND
    found = samples(one, end - 1.0 / rate, stopped + 0.1)
    assert stopped - end < one.stream_timeout + 1.0
    assert (np.abs(found.a) <= 2.0 * limits.acceleration).all()
    assert found.jerk <= 2.0 * limits.jerk[0]
    assert not at(one, stopped).velocity.any()
    # The speed decreases as soon as the acceleration is removed, with the limit of the jerk.
    later = found.after(end + one.stream_timeout + limits.acceleration[0] / limits.jerk[0])
    speed = np.abs(later.v)
    assert (np.diff(speed, axis=0) <= 1e-6).all()


# --- streams of positions ------------------------------------------------------------------------

def stated_lag(h: float, speed: float, limits: MotionLimits) -> float:
    """
    Return the largest lag [s] behind a ramp of this speed.

    The plan of each period ends at rest. Its duration T is 0.1 s, four periods, or twice that of
    the earliest stop. The lag is 2/3 of T, and one period.
    """
    return float(2.0 / 3.0 * max(0.1, 4.0 * h, 2.0 * stop_time(speed, limits)) + h)


def stop_time(speed: float, limits: MotionLimits) -> float:
    a, jerk = limits.acceleration[0], limits.jerk[0]
    return float(speed / a + a / jerk if speed > a**2 / jerk else 2.0 * np.sqrt(speed / jerk))


@pytest.mark.parametrize('limits', [limits_of(), limits_of(a=100.0, j=10_000.0)])
@pytest.mark.parametrize('rate', [10, 50, 500])
def test_a_ramp_of_positions_is_followed_smoothly_with_the_stated_lag(rate, limits):
    """It is that of the horizon where the limits do not matter."""
    h = 1.0 / rate
    everything = stream(generator(limits), ramp, h, 1.0, False)
    found = everything.after(0.8)
    lag = (ramp(1.0)[1] * found.t[:, np.newaxis] - found.q) / ramp(1.0)[1]
    assert (lag > 0.0).all()
    assert lag.max() <= stated_lag(h, 0.2, limits)
    assert lag[:, 0].max() >= stated_lag(h, 0.2, limits) - h - 1e-4
    assert found.v[:, 0] == pytest.approx(0.2, rel=0.02)
    assert np.abs(everything.v).max() <= TOLERANCE * limits.velocity[0]
    assert np.abs(everything.a).max() <= TOLERANCE * limits.acceleration[0]
    assert everything.jerk <= TOLERANCE * limits.jerk[0]


@pytest.mark.parametrize(('rate', 'distance'), [(2, 2.0), (10, 0.3), (50, 2.0), (200, 0.02)])
def test_a_set_point_that_is_repeated_is_reached_exactly_without_overshoot(rate, distance):
    goal, one = np.array((distance, -0.5 * distance)), generator()
    end = 1.5 + 2.0 * distance
    found = stream(one, lambda t: (goal, ZERO), 1.0 / rate, end, False)
    assert found.q[0] != pytest.approx(goal)
    last = at(one, end)
    assert last.position == pytest.approx(goal, abs=1e-12)
    assert not last.velocity.any()
    assert (found.q / goal).max() <= 1.0 + 1e-9
    assert (np.diff(found.q / goal, axis=0) >= -1e-9).all()
