# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics task_space`: pose, Jacobian, inertia and forces at a point of a link."""

from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point
import numpy as np
from robot_dynamics.validation import LARGEST_VALUE
from robot_dynamics_interfaces.srv import TaskSpace
from robot_dynamics_tools.reporting.text_table import matrix_table, text_table
from robot_dynamics_tools.ros2_dynamics.answers import Answer, Units, warning_lines
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics_tools.ros2_dynamics.joint_arguments import joint_values
from robot_dynamics_tools.ros2_dynamics.motion_watch import MotionWatch

AXES = ('x', 'y', 'z', 'rx', 'ry', 'rz')
MATRICES = {'jacobian': (6, -1), 'inverse_inertia': (6, 6), 'inertia': (6, 6),
            'dynamic_inverse': (-1, 6), 'lost_directions': (-1, 6)}
VECTORS = ('bias_acceleration', 'gravity_force', 'coriolis_force', 'translation_singular_values',
           'rotation_singular_values')
SCALARS = ('rank', 'translation_manipulability', 'rotation_manipulability')


def answer_task_space(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return task space at a position, by default the measured one."""
    names = client.joint_names()
    position = joint_values('position', arguments.position, names) if arguments.position else (
        _measured_position(client, names))
    velocity = joint_values('velocity', arguments.velocity, names, 0.0) if (
        arguments.velocity) else []
    x, y, z = arguments.point
    response = client.call(TaskSpace, 'task_space', TaskSpace.Request(
        frame=arguments.frame, point=Point(x=x, y=y, z=z), reference=arguments.reference,
        joint_names=names, position=position, velocity=velocity))
    pose, = response.pose
    place, turn = pose.position, pose.orientation
    data: dict[str, Any] = {
        'node': client.name, 'frame': arguments.frame, 'point': arguments.point,
        'reference': arguments.reference, 'joint_names': names, 'position': position,
        'velocity': velocity, 'translation': [place.x, place.y, place.z],
        'orientation': [turn.x, turn.y, turn.z, turn.w],
        **{name: np.reshape(getattr(response, name), shape).tolist()
           for name, shape in MATRICES.items()},
        **{name: list(getattr(response, name)) for name in VECTORS},
        **{name: getattr(response, name)[0] for name in SCALARS},
        'warnings': list(response.warnings)}
    data['position_margin'] = [
        margin if margin < LARGEST_VALUE else None for margin in response.position_margin]
    units = Units.of(names, {} if arguments.json else client.joint_kinds())
    return Answer(data, '\n\n'.join([*_blocks(data, units), *warning_lines(response.warnings)]))


def _blocks(data: dict[str, Any], units: Units) -> list[str]:
    names, rank = data['joint_names'], data['rank']
    vectors = [data[name] for name in ('bias_acceleration', 'gravity_force', 'coriolis_force')]
    rows = [[axis, *row, *values] for axis, row, *values in zip(AXES, data['jacobian'], *vectors)]
    singular = [
        [part, *data[f'{part}_singular_values'], data[f'{part}_manipulability']]
        for part in ('translation', 'rotation')]
    blocks = [
        f'{data["frame"]}, point {_listed(data["point"])} m, axes {data["reference"]}\n'
        f'position {_listed(data["translation"])} m, quaternion xyzw '
        f'{_listed(data["orientation"])}',
        'Jacobian, bias acceleration [m/s², rad/s²], forces [N, N·m]\n' + text_table(
            ['', *names, 'dJ/dt dq/dt', 'gravity', 'Coriolis'], rows, left_columns=1),
        'Inertia Λ [kg, kg·m, kg·m²]' + (', the pseudo-inverse of Λ⁻¹' if rank < 6 else '') + '\n'
        + matrix_table('', AXES, np.array(data['inertia'])),
        'Singular values of the Jacobian\n' + text_table(
            ['', 'largest', '', 'smallest', 'manipulability'], singular, left_columns=1),
        'Distance to the nearest position limit\n' + units.table(
            names, {f'margin [{units.position}]': [
                'no limit' if margin is None else margin for margin in data['position_margin']]})]
    if rank < 6:
        blocks.append(f'Rank {rank} of 6. Lost directions\n' + text_table(
            AXES, data['lost_directions'], left_columns=0))
    return blocks


def _listed(values: Sequence[float]) -> str:
    return f'({", ".join(f"{value + 0.0:.4f}" for value in values)})'


def _measured_position(client: DynamicsClient, names: Sequence[str]) -> list[float]:
    watch = MotionWatch(client, names, [''] * len(names))
    with watch.following():
        watch.wait_measured()
    return watch.measured()
