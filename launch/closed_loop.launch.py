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
The closed loop without hardware: `simulated_arm`, `dynamics_node` and `robot_state_publisher`.

ros2 launch robot_dynamics closed_loop.launch.py [robot:=FILE.urdf] [params:=FILE.yaml] [tf:=false]
`ros2 launch robot_dynamics closed_loop.launch.py --show-args` describes all arguments.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from robot_dynamics.ros.launch_actions import (
    arm_arguments,
    CLOSED_LOOP,
    closed_loop,
    declared,
    is_true,
    state_publisher,
)

from launch import LaunchDescription


def _nodes(context, *_):
    arm = arm_arguments(context, CLOSED_LOOP)
    transforms = [state_publisher(arm)] if is_true(context, 'tf') else []
    return [*closed_loop(arm), *transforms]


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the planar two-link arm'),
        DeclareLaunchArgument(
            'tf', default_value='true',
            description='Whether robot_state_publisher is started as well, for RViz.'),
        OpaqueFunction(function=_nodes),
    ])
