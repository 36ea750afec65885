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
Messages and requests as hypothesis draws them: most are good, the others are almost.

A strategy that spoils every field gets no further than the first check, and one that spoils none
meets no check at all. So each part is good most of the time, and spoiled by one thing else.
"""

from collections.abc import Sequence
from functools import cache
from random import Random
from typing import Any

from builtin_interfaces.msg import Duration, Time
from fuzz_arms import (
    LOCKED_JOINT,
    MIMIC_JOINT,
    MIMIC_LEADER,
    MIMIC_MULTIPLIER,
    MIMIC_OFFSET,
)
from geometry_msgs.msg import InertiaStamped, WrenchStamped
from hypothesis import strategies as st
from robot_dynamics.model.arm import ArmModel
from robot_dynamics_interfaces.srv import (
    ForwardDynamics,
    InverseDynamics,
    InverseDynamicsBatch,
    InverseDynamicsTrajectory,
    ManipulatorEquation,
    SetPayload,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

Draw = Any
"""What `st.composite` hands to a strategy."""
MAX_INT32, MAX_UINT32 = 2**31 - 1, 2**32 - 1
NOW = 1_700_000_000
"""[s] since the epoch."""

WILD_NUMBERS = (
    float('nan'), float('inf'), -float('inf'), 5e-324, -1e-310, 1e-160, 1e-9, 1e6, -1e9, 1e18,
    -1e100, 1e154, -1e200, 1e300, 1.7976931348623157e308, -1.7976931348623157e308)
wild_numbers = st.one_of(st.sampled_from(WILD_NUMBERS), st.floats())
small_numbers = st.floats(-3.0, 3.0)
wild_texts = st.one_of(
    st.text(max_size=12),
    st.sampled_from(('', ' ', 'elbow ', 'ELBOW', 'élbow', '肘', '\U0001f9be', 'a\nb', '%s')),
    st.integers(100, 30_000).map(lambda length: 'x' * length))


@cache
def mostly(good: st.SearchStrategy[Any], spoiled: st.SearchStrategy[Any],
           fraction: float = 0.85) -> st.SearchStrategy[Any]:
    """Draw from `good`, and in the rest of the cases from `spoiled`."""
    in_20 = round(20 * fraction)
    return st.integers(0, 19).flatmap(lambda ticket: good if ticket < in_20 else spoiled)


# ---------------------------------------------------------------------------------- parts

@cache
@st.composite
def spoiled_vectors(draw: Draw, length: int) -> list[float]:
    """Draw numbers of which one is wild, or of which there are too few or too many."""
    if length and draw(st.booleans()):
        values = draw(good_vectors(length))
        values[draw(st.integers(0, length - 1))] = draw(wild_numbers)
        return values
    return draw(st.lists(
        st.one_of(small_numbers, wild_numbers), max_size=min(2 * length + 1, 12)))


@cache
def good_vectors(length: int, largest: float = 3.0) -> st.SearchStrategy[list[float]]:
    """
    Draw so many numbers, all at once: to draw them one by one takes most of the time of a test.

    The simplest are zeros.
    """
    def numbers(ticket: int) -> list[float]:
        uniform = Random(ticket).uniform
        return [uniform(-largest, largest) if ticket else 0.0 for _ in range(length)]

    return st.integers(0, MAX_UINT32).map(numbers)


@cache
def vectors(length: int, fraction: float = 0.85) -> st.SearchStrategy[list[float]]:
    """Draw numbers for a float64[]."""
    return mostly(good_vectors(length), spoiled_vectors(length), fraction)


@cache
def optional_vectors(length: int) -> st.SearchStrategy[list[float]]:
    """Draw numbers for a float64[] that may be left out."""
    return mostly(vectors(length), st.just([]), 0.7)


@cache
@st.composite
def spoiled_names(draw: Draw, names: Sequence[str]) -> list[str]:
    """Draw joint names with one thing wrong about them."""
    given = list(draw(st.permutations(names))) if len(names) < 10 else list(names)
    place = draw(st.integers(0, len(given) - 1))
    what = draw(st.integers(0, 5))
    if what == 0:
        del given[place]
    elif what == 1:
        given.insert(place, draw(wild_texts))
    elif what == 2:
        given.append(given[place])
    elif what == 3:
        given[place] = draw(wild_texts)
    elif what == 4:
        given.insert(place, LOCKED_JOINT)
    else:
        given = draw(st.lists(wild_texts, max_size=300))
    return given


@cache
def joint_names(
    names: Sequence[str], may_be_empty: bool = True, fraction: float = 0.9,
) -> st.SearchStrategy[list[str]]:
    """Draw joint names in any order, some with the joint that mimics another."""
    good = [st.just(list(names))]
    if len(names) < 10:
        good.append(st.permutations(names).map(list))
    if MIMIC_LEADER in names:
        good.append(st.permutations((*names, MIMIC_JOINT)).map(list))
    if may_be_empty:
        good.append(st.just([]))
    return mostly(st.one_of(good), spoiled_names(names), fraction)


def _follow(names: Sequence[str], values: list[float], with_offset: bool) -> list[float]:
    """Let the joint that mimics stand where its leader puts it, in each row of the values."""
    if MIMIC_JOINT not in names or MIMIC_LEADER not in names or len(values) % len(names):
        return values
    follower, leader = names.index(MIMIC_JOINT), names.index(MIMIC_LEADER)
    for row in range(0, len(values), len(names)):
        values[row + follower] = MIMIC_MULTIPLIER * values[row + leader] + (
            MIMIC_OFFSET if with_offset else 0.0)
    return values


@cache
@st.composite
def motions(draw: Draw, arm: ArmModel, rows: int = 1) -> dict[str, Any]:
    """Draw names and, in their order, rows of positions, velocities and accelerations."""
    names = draw(joint_names(arm.joint_names))
    length = rows * (len(names) or arm.joint_count)
    motion = {
        'position': draw(vectors(length)), 'velocity': draw(optional_vectors(length)),
        'acceleration': draw(optional_vectors(length))}
    if draw(st.integers(0, 9)):
        motion = {field: _follow(names, values, field == 'position')
                  for field, values in motion.items()}
    return {'joint_names': names, **motion}


@cache
@st.composite
def stamps(draw: Draw) -> Time:
    """Draw a time: none, one about now, or whatever the fields hold."""
    what = draw(st.integers(0, 3))
    if what == 0:
        return Time()
    if what < 3:
        return Time(
            sec=NOW + draw(st.integers(-10, 10)), nanosec=draw(st.integers(0, 999_999_999)))
    return Time(sec=draw(st.integers(-MAX_INT32 - 1, MAX_INT32)),
                nanosec=draw(st.integers(0, MAX_UINT32)))


_vectors3 = mostly(
    good_vectors(3), st.tuples(small_numbers, wild_numbers, small_numbers), 0.95)
_masses = mostly(st.floats(0.0, 5.0), wild_numbers)


# ---------------------------------------------------------------------------------- messages

@cache
@st.composite
def joint_states(draw: Draw, names: Sequence[str]) -> JointState:
    """Draw a state, or an effort: each of the three arrays may be left out."""
    given = draw(joint_names(names, may_be_empty=False))
    if draw(st.integers(0, 4)) == 0:  # other devices on the same topic, before or behind
        others = draw(st.lists(st.text(max_size=8), max_size=3, unique=True))
        given = others + given if draw(st.booleans()) else given + others
    message = JointState(
        name=given, position=draw(vectors(len(given))),
        velocity=draw(optional_vectors(len(given))), effort=draw(optional_vectors(len(given))))
    message.header.stamp = draw(stamps())
    return message


@cache
@st.composite
def efforts(draw: Draw, names: Sequence[str], largest: float = 100.0) -> JointState:
    """Draw an effort message, as a simulated arm gets it."""
    given = draw(joint_names(names, may_be_empty=False, fraction=0.95))
    message = JointState(name=given, effort=draw(mostly(
        good_vectors(len(given), largest), spoiled_vectors(len(given)))))
    message.header.stamp = draw(stamps())
    return message


@cache
@st.composite
def wrenches(draw: Draw, arm: ArmModel) -> WrenchStamped:
    """Draw a wrench on some link."""
    message = WrenchStamped()
    message.header.frame_id = draw(mostly(st.sampled_from(arm.link_names), wild_texts, 0.95))
    for vector in (message.wrench.force, message.wrench.torque):
        vector.x, vector.y, vector.z = draw(_vectors3)
    return message


@cache
def wrench_lists(arm: ArmModel) -> st.SearchStrategy[list[WrenchStamped]]:
    return st.lists(wrenches(arm), max_size=2)


@cache
@st.composite
def payloads(draw: Draw, arm: ArmModel) -> InertiaStamped:
    """Draw a load: a mass of 1 kg at (x, y, z) and a small sphere, most of the time."""
    message = InertiaStamped()
    message.header.frame_id = draw(mostly(st.sampled_from(arm.link_names), wild_texts, 0.95))
    load = message.inertia
    load.m = draw(_masses)
    load.com.x, load.com.y, load.com.z = draw(_vectors3)
    x, y, z = draw(good_vectors(3))
    sphere = 1e-3
    load.ixx, load.iyy, load.izz = (
        sphere + y * y + z * z, sphere + x * x + z * z, sphere + x * x + y * y)
    load.ixy, load.ixz, load.iyz = -x * y, -x * z, -y * z
    if draw(st.integers(0, 4)) == 0:
        field = draw(st.sampled_from(('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')))
        setattr(load, field, draw(wild_numbers))
    return message


def _increasing_times(count: int, ticket: int) -> list[Duration]:
    """Return times that grow by a millisecond to some seconds, the first one 0 or later."""
    random, times = Random(ticket), []
    time_ns = random.choice((0, 0, 1, 10**9))
    for _ in range(count):
        times.append(Duration(sec=time_ns // 10**9, nanosec=time_ns % 10**9))
        time_ns += random.randint(10**6, 10**10)
    return times


@cache
def _times(count: int) -> st.SearchStrategy[list[Duration]]:
    """Draw the times of points: strictly increasing ones, most of the time."""
    whatever = st.builds(
        Duration, sec=st.integers(-MAX_INT32 - 1, MAX_INT32), nanosec=st.integers(0, MAX_UINT32))
    return mostly(
        st.integers(0, MAX_UINT32).map(lambda ticket: _increasing_times(count, ticket)),
        st.lists(whatever, min_size=count, max_size=count), 0.9)


_POINT_FIELDS = ('positions', 'velocities', 'accelerations')
_point_counts = mostly(st.integers(1, 4), st.integers(0, 30), 0.95)
_spoiled_fields = st.sampled_from((0, 0, 0, 1, 2))


@cache
@st.composite
def trajectories(
    draw: Draw, names: Sequence[str], may_lack_names: bool = False,
) -> JointTrajectory:
    """Draw a trajectory; all of its points are good, but for a field or two."""
    given = draw(joint_names(names, may_lack_names))
    if MIMIC_JOINT in given and draw(st.integers(0, 9)):
        given = [name for name in given if name != MIMIC_JOINT]
    n, count = len(given) or len(names), draw(_point_counts)
    fields = _POINT_FIELDS[:draw(st.integers(1, 3))]
    points = [JointTrajectoryPoint(time_from_start=time) for time in draw(_times(count))]
    numbers = iter(draw(good_vectors(n * count * len(fields))))
    for point in points:
        for field in fields:
            setattr(point, field, [next(numbers) for _ in range(n)])
    if count > 1 and 'velocities' in fields:
        points[-1].velocities = [0.0] * n
    for _ in range(draw(_spoiled_fields) if points else 0):
        field, length = draw(st.sampled_from(_POINT_FIELDS)), draw(st.sampled_from((0, n)))
        setattr(points[draw(st.integers(0, count - 1))], field, draw(vectors(length, 0.5)))
    message = JointTrajectory(joint_names=given, points=points)
    message.header.stamp = draw(stamps())
    return message


# ---------------------------------------------------------------------------------- requests

@st.composite
def inverse_dynamics(draw: Draw, arm: ArmModel) -> InverseDynamics.Request:
    return InverseDynamics.Request(
        **draw(motions(arm)), external_wrenches=draw(wrench_lists(arm)))


@st.composite
def inverse_dynamics_batch(draw: Draw, arm: ArmModel) -> InverseDynamicsBatch.Request:
    return InverseDynamicsBatch.Request(**draw(motions(arm, draw(st.integers(0, 5)))))


@st.composite
def inverse_dynamics_trajectory(draw: Draw, arm: ArmModel) -> InverseDynamicsTrajectory.Request:
    return InverseDynamicsTrajectory.Request(
        trajectory=draw(trajectories(arm.joint_names, may_lack_names=True)))


@st.composite
def forward_dynamics(draw: Draw, arm: ArmModel) -> ForwardDynamics.Request:
    motion = draw(motions(arm))
    motion['effort'] = motion.pop('acceleration') or [0.0] * len(motion['position'])
    if draw(st.booleans()):  # at rest, where dry friction may hold
        motion['velocity'] = []
    return ForwardDynamics.Request(**motion, external_wrenches=draw(wrench_lists(arm)))


@st.composite
def manipulator_equation(draw: Draw, arm: ArmModel) -> ManipulatorEquation.Request:
    motion = draw(motions(arm))
    del motion['acceleration']
    return ManipulatorEquation.Request(**motion, include_christoffel=draw(st.booleans()))


@st.composite
def set_payload(draw: Draw, arm: ArmModel, longest: float = 0.5) -> SetPayload.Request:
    return SetPayload.Request(
        payload=draw(payloads(arm)),
        transition_time=draw(mostly(st.sampled_from((0.0, longest)), wild_numbers, 0.95)))
