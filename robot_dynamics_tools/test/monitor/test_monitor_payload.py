# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/estimate_payload` on running nodes: a payload that only the simulated arm has."""

import math
from typing import Any

from builtin_interfaces.msg import Duration
from closed_loop import closed_loop, NAMES
from disturbances import set_payload
from geometry_msgs.msg import InertiaStamped
from held_robot import monitored
import numpy as np
import pytest
from robot_dynamics.model import load_arm, make_payload, RigidBody
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_interfaces.srv import EstimatePayload
from ros_harness import LONG, RosClient, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

START = np.array([0.8, 0.5])
ROBOT = {
    'joints': NAMES, 'friction.viscous': [1.5, 0.5], 'friction.coulomb': [1.0, 0.5],
    'effort.command_scale': [0.8, 1.2], 'effort.command_offset': [0.5, -0.3],
    'effort.report_scale': [0.8, 1.2], 'effort.report_offset': [0.5, -0.3]}
CALIBRATED = [1e-6, 0.0, 1e-6, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4]
LOAD = make_payload('tool0', 2.0, (0.05, 0.0, 0.1))
SECONDS = 8
HOLDS = ((10, 0.2), (11, 0.0), (13, 0.0), (14, -0.2), (15, 0.0), (17, 0.0))
"""Times [s] and distances [rad] from START of a hold from either direction."""


def swing() -> JointTrajectory:
    """Return sines around START, and two holds there."""
    points = []
    for t in np.arange(0.0, SECONDS + 0.1, 0.25).tolist():
        phase = 2.0 * math.pi * np.array([0.25, 0.375]) * t
        rate = 2.0 * math.pi * np.array([0.25, 0.375])
        points.append(JointTrajectoryPoint(
            positions=START + 0.4 * (1.0 - np.cos(phase)), velocities=0.4 * rate * np.sin(phase),
            time_from_start=Duration(sec=int(t) + 1, nanosec=round(1e9 * (t % 1.0)))))
    points += [
        JointTrajectoryPoint(
            positions=START + distance, velocities=[0.0, 0.0], time_from_start=Duration(sec=time))
        for time, distance in HOLDS]
    return JointTrajectory(joint_names=NAMES, points=points)


def ask(client: RosClient, **fields: Any) -> Any:
    return client.call(
        EstimatePayload, '/carried/dynamics_monitor/estimate_payload',
        EstimatePayload.Request(**fields), LONG)


def test_a_hidden_payload_is_estimated_and_applied(client):
    with client.collect(JointState, '/carried/dynamics/gravity_compensation') as gravity, \
            client.collect(InertiaStamped, '/carried/dynamics/payload') as payloads, \
            client.collect(JointState, '/carried/dynamics/reference') as references, \
            closed_loop(
                '/carried', {**ROBOT, 'gains.natural_frequency': [12.0]},
                monitor={'effort.report_covariance': CALIBRATED}, **ROBOT, effort_noise=0.05,
                seed=1, real_time_factor=1.0):  # a busy monitor skips states
        gravity.wait_count(500, LONG)  # 0.3 s after the first command, a load is no wrong drive
        set_payload(client, '/carried/simulated_arm', LOAD)
        assert ask(client, start=True, link='tool0').message == "estimation for 'tool0' started"
        publisher = client.publisher(JointTrajectory, '/carried/dynamics/joint_trajectory')
        client.ask(publisher, swing(), references, lambda m: any(m.velocity), LONG)
        found: list[Any] = []

        def is_found() -> bool:
            found.append(ask(client))
            return bool(found[-1].success and found[-1].duration > SECONDS)

        wait_until(is_found, 'the whole motion', LONG)
        check(found[-1])
        assert not ask(client, link='link1').success
        wait_until(  # the node compensates friction by default
            lambda: any('set friction_compensation to none' in one for one in ask(client).remarks),
            'the remark on friction of pairs', LONG)
        motions = 1

        def is_applied() -> bool:
            """Repeat the motion when it is over, until mz is observable."""
            nonlocal motions
            found.append(ask(client, apply=True))
            if found[-1].duration > 20.0 * motions:
                motions += 1
                publisher.publish(swing())
            return bool(found[-1].success)

        wait_until(is_applied, 'the payload', LONG)
        assert "kg on 'tool0'; a restart begins with no payload" in found[-1].message
        payloads.wait_for(lambda m: m.inertia.m > 0.0, LONG)
        assert payloads.messages[-1].inertia.m == pytest.approx(LOAD.mass, rel=0.05)
        state = client.wait_for(JointState, '/carried/joint_states', timeout=LONG)
        loaded = RigidBody(load_arm(default_arm_urdf()).with_payloads([LOAD])).gravity(
            np.array(state.position))
        gravity.wait_for(lambda m: np.allclose(m.effort, loaded, atol=1.0), LONG)
        ask(client, stop=True)
        assert 'no estimation is active' in ask(client).message


def test_an_estimation_ends_with_its_model_and_needs_effort(client):
    with monitored('/carried', {'joints': NAMES}):
        states = client.publisher(JointState, '/carried/joint_states', 1)

        def start() -> None:
            assert ask(client, start=True, link='tool0').success

        start()
        assert 'no usable joint states yet' in ask(client).message

        def lacks_effort() -> bool:
            state = JointState(name=NAMES, position=START.tolist(), velocity=[0.0, 0.0])
            state.header.stamp = client.node.get_clock().now().to_msg()
            states.publish(state)
            return 'joint states have no effort' in ask(client).message

        wait_until(lacks_effort, 'the report of the missing effort', LONG)
        set_payload(client, '/carried/dynamics', make_payload('link1', 1.0))
        wait_until(lambda: 'the payload of another link has changed' in ask(client).message,
                   'the end of the estimation', LONG)
        start()
        wait_until(lacks_effort, 'an estimation', LONG)
        client.set_parameters('/carried/dynamics', {'gravity': [0.0, 0.0, -9.77]})
        wait_until(lacks_effort, 'an estimation that a change of 0.04 m/s² does not end', LONG)
        client.set_parameters('/carried/dynamics', {'gravity': [0.0, 0.0, -9.75]})
        wait_until(lambda: 'the gravity of the base has changed' in ask(client).message,
                   'the end of the estimation', LONG)


def check(answer: Any) -> None:
    """Check the estimate of a payload in the plane of the arm, of which z is upwards."""
    values = dict(zip(answer.parameters, zip(answer.values, answer.deviations, answer.verdicts)))
    truth = {'m': LOAD.mass, 'mx': LOAD.mass * 0.05, 'mz': LOAD.mass * 0.1}
    for name, expected in truth.items():
        value, deviation, verdict = values[name]
        assert verdict == 'observable', (name, values)
        assert value == pytest.approx(expected, abs=4.0 * deviation)
    assert values['m'][0] == pytest.approx(LOAD.mass, abs=0.04)
    assert values['my'][2] == 'no effect'
    assert values['my'][1] == math.inf
    assert not any('torque constant' in remark for remark in answer.remarks)
    assert answer.payload.header.frame_id == 'tool0'
