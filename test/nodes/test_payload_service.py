# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The service `set_payload` of `dynamics`: effect on all services, and rejections."""


from disturbances import set_payload
from geometry_msgs.msg import InertiaStamped
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm, make_payload, Payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import (
    payload_from_ros,
    payload_to_ros,
    stamp_from_ros,
)
from robot_dynamics.task_space import TaskSpace
from robot_dynamics_interfaces.srv import ManipulatorEquation, SetPayload
from ros_harness import DYNAMICS, LATCHED, NodeProcess, running, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState
from service_bench import A, Q, TAU, V

LOAD = make_payload('tool0', 2.5, (0.1, 0.0, 0.2), np.diag((0.01, 0.02, 0.015)))


def test_a_payload_counts_in_every_service_and_is_latched(planar, client):
    arm = planar.arm
    loaded = ArmDynamics(arm.with_payloads([LOAD]))
    q, v, a = np.array(Q), np.array(V), np.array(A)
    answer = planar.answer('set_payload', payload=payload_to_ros(LOAD))
    assert answer.message == "2.5 kg on 'tool0'; a restart begins with no payload"
    response = planar.answer('inverse_dynamics', position=Q, velocity=V, acceleration=A)
    assert response.effort == pytest.approx(loaded.inverse_dynamics(q, v, a))
    equation = planar.answer('manipulator_equation', position=Q)
    assert equation.gravity == pytest.approx(loaded.rigid_body.gravity(q))
    task = planar.answer('task_space', frame='tool0', position=Q)
    assert task.inertia == pytest.approx(
        TaskSpace(loaded.arm, 'tool0').at(Q).inertia.ravel(), abs=1e-12)
    in_force = client.wait_for(  # a late subscriber receives the message published before it
        InertiaStamped, '/planar/dynamics/payload', lambda message: message.inertia.m > 0.0,
        qos=LATCHED)
    back = payload_from_ros(arm, in_force)
    assert (back.link, back.mass, back.com.tolist()) == ('tool0', 2.5, [0.1, 0.0, 0.2])
    assert back.inertia.tolist() == LOAD.inertia.tolist()
    assert in_force.header.stamp.sec > 0
    assert not planar.ask('set_payload', payload=payload_to_ros(
        Payload('hand', 1.0, LOAD.com, LOAD.inertia))).success
    assert planar.answer('inverse_dynamics', position=Q).terms.gravity == pytest.approx(
        loaded.rigid_body.gravity(q))  # a rejected payload changes nothing
    assert planar.answer('set_payload').message.startswith('no payload;')
    assert planar.answer('inverse_dynamics', position=Q, velocity=V, acceleration=A).effort == (
        pytest.approx(TAU, abs=5e-9))
    before = stamp_from_ros(in_force.header.stamp)
    client.wait_for(
        InertiaStamped, '/planar/dynamics/payload', lambda message: (
            message.inertia.m == 0.0 and stamp_from_ros(message.header.stamp) > before),
        qos=LATCHED)


def test_payloads_of_the_parameters_are_in_force_after_the_start(client):
    parameters = {
        'joints': ['joint1', 'joint2'], 'payload.links': ['tool0', 'link2'],
        'payload.mass': [2.5, 1.0], 'payload.com': [0.1, 0.0, 0.2, 0.0, 0.0, 0.0],
        'payload.inertia': [0.01, 0.0, 0.0, 0.02, 0.0, 0.015, *[0.0] * 6]}
    arm = load_arm(default_arm_urdf())
    gravity = ArmDynamics(arm.with_payloads([LOAD, make_payload('link2', 1.0)])).rigid_body.gravity
    with running(
            NodeProcess(DYNAMICS, parameters, namespace='/restarted'),
            NodeProcess(SIMULATED_ARM, parameters, namespace='/restarted')):
        answer = client.call(
            ManipulatorEquation, '/restarted/dynamics/manipulator_equation',
            ManipulatorEquation.Request(position=Q))
        assert answer.gravity == pytest.approx(gravity(np.array(Q)))
        assert set_payload(client, '/restarted/dynamics').message == (
            "no payload; a restart begins with 2.5 kg on 'tool0', 1 kg on 'link2'")
        arm_node = '/restarted/simulated_arm'
        replaced = set_payload(client, arm_node, make_payload('tool0', 1.0))
        assert replaced.message == "1 kg on 'link2', 1 kg on 'tool0' (replaces 2.5 kg on 'tool0')"
        heavy = make_payload('tool0', 500.0)
        for payload, words in ((make_payload('hand', 1.0), "frame_id is 'hand'"),
                               (heavy, 'payload.inertia.m is 500 kg')):
            refused = client.call(SetPayload, f'{arm_node}/set_payload', SetPayload.Request(
                payload=payload_to_ros(payload)))
            assert not refused.success
            assert words in refused.message
        client.set_parameters(arm_node, {'ignore_checks': ['payload']})
        warning, = set_payload(client, arm_node, heavy).warnings
        assert warning.startswith("payload.inertia.m is 500 kg on 'tool0'")


def test_a_payload_that_the_arm_cannot_hold_where_it_is(planar, client):
    states = client.publisher(JointState, '/planar/joint_states', 1)
    request = SetPayload.Request(payload=payload_to_ros(make_payload('tool0', 12.0)))

    def refusal(position: list[float]) -> str:
        message = JointState(name=['joint1', 'joint2'], position=position, velocity=[0.0, 0.0])
        message.header.stamp = client.node.get_clock().now().to_msg()
        states.publish(message)
        response = client.call(SetPayload, '/planar/dynamics/set_payload', request)
        return '' if response.success else response.message

    stretched = [np.pi / 2.0, 0.0]
    wait_until(lambda: 'in the present configuration gravity at' in refusal(stretched),
               'the rejection of a stretched arm')
    wait_until(lambda: refusal([0.0, 0.0]) == '', 'a load of an arm that hangs')
    wait_until(lambda: refusal(stretched) != '', 'the rejection after that')
    client.set_parameters('/planar/dynamics', {'gravity': [0.0, 0.0, -1.0]})
    wait_until(lambda: refusal(stretched) == '', 'the gravity of the base in use')
    client.set_parameters('/planar/dynamics', {'gravity': [0.0, 0.0, -9.81]})
    planar.answer('set_payload')
    client.node.destroy_publisher(states)
