# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Conversions between messages and arrays: round trips, and rejections."""

import array
import re

from builtin_interfaces.msg import Time
from fuzz_law import over_the_wire
from geometry_msgs.msg import WrenchStamped
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from robot_dynamics.exceptions import InvalidInputError, JointNamesError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.goals.tolerances import with_given
from robot_dynamics.ros.middleware import conversions
from robot_dynamics.ros.middleware.cdr_templates import JointStateDecoder
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
READER = JointStateReader(NAMES)
"""A reader that gets messages with changing orders of the joints."""

laws = settings(max_examples=50)


# --- arrays and stamps ---------------------------------------------------------------------------

def test_matrices_travel_row_by_row_whatever_their_layout():
    A = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert list(conversions.floats_to_ros(A)) == [1.0, 2.0, 3.0, 4.0]
    assert list(conversions.floats_to_ros(A.T)) == [1.0, 3.0, 2.0, 4.0]


@laws
@given(st.integers(-1, (2**31 - 1) * 10**9 + 999_999_999))
@example(-1)
def test_stamps_keep_every_nanosecond(stamp_ns):
    sent = over_the_wire(conversions.stamp_to_ros(stamp_ns))
    assert conversions.stamp_from_ros(sent) == stamp_ns
    assert sent == Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


# --- payload -------------------------------------------------------------------------------------

@laws
@given(
    st.floats(1e-3, 100.0), st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.integers(0, 2**32 - 1))
def test_payloads_come_back(mass, com, seed):
    # the second moments of a body give a physically possible inertia
    A = np.random.default_rng(seed).standard_normal((3, 3))
    S = A @ A.T
    payload = make_payload('tool0', mass, com, np.trace(S) * np.eye(3) - S)
    back = conversions.payload_from_ros(ARM, over_the_wire(conversions.payload_to_ros(payload)))
    assert (back.link, back.mass, back.com.tolist()) == ('tool0', mass, com)
    assert back.inertia.tolist() == payload.inertia.tolist()


def test_no_payload_is_a_mass_of_zero_and_other_links_are_refused():
    message = conversions.payload_to_ros(None)
    message.header.frame_id = 'no such link'  # without mass the link has no meaning
    assert conversions.payload_from_ros(ARM, message) is None
    message = conversions.payload_to_ros(make_payload('hand', 1.0))
    with pytest.raises(InvalidInputError, match=r"header\.frame_id is 'hand'.*'tool0'"):
        conversions.payload_from_ros(ARM, message)


# --- wrenches ------------------------------------------------------------------------------------

def test_bad_wrenches_say_which_one():
    good, nowhere, bad = WrenchStamped(), WrenchStamped(), WrenchStamped()
    good.header.frame_id = bad.header.frame_id = 'tool0'
    nowhere.header.frame_id = 'hand'
    bad.wrench.torque.y = float('nan')
    with pytest.raises(
            InvalidInputError, match=r"external_wrenches\[1\]\.header\.frame_id is 'hand'"):
        conversions.wrenches_from_ros(ARM, [good, nowhere])
    with pytest.raises(
            InvalidInputError, match=r'external_wrenches\[1\]\.wrench\.torque\[1\] \(y\) is nan'):
        conversions.wrenches_from_ros(ARM, [good, bad])
    good.wrench.force.z = -1e10
    with pytest.raises(InvalidInputError, match=r'force\[2\] \(z\) is -1e\+10, expected'):
        conversions.wrenches_from_ros(ARM, [good])


# --- trajectories --------------------------------------------------------------------------------

@pytest.mark.parametrize('count', [1, 2, 3], ids=['positions', 'velocities', 'accelerations'])
def test_trajectories_come_back(count):
    rows = np.random.default_rng(count).uniform(-3.0, 3.0, (3, 4, 2))
    rows[1, -1] = 0.0  # the last of several points is at rest
    trajectory = make_trajectory(
        NAMES, [1e-9, 0.5, 7.123456789, 10.0], *rows[:count].tolist(), expected_joints=NAMES)
    sent = over_the_wire(conversions.trajectory_to_ros(trajectory))
    back = conversions.trajectory_from_ros(sent, NAMES)
    assert back.joint_names == trajectory.joint_names
    for k, (point, original) in enumerate(zip(back.points, trajectory.points, strict=True)):
        assert point.time_from_start == pytest.approx(original.time_from_start, rel=0, abs=5e-10)
        values = point.position, point.velocity, point.acceleration
        assert [value.tolist() for value in values[:count]] == rows[:count, k].tolist()
        assert values[count:] == (None,) * (3 - count)
    message = JointTrajectory(joint_names=['joint2', 'joint1'], points=[
        JointTrajectoryPoint(positions=[2.0, 1.0])])
    point, = conversions.trajectory_from_ros(message, NAMES).points
    assert point.position.tolist() == [1.0, 2.0]


