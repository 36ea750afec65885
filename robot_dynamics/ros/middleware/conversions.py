# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Conversion between messages and arrays: `*_from_ros` checks messages, `*_to_ros` fills messages.

Numbers are converted as whole arrays: a message's float64[] is an array.array, which numpy reads
in place, and which can be filled with the bytes of a numpy array.
"""

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import InertiaStamped, Point, Pose, Quaternion, Vector3, WrenchStamped
import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import EffortTerms
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.joint_order import JointOrder
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.task_space.state import TaskSpaceState
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.urdf.pinocchio_xml import INERTIA_ENTRIES
from robot_dynamics.validation import check_vector, LARGEST_VALUE
from robot_dynamics_interfaces.msg import DynamicsTerms
from robot_dynamics_interfaces.srv import TaskSpace
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint


def floats_to_ros(values: FloatArray) -> array:  # type: ignore[type-arg]
    """Return a message's float64[] of an array of any shape, row by row."""
    numbers = array('d')
    numbers.frombytes(np.ascontiguousarray(values, np.float64).reshape(-1).view(np.uint8))
    return numbers


def stamp_from_ros(stamp: Time) -> int:
    """Return the nanoseconds of a time stamp."""
    return int(stamp.sec) * NANOSECONDS_PER_SECOND + int(stamp.nanosec)


def stamp_to_ros(nanoseconds: int) -> Time:
    """Return the time stamp of nanoseconds since the epoch."""
    sec, nanosec = divmod(nanoseconds, NANOSECONDS_PER_SECOND)
    return Time(sec=sec, nanosec=nanosec)


def wrenches_from_ros(arm: ArmModel, messages: Sequence[WrenchStamped]) -> list[ExternalWrench]:
    """Return checked wrenches; raise InvalidInputError on an unknown link or an invalid number."""
    wrenches = []
    for i, message in enumerate(messages):
        field = f'external_wrenches[{i}].'
        arm.link_frame(message.header.frame_id, f'{field}header.frame_id')
        wrenches.append(wrench_from_ros(message, field))
    return wrenches


def wrench_from_ros(message: WrenchStamped, field: str) -> ExternalWrench:
    """Return a wrench with checked numbers; `field` precedes their names in errors."""
    return ExternalWrench(
        message.header.frame_id,
        _vector_from_ros(f'{field}wrench.force', message.wrench.force),
        _vector_from_ros(f'{field}wrench.torque', message.wrench.torque))


def _vector_from_ros(field: str, vector: Vector3) -> FloatArray:
    return check_vector(
        field, (vector.x, vector.y, vector.z), 3, ('x', 'y', 'z'), LARGEST_VALUE)


def payload_from_ros(arm: ArmModel | None, message: InertiaStamped) -> Payload | None:
    """
    Return a checked payload, or None for m = 0, which removes it; raise InvalidInputError.

    Without an arm, the link is not checked.
    """
    inertia = message.inertia
    payload = make_payload(
        message.header.frame_id, inertia.m, (inertia.com.x, inertia.com.y, inertia.com.z),
        [[inertia.ixx, inertia.ixy, inertia.ixz],
         [inertia.ixy, inertia.iyy, inertia.iyz],
         [inertia.ixz, inertia.iyz, inertia.izz]])
    if payload.mass == 0.0:
        return None
    if arm is not None:
        arm.link_frame(payload.link, 'payload.header.frame_id')
    return payload


def payload_to_ros(payload: Payload | None) -> InertiaStamped:
    """Return the message of a payload; without a payload, a message with m = 0."""
    message = InertiaStamped()
    if payload is None:
        return message
    message.header.frame_id = payload.link
    inertia, tensor = message.inertia, payload.inertia
    inertia.m = payload.mass
    inertia.com.x, inertia.com.y, inertia.com.z = payload.com.tolist()
    for entry, value in zip(INERTIA_ENTRIES, tensor[np.triu_indices(3)].tolist()):
        setattr(inertia, entry, value)
    return message


