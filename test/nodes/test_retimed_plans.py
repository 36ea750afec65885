# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Plans from `~/retime_trajectory`, executed by `~/follow_joint_trajectory` of the same node."""

from action_clients import Client, seconds
from closed_loop import closed_loop
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from lock_step_loop import middle
import numpy as np
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robots import arm_without_gripper, robot_urdf
from ros_harness import LONG
from sensor_msgs.msg import JointState
from service_bench import Served
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def test_retimed_plans_succeed_also_after_a_preemption(client):
    arm = arm_without_gripper('ur10')
    names, n = list(arm.joint_names), arm.joint_count
    start = middle(arm, 0.3)
    of_both = {'robot_description': robot_urdf('ur10'), 'joints': names,
               'actuator.reflected_inertia': (arm.limits.effort / 500.0).tolist()}
    namespace, rng = '/plans', np.random.default_rng(4)
    with closed_loop(
            namespace, of_both, rate=250.0, initial_position=start.tolist(),
            **of_both):
        client.wait_for(JointState, f'{namespace}/dynamics/reference')
        action, node = Client(client, namespace), Served(client, namespace, arm)
        tolerances = [JointTolerance(name=one, position=0.05) for one in names]
        here = start
        for k in range(3):
            way = [np.clip(start + rng.uniform(-0.6, 0.6, n), arm.limits.lower + 0.05,
                           arm.limits.upper - 0.05) for _ in range(2)]
            path = make_trajectory(names, [0.0, 1.0, 2.0], [here, *way])
            plan = node.answer(
                'retime_trajectory', trajectory=trajectory_to_ros(path), corner_tolerance=0.05,
                effort_limit_fraction=0.8).trajectory
            sent = action.send(FollowJointTrajectory.Goal(
                trajectory=plan, path_tolerance=tolerances))
            if k == 1:
                back = action.send(FollowJointTrajectory.Goal(trajectory=JointTrajectory(
                    joint_names=names, points=[JointTrajectoryPoint(
                        positions=start.tolist(), time_from_start=seconds(0.5))])))
                status, code, message = sent.result(LONG)
                assert message.startswith('another goal has replaced this one'), (code, message)
                sent, way = back, [start]
            status, code, message = sent.result(LONG)
            assert code == FollowJointTrajectory.Result.SUCCESSFUL, (k, status, code, message)
            here = way[-1]
