# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Plans from `~/retime_trajectory`, executed by `~/follow_joint_trajectory` of the same node."""

from action_clients import Client, seconds
from closed_loop import closed_loop
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robots import arm_without_gripper, robot_urdf
from ros_harness import LONG
from sensor_msgs.msg import JointState
from service_bench import Served
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DEFAULTS = {
    'condition_references': True, 'scale_gains': True, 'effort_rate_limit': 0.0,
    'overspeed_factor': 1.2}
TOLERANCE = 0.05
"""[rad] from the reference."""


@pytest.mark.parametrize('name', ['default', 'ur10', 'panda'])
def test_retimed_plans_succeed_also_after_a_preemption(client, name):
    arm = arm_without_gripper(name)
    names, n = list(arm.joint_names), arm.joint_count
    limit = arm.limits.effort
    rotors = np.where(np.isfinite(limit), limit / 500.0, 0.01).tolist()
    start = np.array([
        0.5 * (low + high) if np.isfinite([low, high]).all() else 0.3
        for low, high in zip(arm.limits.lower, arm.limits.upper)])
    of_both = {'robot_description': robot_urdf(name), 'joints': names,
               'actuator.reflected_inertia': rotors}
    namespace, rng = f'/plans_{name}', np.random.default_rng(4)
    with closed_loop(
            namespace, {**DEFAULTS, **of_both}, rate=500.0, initial_position=start.tolist(),
            **of_both):
        client.wait_for(JointState, f'{namespace}/dynamics/reference')
        action, node = Client(client, namespace), Served(client, namespace, arm)
        tolerances = [JointTolerance(name=one, position=TOLERANCE) for one in names]
        here = start
        for k in range(4):
            way = [np.clip(start + rng.uniform(-0.6, 0.6, n), arm.limits.lower + 0.05,
                           arm.limits.upper - 0.05) for _ in range(2)]
            path = make_trajectory(names, [0.0, 1.0, 2.0], [here, *way])
            plan = node.answer(
                'retime_trajectory', trajectory=trajectory_to_ros(path), corner_tolerance=0.05,
                effort_limit_fraction=0.8).trajectory
            sent = action.send(FollowJointTrajectory.Goal(
                trajectory=plan, path_tolerance=tolerances))
            if k == 2:
                back = action.send(FollowJointTrajectory.Goal(trajectory=JointTrajectory(
                    joint_names=names, points=[JointTrajectoryPoint(
                        positions=start.tolist(), time_from_start=seconds(0.5))])))
                status, code, message = sent.result(LONG)
                assert message.startswith('another goal has replaced this one'), (code, message)
                sent, way = back, [start]
            status, code, message = sent.result(LONG)
            assert code == FollowJointTrajectory.Result.SUCCESSFUL, (k, status, code, message)
            here = way[-1]
