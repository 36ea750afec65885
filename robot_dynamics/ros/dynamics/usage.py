# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The `--help` text of the node `dynamics`."""

from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.node_arguments import NodeUsage

USAGE = NodeUsage(
    'dynamics_node', 'dynamics',
    'Gravity compensation, computed torque and dynamics services for the arm of a URDF. The node '
    'computes one command for each joint state that it receives, and publishes it unless '
    '`command` has the value none. By default it holds the arm from the first joint state on.',
    (('', 'Use the planar two-link arm, as simulated_arm does without arguments.'),
     ('--ros-args -p robot_description_file:=arm.urdf -p command:=none',
      'Use the arm in arm.urdf and publish no command: the first start with a robot.'),
     ('--ros-args --params-file arm.yaml -r joint_states:=/arm/joint_states',
      'Read the parameters from arm.yaml, and the joint states from another topic.')),
    SPECS,
    ('robot_description_file', 'joints', 'gravity', 'command', 'gains.natural_frequency',
     'gains.damping_ratio', 'effort_scale', 'measured_effort', 'robot_compensates',
     'fault_action', 'state_timeout', 'state_max_age', 'autostart'),
    (('joint_states', 'Subscribed, sensor_msgs/msg/JointState: measured positions, velocities '
      'and efforts, matched by joint name.'),
     ('robot_description', 'Subscribed, std_msgs/msg/String: the URDF, if neither '
      'robot_description nor robot_description_file is set.'),
     ('~/joint_trajectory', 'Subscribed, trajectory_msgs/msg/JointTrajectory: the trajectory to '
      'follow; one point is a set-point.'),
     ('effort_command, ~/commands', 'Published, sensor_msgs/msg/JointState and '
      'std_msgs/msg/Float64MultiArray: the command [N·m] or [N], by joint name, and in the order '
      'of joints.'),
     ('~/gravity_compensation, ~/computed_torque', 'Published, sensor_msgs/msg/JointState: the '
      'results of both control laws, also with `command: none`.'),
     ('/diagnostics', 'Published, diagnostic_msgs/msg/DiagnosticArray: joint states, command, '
      'faults, reference, payload and model.'),
     ('~/stop, ~/reset_fault', 'Services, std_srvs/srv/Trigger: stop the arm and hold its '
      'position; reset a latched fault.'),
     ('~/set_payload', 'Service, robot_dynamics_interfaces/srv/SetPayload: set the load on a '
      'link.')))
