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

"""The efforts along a trajectory: those of inverse dynamics at its points, against the limits."""

import numpy as np
import pytest
from robot_dynamics.actuator import make_actuators
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import load_arm
from robot_dynamics.limit_warnings import worst_in_words
from robot_dynamics.planar_urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.trajectory import (
    JointTrajectory,
    make_trajectory,
    quintic_point_to_point,
    quintic_via_points,
)
from robot_dynamics.trajectory_efforts import trajectory_efforts

NAMES = ('joint1', 'joint2')
DYNAMICS = ArmDynamics(load_arm(default_arm_urdf()))
LIMITS = np.array([150.0, 60.0])


def trajectory(
    times: list[float], q: list[list[float]], v: list[list[float]] | None = None,
    a: list[list[float]] | None = None,
) -> JointTrajectory:
    return make_trajectory(NAMES, times, q, v or (), a or (), NAMES)


def test_efforts_are_those_of_the_points_own_motion() -> None:
    path = quintic_via_points(NAMES, (0.0, 0.7, 1.5), [[0.0, 0.0], [0.9, -0.4], [0.2, 1.0]])
    result = trajectory_efforts(DYNAMICS, path)
    assert result.efforts.shape == (3, 2)
    for point, effort in zip(path.points, result.efforts):
        assert point.velocity is not None
        assert point.acceleration is not None
        assert effort == pytest.approx(DYNAMICS.inverse_dynamics(
            point.position, point.velocity, point.acceleration))


def test_the_worst_place_is_where_the_share_of_the_limit_is_largest() -> None:
    path = quintic_via_points(NAMES, (0.0, 0.7, 1.5), [[0.0, 0.0], [0.9, -0.4], [0.2, 1.0]])
    result = trajectory_efforts(DYNAMICS, path)
    shares = np.abs(result.efforts) / LIMITS
    i, j = np.unravel_index(np.argmax(shares), shares.shape)
    assert result.worst_ratio == shares.max()
    assert result.worst_joint == NAMES[j]
    assert result.worst_time == path.points[i].time_from_start
    assert result.feasible == (shares.max() <= 1.0)


def test_a_quicker_motion_is_not_feasible() -> None:
    def in_time(seconds: float) -> bool:
        times = (0.0, seconds / 2, seconds)
        return trajectory_efforts(DYNAMICS, quintic_via_points(
            NAMES, times, [[0.0, 0.0], [1.5, 0.5], [0.0, 0.0]])).feasible

    assert in_time(5.0)
    assert not in_time(0.3)


def test_a_cubic_path_is_taken_with_the_acceleration_of_its_interpolation() -> None:
    """Of a cubic from rest to rest the acceleration at the ends is ±6 (q1 - q0) / T²."""
    T = 0.5
    path = trajectory([0.0, T], [[0.0, 0.0], [1.0, -0.5]], [[0.0, 0.0], [0.0, 0.0]])
    effort = trajectory_efforts(DYNAMICS, path).efforts[0]
    a = 6.0 * np.array([1.0, -0.5]) / T**2
    assert effort == pytest.approx(DYNAMICS.inverse_dynamics(np.zeros(2), np.zeros(2), a))


def test_a_linear_path_is_taken_with_its_slope() -> None:
    path = trajectory([0.0, 0.5], [[0.0, 0.3], [1.0, -0.5]])
    first, last = trajectory_efforts(DYNAMICS, path).efforts
    v = np.array([2.0, -1.6])
    assert first == pytest.approx(
        DYNAMICS.inverse_dynamics(np.array([0.0, 0.3]), v, np.zeros(2)))
    # after the last point the reference rests
    assert last == pytest.approx(DYNAMICS.rigid_body.gravity(np.array([1.0, -0.5])))


def test_one_point_is_held() -> None:
    result = trajectory_efforts(DYNAMICS, trajectory([0.0], [[1.0, 0.5]]))
    assert result.efforts == pytest.approx(
        DYNAMICS.rigid_body.gravity(np.array([1.0, 0.5]))[None])


def test_a_path_that_begins_late_is_timed_from_its_start() -> None:
    path = trajectory([2.0, 3.0], [[1.5, 0.0], [0.0, 0.0]])
    assert trajectory_efforts(DYNAMICS, path).worst_time == 2.0


def test_without_limits_everything_is_feasible() -> None:
    urdf = planar_arm_urdf([5.0], [1.0], [0.5], [0.1]).replace('effort="1000.0"', 'effort="0"')
    dynamics = ArmDynamics(load_arm(urdf))
    assert np.isinf(dynamics.arm.limits.effort).all()
    result = trajectory_efforts(
        dynamics, quintic_point_to_point(('joint1',), [0.0], [3.0], 0.01))
    assert result.feasible
    assert result.worst_ratio == 0.0
    assert result.worst_joint == 'joint1'
    assert worst_in_words(result) == ''


PATH = quintic_via_points(NAMES, (0.0, 0.7, 1.5), [[0.0, 0.0], [0.9, -0.4], [0.2, 1.0]])
AMPLE = {
    'torque_constant': [0.1, 0.1], 'gear_ratio': [100.0, 50.0], 'rotor_inertia': [1e-4, 1e-5],
    'resistance': [0.5, 0.5], 'efficiency': [0.8, 0.8], 'current_limit': [100.0],
    'voltage_limit': [1000.0]}


@pytest.mark.parametrize(('changes', 'limit', 'feasible'), [
    ({}, 'effort', True),
    ({'current_limit': [5.0, 100.0]}, 'current', False),
    ({'current_limit': [9.0, 100.0]}, 'current', True),
    ({'voltage_limit': [1000.0, 2.0]}, 'voltage', False),
])
def test_what_motors_lack_counts_too(
    changes: dict[str, list[float]], limit: str, feasible: bool,
) -> None:
    actuators = make_actuators(NAMES, **{**AMPLE, **changes})
    dynamics = ArmDynamics(DYNAMICS.arm.with_actuators(actuators))
    result = trajectory_efforts(dynamics, PATH)
    shares = {'effort': [], 'current': [], 'voltage': []}
    for point, effort in zip(PATH.points, result.efforts):
        load = actuators.load(effort, point.velocity, point.acceleration)
        shares['effort'].append(np.abs(effort) / LIMITS)
        shares['current'].append(load.current_ratio)
        shares['voltage'].append(load.voltage_ratio)
    worst = max(np.max(rows) for rows in shares.values())
    i, j = np.argwhere(np.array(shares[limit]) == worst)[0]
    assert (result.worst_limit, result.feasible) == (limit, feasible)
    assert result.worst_ratio == pytest.approx(worst)
    assert (result.worst_joint, result.worst_time) == (NAMES[j], PATH.points[i].time_from_start)
    words = worst_in_words(result)
    motor = '' if limit == 'effort' else 'the motor of '
    assert words.startswith(f'{limit} of {motor}{NAMES[j]!r} is {worst:.3g} times its limit at ')


def test_the_load_counts() -> None:
    from robot_dynamics.payload import make_payload
    loaded = ArmDynamics(DYNAMICS.arm.with_payloads([make_payload('tool0', 10.0)]))
    path = trajectory([0.0], [[np.pi / 2, 0.0]])
    with_load, without = (trajectory_efforts(d, path).efforts[0] for d in (loaded, DYNAMICS))
    assert with_load - without == pytest.approx([-10.0 * 9.81 * 1.8, -10.0 * 9.81 * 0.8])
