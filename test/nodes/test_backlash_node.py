# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Backlash in the running `simulated_arm`: motor and joint have separate states."""

import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import has_stamp, NodeProcess, RosClient, SIMULATED_ARM
from sensor_msgs.msg import JointState

GAP = 0.02
GEARED = {
    'actuator.torque_constant': [0.1], 'actuator.gear_ratio': [100.0],
    'actuator.rotor_inertia': [1e-5], 'actuator.backlash': [GAP], 'lock_step': True,
    'joints': ['joint1', 'joint2'], 'initial_position': [1.0, 0.5],
}
STEPS = 60


def motor_offsets(client: RosClient, namespace: str) -> np.ndarray:
    """Return the offsets (steps, 2) of the motors from the measured joints during the motion."""
    states = client.collect(JointState, f'{namespace}/joint_states')
    motors = client.collect(JointState, f'{namespace}/simulated_arm/motor_states')
    with states, motors:
        efforts = client.publisher(JointState, f'{namespace}/effort_command')
        motors.wait_matched()
        found = []
        state = states.wait_for()
        for _ in range(STEPS):
            stamp = state.header.stamp
            motor = motors.wait_for(has_stamp(stamp))
            found.append(np.subtract(motor.position, state.position))
            answer = JointState(
                header=state.header, name=['joint1', 'joint2'], effort=[20.0, 5.0])
            before = stamp_from_ros(stamp)
            state = client.ask(
                efforts, answer, states,
                lambda message, then=before: stamp_from_ros(message.header.stamp) > then)
            states.clear()
            assert list(motor.name) == ['joint1', 'joint2']
        return np.array(found)


def test_joint_and_motor_are_apart_by_the_gap(client: RosClient) -> None:
    """The links rest on their gears; under an opposite torque the motors cross the gap."""
    with NodeProcess(SIMULATED_ARM, GEARED, namespace='/at_joint'):
        offsets = motor_offsets(client, '/at_joint')
    # The arm falls forward, g(q) < 0, so that at first the motors are behind the joints.
    assert offsets[0] == pytest.approx([-0.5 * GAP] * 2, abs=1e-10)
    assert offsets[-1] == pytest.approx([0.5 * GAP] * 2, abs=1e-10)
    assert np.abs(offsets).max() <= 0.5 * GAP + 1e-10
    assert np.abs(offsets[:, 0]).min() < 0.4 * GAP  # observed while the motor crosses the gap


def test_encoders_at_the_motor_do_not_see_the_gap(client: RosClient) -> None:
    with NodeProcess(SIMULATED_ARM, {**GEARED, 'encoders': 'motor'}, namespace='/at_motor'):
        assert np.abs(motor_offsets(client, '/at_motor')).max() == 0.0
