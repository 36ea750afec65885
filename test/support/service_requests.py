# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The services of `dynamics`, and requests that each of them must reject."""

import math
from typing import Any

from disturbances import wrench
from geometry_msgs.msg import Point
from robot_dynamics.model.payload import make_payload
from robot_dynamics.ros.middleware.conversions import payload_to_ros
from robot_dynamics_interfaces import srv
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAN = float('nan')
SERVICES: dict[str, Any] = {
    name: getattr(srv, name.title().replace('_', '')) for name in (
        'inverse_dynamics', 'inverse_dynamics_batch', 'inverse_dynamics_trajectory',
        'retime_trajectory', 'forward_dynamics', 'manipulator_equation', 'task_space',
        'set_payload')}
Q = (math.pi / 4, math.pi / 6)

BAD_STATES: list[tuple[dict[str, Any], str]] = [
    ({}, 'position has 0 values, expected 2'),
    ({'position': [1.0, NAN]}, r'position\[1\] \(joint2\) is nan'),
    ({'position': Q, 'velocity': [float('inf'), 0.0]}, r'velocity\[0\] \(joint1\) is inf'),
    ({'position': Q, 'joint_names': ['joint1']}, r"joint_names leaves out \['joint2'\]"),
]
WITH_EFFORT = {'effort': [0.0, 0.0]}
REFUSALS: list[tuple[str, dict[str, Any], str]] = [
    *(('inverse_dynamics', fields, words) for fields, words in BAD_STATES),
    *(('manipulator_equation', fields, words) for fields, words in BAD_STATES),
    *(('forward_dynamics', {**WITH_EFFORT, **fields}, words) for fields, words in BAD_STATES),
    ('forward_dynamics', {'position': Q}, 'effort has 0 values'),
    ('forward_dynamics', {'position': Q, 'effort': [NAN, 0.0]}, r'effort\[0\] \(joint1\) is nan'),
    ('inverse_dynamics', {'position': Q, 'acceleration': [0.0] * 3}, 'acceleration has 3 values'),
    ('inverse_dynamics',
     {'position': Q, 'external_wrenches': [wrench('hand')]},
     r"external_wrenches\[0\]\.header\.frame_id is 'hand', expected one of the links"),
    ('inverse_dynamics',
     {'position': Q, 'external_wrenches': [wrench('tool0', (NAN, 0, 0))]},
     r'external_wrenches\[0\]\.wrench\.force\[0\] \(x\) is nan'),
    ('inverse_dynamics_batch', {'position': [1.0] * 3}, 'position has 3 values, expected samples'),
    ('inverse_dynamics_batch', {'position': [1.0] * 4, 'velocity': [1.0] * 2},
     'velocity has 1 samples, expected 2'),
    ('inverse_dynamics_batch', {'position': [1.0, 1.0, NAN, 1.0]}, r'position\[1\]\[0\]'),
    ('inverse_dynamics_trajectory', {}, 'points is empty'),
    ('inverse_dynamics_trajectory', {'trajectory': JointTrajectory(
        joint_names=['joint1', 'joint2'], points=[
            JointTrajectoryPoint(positions=[0.0, 0.0]),
            JointTrajectoryPoint(positions=[0.0, 0.0])])}, r'points\[1\]\.time_from_start'),
    ('task_space', {'position': Q, 'frame': 'hand'},
     r"frame is 'hand', expected one of the links \[.*'tool0'\]"),
    ('task_space', {'position': Q, 'frame': 'tool0', 'reference': 'world'},
     r"reference is 'world', expected one of \['base_aligned', 'local'\]"),
    ('task_space', {'position': Q, 'frame': 'tool0', 'point': Point(y=NAN)},
     r'point\[1\] \(y\) is nan'),
    ('task_space', {'frame': 'tool0'}, 'position has 0 values, expected samples'),
    ('task_space', {'position': Q, 'velocity': [1.0] * 4, 'frame': 'tool0'},
     'velocity has 2 samples, expected 1'),
    ('set_payload', {'payload': payload_to_ros(make_payload('hand', 1.0))},
     r"payload\.header\.frame_id is 'hand'"),
    ('set_payload', {'transition_time': -1.0}, 'transition_time is -1, expected'),
]
"""Service, fields of the request, and a pattern of the response message."""