def terms_to_ros(
    terms: EffortTerms, joint_names: Sequence[str], stamp: Time, order: JointOrder | None = None,
) -> DynamicsTerms:
    """Return the message of efforts by term, in the order of `order` if it is given."""
    message = DynamicsTerms(
        joint_names=list(joint_names),
        kinetic_energy=terms.kinetic_energy, potential_energy=terms.potential_energy)
    message.header.stamp = stamp
    for name in ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort'):
        value = getattr(terms, name)
        setattr(message, name, floats_to_ros(order.answer(value) if order else value))
    return message


def trajectory_from_ros(message: JointTrajectoryMsg, joint_names: Sequence[str]) -> (
        JointTrajectory):
    """Return the trajectory in the order of joint_names; raise TrajectoryError."""
    points = message.points
    return make_trajectory(
        message.joint_names,
        [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points],
        [point.positions for point in points],
        [point.velocities for point in points],
        [point.accelerations for point in points],
        joint_names)


def trajectory_to_ros(
    trajectory: JointTrajectory, order: JointOrder | None = None,
) -> JointTrajectoryMsg:
    """Return the message of a trajectory, which starts on arrival, in `order` if it is given."""
    names = order.names if order else trajectory.joint_names
    message = JointTrajectoryMsg(joint_names=list(names))
    for point in trajectory.points:
        position, velocity, acceleration = (
            [] if values is None else floats_to_ros(order.answer(values) if order else values)
            for values in (point.position, point.velocity, point.acceleration))
        entry = JointTrajectoryPoint(
            positions=position, velocities=velocity, accelerations=acceleration)
        nanoseconds = round(point.time_from_start * NANOSECONDS_PER_SECOND)
        entry.time_from_start.sec, entry.time_from_start.nanosec = divmod(
            nanoseconds, NANOSECONDS_PER_SECOND)
        message.points.append(entry)
    return message


def with_efforts(message: JointTrajectoryMsg, efforts: FloatArray) -> JointTrajectoryMsg:
    """Fill in the efforts (points, n) of a trajectory message, in its own joint order."""
    for point, effort in zip(message.points, efforts):
        point.effort = floats_to_ros(effort)
    return message


TASK_SPACE_ARRAYS = (
    'bias_acceleration', 'inverse_inertia', 'inertia', 'gravity_force', 'coriolis_force',
    'translation_singular_values', 'rotation_singular_values', 'translation_manipulability',
    'rotation_manipulability')
"""Fields of TaskSpace that are no arrays over joints, with the names of TaskSpaceState."""


def add_task_space(
    response: TaskSpace.Response, states: TaskSpaceState, order: JointOrder,
) -> None:
    """
    Append many states to a response, with the joints in the order of a request.

    The margin of a joint without limits is LARGEST_VALUE, because numbers in messages are finite.
    """
    for translation, rotation in zip(states.translation, states.rotation):
        x, y, z, w = pin.Quaternion(rotation).coeffs().tolist()
        response.pose.append(Pose(
            position=Point(**dict(zip('xyz', translation.tolist()))),
            orientation=Quaternion(x=x, y=y, z=z, w=w)))
    inverse = np.swapaxes(order.answer(np.swapaxes(states.dynamic_inverse, 1, 2)), 1, 2)
    kept = np.arange(6) < states.rank[:, np.newaxis]
    arrays = {
        'jacobian': order.answer(states.jacobian), 'dynamic_inverse': inverse,
        'position_margin': np.minimum(order.answer(states.position_margin), LARGEST_VALUE),
        'lost_directions': states.directions[~kept],
        **{name: getattr(states, name) for name in TASK_SPACE_ARRAYS}}
    for name, values in arrays.items():
        getattr(response, name).extend(floats_to_ros(values))
    response.rank.extend(states.rank.tolist())
