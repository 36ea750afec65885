# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The closed loop in MuJoCo: `mujoco_arm` and `dynamics_node`.

ros2 launch robot_dynamics_tools mujoco_arm.launch.py mjcf:=FILE.xml robot:=FILE.urdf
`ros2 launch robot_dynamics_tools mujoco_arm.launch.py --show-args` describes all arguments.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from robot_dynamics.ros.launch_actions import arm_of, declared, node

from launch import LaunchDescription


def _nodes(context, *_):
    mjcf = LaunchConfiguration('mjcf').perform(context)
    arm = arm_of(context, 'mujoco_arm', 'dynamics')
    mujoco_arm = node(
        arm, 'mujoco_arm', package='robot_dynamics_tools', **({'mjcf': mjcf} if mjcf else {}))
    return [mujoco_arm, node(arm, 'dynamics')]


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the planar two-link arm'),
        DeclareLaunchArgument(
            'mjcf', default_value='',
            description='MJCF file of the arm and its surroundings. Empty: as in the parameter '
                        'file, otherwise the planar two-link arm.'),
        OpaqueFunction(function=_nodes),
    ])