# --- joint states --------------------------------------------------------------------------------

@laws
@given(st.permutations(['joint1', 'joint2', 'gripper', 'wheel']), st.integers(0, 2**32 - 1))
def test_joint_states_are_read_by_name(names, seed):
    random = np.random.default_rng(seed)
    q, v, tau = random.standard_normal((3, 4)).tolist()
    message = JointState(name=names, position=q, velocity=v, effort=tau)
    for _ in range(2):  # the order is cached at the first message
        position, velocity = READER.read(message)
        assert position.tolist() == [q[names.index(name)] for name in NAMES]
        assert velocity.tolist() == [v[names.index(name)] for name in NAMES]
        effort = READER.effort(message)
        assert effort.tolist() == [tau[names.index(name)] for name in NAMES]


@laws
@given(st.lists(st.sampled_from(['joint1', 'joint2', 'x']), max_size=4))
def test_joint_states_that_lack_a_joint_or_double_one_are_refused(names):
    assume(not all(names.count(joint) == 1 for joint in NAMES))
    message = JointState(name=names, position=[0.0] * len(names))
    with pytest.raises(InvalidInputError, match='^name '):
        JointStateReader(NAMES).read(message)


@pytest.mark.parametrize(('number', 'is_finite'), [
    (float('nan'), False), (-float('inf'), False), (1.5e9, True)])
def test_numbers_that_no_arm_has_are_refused_by_joint(number, is_finite):
    names, values = ['joint2', 'x', 'joint1'], [number, float('nan'), -1e9]
    words = f"of 'joint2' is {number:g}, expected a "
    with pytest.raises(InvalidInputError, match=re.escape(
            f'effort {words}number in [-1e+09, 1e+09]')):
        READER.finite_effort(JointState(name=names, effort=values))
    if is_finite:  # a measured state may exceed bounds: a non-finite effort is then a fault
        q, v = READER.read(JointState(name=names, position=values, velocity=values))
        assert q[1] == v[1] == number
    else:
        with pytest.raises(InvalidInputError, match=f'position {words}finite number'):
            READER.read(JointState(name=names, position=values))
        if np.isnan(number):  # sent by drivers that do not measure the velocity
            assert READER.read(JointState(
                name=names, position=[0.0] * 3, velocity=values))[1] is None
            return
        with pytest.raises(InvalidInputError, match=f'velocity {words}finite number'):
            READER.read(JointState(name=names, position=[0.0] * 3, velocity=values))
    # A measured state may lack a joint.
    assert READER.effort(JointState(name=names, effort=values))[0] == -1e9


def test_an_effort_message_has_an_effort_for_each_joint():
    with pytest.raises(InvalidInputError, match='effort has 0 values, expected 2 as name has'):
        JointStateReader(NAMES).finite_effort(JointState(name=NAMES))


@pytest.mark.parametrize('velocity', [[1.0, 2.0], [1.0, 2.0, 3.0, 4.0]])
def test_the_positions_are_used_and_all_velocities_are_missing(velocity):
    reader, decoder = JointStateReader(('a', 'b')), JointStateDecoder()
    message = JointState(name=['a', 'b', 'claw'], position=array.array('d', [0.1, 0.2, 0.3]),
                         velocity=array.array('d', velocity))
    for _ in range(3):  # also once the layout is known
        q, v = reader.read(decoder.decode(serialize_message(message)))
        assert q.tolist() == [0.1, 0.2]
        assert v is None
    message.velocity = array.array('d', [1.0, 2.0, 3.0])
    q, v = reader.read(decoder.decode(serialize_message(message)))
    assert v.tolist() == [1.0, 2.0]


JOINTS = ('a', 'b', 'c')
VALUES = st.floats(allow_nan=True, allow_infinity=True)


@given(st.dictionaries(st.sampled_from((*JOINTS, 'd')), VALUES))
def test_tolerances_are_given_kept_erased_or_refused_by_name(given):
    defaults = np.array([0.1, np.inf, 0.3])
    is_legal = all(value == -1.0 or 0.0 <= value < np.inf for value in given.values())
    if 'd' not in given and is_legal:
        found = with_given('path_tolerance.position', given, defaults, JOINTS)
        for name, value, default in zip(JOINTS, found, defaults):
            meaning = {0.0: default, -1.0: np.inf}
            assert value == meaning.get(given.get(name, 0.0), given.get(name, 0.0))
        return
    with pytest.raises(InvalidInputError) as error:
        with_given('path_tolerance.position', given, defaults, JOINTS)
    assert 'path_tolerance.position' in str(error.value)
    wrong = [name for name, value in given.items()
             if name == 'd' or not (value == -1.0 or 0.0 <= value < np.inf)]
    assert any(repr(name) in str(error.value) for name in wrong)
    assert isinstance(error.value, JointNamesError) == ("tolerance for 'd'" in str(error.value))
