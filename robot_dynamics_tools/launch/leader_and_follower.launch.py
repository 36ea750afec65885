# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A leader arm in hand guiding, and a follower whose external effort the leader feels.

ros2 launch robot_dynamics_tools leader_and_follower.launch.py robot:=FILE.urdf
For robots that are already running in the namespaces leader and follower: simulated:=false
"""

from launch.actions import OpaqueFunction
from robot_dynamics.ros.launch_actions import arm_of, declared, is_true, node, switch

from launch import LaunchDescription

LEADER, FOLLOWER = 'leader', 'follower'


def _nodes(context, *_):
    simulated = ('simulated_arm',) if is_true(context, 'simulated') else ()
    given = dict(context.launch_configurations)
    leader, follower = (
        arm_of(context, *simulated, 'dynamics', values={**given, 'namespace': name})
        for name in (LEADER, FOLLOWER))
    effort = f'/{FOLLOWER}/dynamics_monitor/external_effort'
    felt = [('~/force_feedback', effort), ('~/force_feedback_deviation', f'{effort}_deviation')]
    led = [('~/set_point', f'/{LEADER}/joint_states')]
    return [
        *(node(arm, name) for arm in (leader, follower) for name in simulated),
        node(leader, 'dynamics', felt, command='hand_guiding'), node(follower, 'dynamics', led),
        node(follower, 'dynamics_monitor', package='robot_dynamics_tools')]


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the planar two-link arm', namespace=None),
        switch('simulated', 'true: simulated_arm is started for both arms; false: the robots are '
               'running, and dynamics_node is started for each, and the monitor of the follower.'),
        OpaqueFunction(function=_nodes),
    ])
