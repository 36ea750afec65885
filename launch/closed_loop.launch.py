# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The closed loop without hardware: `simulated_arm`, `dynamics_node` and `robot_state_publisher`.

ros2 launch robot_dynamics closed_loop.launch.py [robot:=FILE.urdf] [params:=FILE.yaml] [tf:=false]
`ros2 launch robot_dynamics closed_loop.launch.py --show-args` describes all arguments.
"""

from launch.actions import OpaqueFunction
from robot_dynamics.ros.launch_actions import (
    arm_of,
    declared,
    is_true,
    node,
    state_publisher,
    switch,
)

from launch import LaunchDescription


def _nodes(context, *_):
    arm = arm_of(context, 'simulated_arm', 'dynamics')
    transforms = [state_publisher(arm)] if is_true(context, 'tf') else []
    # other packages first: if one is missing, launch leaves running what it has started
    return [*transforms, node(arm, 'simulated_arm'), node(arm, 'dynamics')]


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the planar two-link arm'),
        switch('tf', 'Whether robot_state_publisher is started as well, for RViz.'),
        OpaqueFunction(function=_nodes),
    ])
