# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0
"""Gravity of running nodes: the parameter at run time, and an IMU of the base."""

import math

from closed_loop import closed_loop, NAMES, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Quaternion, Vector3
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.base_gravity import gravity_from_imu
from ros_harness import DYNAMICS, LONG, NodeProcess, running, UNHURRIED, wait_until
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, JointState

TILTED = [4.0, 0.0, -8.0]
NOT_GIVEN = [-1.0] + 8 * [0.0]


def gravity_torque(q: list[float], gravity: list[float]) -> np.ndarray:
    return ArmDynamics(load_arm(default_arm_urdf(), gravity=gravity)).gravity(q)


def oriented(rotation: Rotation) -> Imu:
    x, y, z, w = rotation.as_quat()
    return Imu(orientation=Quaternion(x=x, y=y, z=z, w=w))


def accelerated(x: float, y: float, z: float) -> Imu:
    return Imu(orientation_covariance=NOT_GIVEN, linear_acceleration=Vector3(x=x, y=y, z=z))


# --- the message ---------------------------------------------------------------------------------

def test_gravity_of_an_orientation():
    rotation = Rotation.from_euler('xyz', (2.0, 0.5, -3.0))
    expected = rotation.inv().apply([0.0, 0.0, -1.62])
    assert gravity_from_imu(oriented(rotation), 1.62) == pytest.approx(expected, abs=1e-12)


def test_gravity_of_an_accelerometer():
    assert gravity_from_imu(accelerated(0.0, 1.0, 9.7), 9.81).tolist() == [0.0, -1.0, -9.7]
    without = accelerated(3.0, 0.0, 9.0)
    without.orientation_covariance = 9 * [0.0]
    without.orientation = Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)  # many drivers send zeros
    assert gravity_from_imu(without, 9.81).tolist() == [-3.0, 0.0, -9.0]


@pytest.mark.parametrize(('message', 'words'), [
    (Imu(orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=2.0)), 'orientation has the norm 2, '),
    (accelerated(0.0, 0.0, 0.0), r'linear_acceleration is \[0.0, 0.0, 0.0\], expected a norm'),
    (accelerated(0.0, 0.0, 4.9), 'expected a norm of 4.91 to 19.6'),
    (accelerated(0.0, 0.0, 19.7), 'expected a norm of 4.91 to 19.6'),
    (Imu(orientation_covariance=NOT_GIVEN, linear_acceleration=Vector3(z=9.81),
         linear_acceleration_covariance=NOT_GIVEN), 'or an orientation'),
])
def test_implausible_messages_are_rejected(message, words):
    with pytest.raises(InvalidInputError, match=words):
        gravity_from_imu(message, 9.81)


# --- the nodes -----------------------------------------------------------------------------------

def test_the_parameter_changes_while_the_arm_holds(client):
    """Simulated time stands still while both nodes receive the new gravity."""
    namespace = '/tilted'
    with client.collect(JointState, f'{namespace}/joint_states') as states, \
            client.collect(JointState, f'{namespace}/dynamics/gravity_compensation') as torques, \
            closed_loop(namespace, real_time_factor=4.0):
        client.wait_for(JointState, f'{namespace}/dynamics/computed_torque', timeout=LONG)
        client.set_parameters(f'{namespace}/simulated_arm', {'paused': True, 'gravity': TILTED})
        client.set_parameters(f'{namespace}/dynamics', {'gravity': TILTED})
        client.set_parameters(f'{namespace}/simulated_arm', {'paused': False})
        expected = gravity_torque(START, TILTED)
        torques.wait_for(lambda m: np.allclose(m.effort, expected, atol=1e-3), LONG)
        states.wait_for(lambda m: np.allclose(m.position, START, atol=1e-4)
                        and np.allclose(m.effort, expected, atol=0.05), LONG)
        errors = [np.abs(np.subtract(m.position, START)).max() for m in states.messages]
        reason = client.rejection(f'{namespace}/dynamics', 'gravity', [1.0, 2.0])
    assert max(errors) < 0.05
    assert 'gravity has 2 values, expected 3' in reason


def test_gravity_of_the_base_imu(client):
    namespace = '/mobile'
    node = NodeProcess(
        DYNAMICS, {'imu_rpy': [0.0, 0.0, math.pi], **UNHURRIED}, namespace=namespace)
    with running(node), \
            client.collect(JointState, f'{namespace}/dynamics/gravity_compensation') as torques, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        states = client.publisher(JointState, f'{namespace}/joint_states')
        imu = client.publisher(Imu, f'{namespace}/base_imu')

        def status() -> DiagnosticStatus | None:
            return next((s for m in reversed(diagnostics.messages) for s in m.status
                         if s.name == f'{namespace}/dynamics: gravity'), None)

        def has(gravity: list[float], message: Imu | None) -> bool:
            if message is not None:
                imu.publish(message)
            state = JointState(name=NAMES, position=START, velocity=[0.0, 0.0])
            state.header.stamp = client.node.get_clock().now().to_msg()
            states.publish(state)
            return bool(torques.messages) and np.allclose(
                torques.messages[-1].effort, gravity_torque(START, gravity), atol=1e-6)

        wait_until(lambda: has([0.0, 0.0, -9.81], None), 'the gravity of the parameter', LONG)
        wait_until(lambda: (s := status()) is not None and s.level == DiagnosticStatus.WARN,
                   'a warning: no message of the IMU', LONG)
        assert 'no valid message on base_imu yet' in status().message
        pitch = Rotation.from_euler('y', 0.5)
        g = 9.81 * np.array([math.sin(0.5), 0.0, -math.cos(0.5)])  # of the IMU, turned by π
        wait_until(lambda: has([-g[0], 0.0, g[2]], oriented(pitch)), 'the orientation', LONG)
        wait_until(lambda: has([-g[0], 0.0, g[2]], accelerated(0.0, 0.0, 90.0))
                   and status().values[1].value not in ('0', ''), 'a rejected message', LONG)
        wait_until(lambda: has([2.0, 0.0, -9.0], accelerated(2.0, 0.0, 9.0))
                   and status().level == DiagnosticStatus.OK
                   and 'of base_imu' in status().message, 'the accelerometer', LONG)
    assert 'linear_acceleration is [0.0, 0.0, 90.0]' in node.log
