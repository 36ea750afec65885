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
The closed loop in MuJoCo: `mujoco_arm` and `dynamics_node`.

ros2 launch robot_dynamics mujoco_arm.launch.py mjcf:=FILE.xml robot:=FILE.urdf [params:=FILE.yaml]
`ros2 launch robot_dynamics mujoco_arm.launch.py --show-args` describes all arguments.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from robot_dynamics.ros.launch_actions import arm_arguments, declared, MUJOCO_LOOP, mujoco_loop

from launch import LaunchDescription


def _nodes(context, *_):
    mjcf = LaunchConfiguration('mjcf').perform(context)
    return mujoco_loop(arm_arguments(context, MUJOCO_LOOP), mjcf)


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the planar two-link arm'),
        DeclareLaunchArgument(
            'mjcf', default_value='',
            description='MJCF file of the arm and its surroundings. Empty: as in the parameter '
                        'file, otherwise the planar two-link arm.'),
        OpaqueFunction(function=_nodes),
    ])
