# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics retime`: the fastest timing of a trajectory file."""

from argparse import Namespace
from collections import Counter

from robot_dynamics.ros.middleware.conversions import trajectory_from_ros, trajectory_to_ros
from robot_dynamics.tools import command_line
from robot_dynamics.trajectories.files import read_trajectory, write_trajectory
from robot_dynamics_interfaces.srv import RetimeTrajectory
from robot_dynamics_tools.reporting.text_table import text_table
from robot_dynamics_tools.ros2_dynamics.answers import Answer
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics_tools.ros2_dynamics.joint_arguments import joint_values


def answer_retime(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Retime a trajectory in a file, and write the result to another one."""
    if arguments.output is not None:
        command_line.prepare_file(arguments.output, arguments.force)
    names = client.joint_names()
    trajectory = read_trajectory(arguments.file, names)
    limits = joint_values('acceleration', arguments.acceleration, names) if (
        arguments.acceleration) else []
    response = client.call(RetimeTrajectory, 'retime_trajectory', RetimeTrajectory.Request(
        trajectory=trajectory_to_ros(trajectory), method=arguments.method,
        corner_tolerance=arguments.corner_tolerance, acceleration_limits=limits,
        effort_limit_fraction=arguments.effort_limit_fraction,
        efforts_may_jump=arguments.efforts_may_jump))
    points = len(response.trajectory.points)
    shares = Counter(zip(response.limiting_joint, response.limited_quantity)).most_common()
    rows = [[joint, quantity, f'{100.0 * count / points:.1f} %']
            for (joint, quantity), count in shares]
    data = {
        'node': client.name, 'duration': response.duration, 'ratio': response.ratio,
        'points': points, 'warnings': list(response.warnings),
        'limiting': [{'joint': joint, 'quantity': quantity, 'points': count}
                     for (joint, quantity), count in shares]}
    lines = [f'{client.name}: {response.message}',
             text_table(['joint', 'closest to its limit', 'share of the points'], rows),
             *(f'warning: {warning}' for warning in response.warnings)]
    if arguments.output is not None:
        with command_line.writing(arguments.output) as new:
            write_trajectory(new, trajectory_from_ros(response.trajectory, names))
        data['output'] = str(arguments.output)
        lines.append(f'{points} points are written to {arguments.output}')
    return Answer(data, '\n'.join(lines))
