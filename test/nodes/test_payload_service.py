# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The service `set_payload` of `dynamics`: effect on all services, and transitions."""

from dataclasses import replace

from geometry_msgs.msg import InertiaStamped
import numpy as np
import pytest
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.ros.middleware.conversions import (
    payload_from_ros,
    payload_to_ros,
    stamp_from_ros,
)
from ros_harness import LATCHED, RosClient
from sensor_msgs.msg import JointState
from service_bench import A, Q, Served, TAU, V

LOAD = make_payload('tool0', 2.5, (0.1, 0.0, 0.2), np.diag((0.01, 0.02, 0.015)))


def test_a_payload_counts_in_every_service_and_is_latched(
    planar: Served, client: RosClient,
) -> None:
    arm = planar.arm
    loaded = ArmDynamics(arm.with_payloads([LOAD]))
    q, v, a = np.array(Q), np.array(V), np.array(A)
    answer = planar.answer('set_payload', payload=payload_to_ros(LOAD))
    assert answer.message == "2.5 kg on 'tool0'"
    response = planar.answer('inverse_dynamics', position=Q, velocity=V, acceleration=A)
    assert response.effort == pytest.approx(loaded.inverse_dynamics(q, v, a))
    equation = planar.answer('manipulator_equation', position=Q)
    assert equation.gravity == pytest.approx(loaded.rigid_body.gravity(q))
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
    assert planar.answer('set_payload').message == 'no payload'
    assert planar.answer('inverse_dynamics', position=Q, velocity=V, acceleration=A).effort == (
        pytest.approx(TAU, abs=5e-9))
    before = stamp_from_ros(in_force.header.stamp)
    client.wait_for(
        InertiaStamped, '/planar/dynamics/payload', lambda message: (
            message.inertia.m == 0.0 and stamp_from_ros(message.header.stamp) > before),
        qos=LATCHED)


def test_a_transition_takes_the_time_of_the_joint_states(
    planar: Served, client: RosClient,
) -> None:
    # The mass differs from earlier ones, which a late subscriber to the payload may receive too.
    load = replace(LOAD, mass=1.5)
    loaded = ArmDynamics(planar.arm.with_payloads([load]))
    bare_g, loaded_g = (
        d.rigid_body.gravity(np.array(Q)) for d in (planar.dynamics, loaded))
    states = client.publisher(JointState, '/planar/joint_states', 1)
    payload_topic = '/planar/dynamics/payload'
    with client.collect(JointState, '/planar/effort_command') as efforts, \
            client.collect(InertiaStamped, payload_topic, LATCHED) as payloads:
        efforts.wait_matched()
        payloads.wait_for(lambda message: message.inertia.m == 0.0)
        planar.answer('set_payload', payload=payload_to_ros(load), transition_time=2.0)
        for quarter in range(6):
            state = JointState(name=planar.arm.joint_names, position=Q)
            state.header.stamp.sec = 1000 + quarter // 2
            state.header.stamp.nanosec = 500_000_000 * (quarter % 2)
            effort = client.answer_to(states, state, efforts)
            fraction = min(quarter / 4, 1.0)
            assert effort.effort == pytest.approx(bare_g + fraction * (loaded_g - bare_g))
            announced = [m for m in payloads.messages if m.inertia.m == load.mass]
            assert quarter >= 4 or not announced
        payloads.wait_for(lambda message: message.inertia.m == load.mass)
        planar.answer('set_payload')
    client.node.destroy_publisher(states)
