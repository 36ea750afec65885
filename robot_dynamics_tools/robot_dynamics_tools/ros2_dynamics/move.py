# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics move`, `pose`: publish a goal, wait until the arm rests, report the errors."""

from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
import math

from geometry_msgs.msg import PoseStamped
import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.tools.command_line import INTERRUPTED
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.ros2_dynamics.answers import Answer, Units
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics_tools.ros2_dynamics.joint_arguments import joint_values
from robot_dynamics_tools.ros2_dynamics.motion_watch import (
    goal_publication,
    MotionWatch,
    publication,
)
from std_srvs.srv import Trigger

UNLIMITED_DURATION = 2.0
"""[s] that the motion of a joint takes that has no velocity limit, or longer."""
FAR = 0.01
"""[rad] or [m] from the goal at which a joint has not reached it."""


def answer_move(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Move the arm, and return the position that it reached."""
    if arguments.velocity and arguments.duration is not None:
        raise InvalidInputError('--duration is given with --velocity, expected one of the two')
    names = client.joint_names()
    joints = client.joints()
    kinds = {name: joint.kind for name, joint in joints.items()}
    watch = MotionWatch(client, names, [kinds.get(name, '') for name in names])
    with watch.following():
        watch.wait_ready()
        goal = joint_values('position', arguments.position, names, watch.position)
        limits = {name: joint.velocity_limit for name, joint in joints.items()}
        duration = _duration(arguments, names, limits, watch.error(goal, watch.measured()))
        with goal_publication(client, names) as publish:
            return _follow(
                watch, kinds, lambda: watch.wait_taken(goal, lambda: publish(goal, duration)),
                arguments.no_wait, duration)


def answer_pose(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Move the frame of the node to a pose, and return the position that the joints reached."""
    from robot_dynamics.urdf.parser import parse_urdf
    names, kinds = client.joint_names(), client.joint_kinds()
    message = PoseStamped()
    message.header.frame_id = arguments.frame_id or parse_urdf(client.description()).root_link
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = arguments.translation
    turn.x, turn.y, turn.z, turn.w = [0.0] * 4 if not arguments.rpy else pin.Quaternion(
        pin.rpy.rpyToMatrix(*arguments.rpy)).coeffs().tolist()
    watch = MotionWatch(client, names, [kinds.get(name, '') for name in names])
    with watch.following(), publication(client, PoseStamped, '~/pose_reference') as publish:
        watch.wait_ready()
        return _follow(
            watch, kinds, lambda: watch.wait_taken(None, lambda: publish(message)),
            arguments.no_wait)


def _follow(
    watch: MotionWatch, kinds: Mapping[str, str], take: Callable[[], Sequence[float]],
    no_wait: bool, duration: float = 0.0,
) -> Answer:
    """
    Wait until the node has taken a goal, and until the arm rests; an interrupt stops the arm.

    `take` returns the goal; `duration` [s] is that of the motion, 0 if unknown.
    """
    client, start_ns = watch.client, watch.position_ns
    try:
        goal = take()
        data = {'node': client.name, 'joint_names': watch.names, 'goal': list(goal),
                'duration': duration}
        if no_wait:
            of = f' of {duration:.2f} s' if duration else ''
            return Answer(data, f'{client.name} follows a motion{of}')
        with Progress(duration, 's') as progress:
            watch.wait_end(goal, progress.update if duration else lambda _: None)
        end_ns, is_at_rest = watch.wait_rest()
    except KeyboardInterrupt:
        report = client.call(Trigger, 'stop', Trigger.Request()).message
        return Answer(
            {'node': client.name, 'interrupted': True, 'stop': report},
            f'{client.name}: interrupted, called ~/stop: {report}', INTERRUPTED)
    names, position, seconds = watch.names, watch.measured(), 1e-9 * (end_ns - start_ns)
    error, units = watch.error(goal, position), Units.of(names, kinds)
    away = [name for name, one in zip(names, np.abs(error)) if one > FAR]
    data |= {'time': seconds, 'at_rest': is_at_rest, 'position': position, 'error': error.tolist()}
    text = (f'{client.name}: {"at rest" if is_at_rest else "still moving"} after {seconds:.2f} s'
            + (f', {", ".join(away)} not at the goal' if away else ''))
    return Answer(
        data, f'{text}\n' + units.table(names, {
            f'goal [{units.position}]': _cells(goal),
            f'reached [{units.position}]': _cells(np.subtract(goal, error)),
            f'error [{units.error}]': _cells(1e3 * error)}),
        1 if away or not is_at_rest else 0)


def _cells(values: Iterable[float]) -> list[str]:
    return [f'{round(value, 4) + 0.0:.4f}' for value in values]  # no -0.0000


def _duration(
    arguments: Namespace, names: Sequence[str], limits: Mapping[str, float],
    distance: FloatArray,
) -> float:
    """Return the duration [s] of the motion, given or from the velocities of the joints."""
    from robot_dynamics_tools.excitation.demo_motion import LIMIT_FRACTION, rest_to_rest_seconds
    if arguments.duration is not None:
        return check_scalar('--duration', arguments.duration, 0.0, exclusive_minimum=True)
    velocity = LIMIT_FRACTION * np.array([limits.get(name, math.inf) for name in names])
    if arguments.velocity:
        given = joint_values(
            'velocity', arguments.velocity, names, dict(zip(names, velocity.tolist())))
        velocity = np.array([
            check_scalar(f'velocity of {name}', value, 0.0, exclusive_minimum=True)
            if math.isfinite(value) else value for name, value in zip(names, given)])
    seconds = rest_to_rest_seconds(distance, velocity)
    is_unlimited = bool((~np.isfinite(velocity) & (distance != 0.0)).any())
    return max(seconds, UNLIMITED_DURATION) if is_unlimited else seconds
