# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Stand-ins for the parts of ros2_control that this package communicates with.

There are no wheels of ros2_control to install. The stand-ins are written in rclpy after the
sources of ros2_controllers and of joint_state_topic_hardware_interface; they do not test those
packages. One process runs three nodes in a loop of 100 Hz, as a controller manager does:

- the hardware component `JointStateTopicSystem`: it publishes a command, stamped with the time of
  publication, unless the summed distance from the state is at most
  `trigger_joint_command_threshold`; an unknown state or command is NaN, so that the
  distance is never within the threshold;
- `joint_state_broadcaster`: all joints, stamped with the time of the update, with NaN for a
  position, velocity or effort that is unknown;
- `effort_controller`, a `JointGroupEffortController`: it keeps the last command of `~/commands`,
  has none (NaN) before the first, and writes 0 once at its deactivation. The service
  `~/set_active` stands for `switch_controller` of the controller manager.
"""

from collections.abc import Sequence
import math
from pathlib import Path
import re
import signal
import threading
from typing import Any

from fault_bench import NAMES, STEADY
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import DYNAMICS, NO_SHARED_MEMORY, NodeProcess
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

STRINGS = Parameter.Type.STRING_ARRAY
INTERFACES = ('position', 'velocity', 'effort')
DEFAULT_THRESHOLD = 1e-5


def commanding(namespace: str) -> NodeProcess:
    """Return a node `dynamics`, not yet started, that commands the effort controller."""
    return NodeProcess(
        DYNAMICS, {
            **STEADY, 'robot_description': default_arm_urdf(), 'joints': NAMES,
            'end_action': 'ramp_to_zero'}, namespace=namespace, environment=NO_SHARED_MEMORY,
        remaps={'~/commands': f'{namespace}/effort_controller/commands'})


def ros2_control(
    namespace: str, joints: Sequence[str], threshold: float = DEFAULT_THRESHOLD,
) -> NodeProcess:
    """
    Return the process, not yet started; `joints` are in the order of the effort controller.

    It reads NAMESPACE/simulated/joint_states and publishes NAMESPACE/joint_states and
    NAMESPACE/simulated/effort_command.
    """
    return NodeProcess(
        Path(__file__).stem,
        {'joints': list(joints), 'trigger_joint_command_threshold': threshold},
        namespace=namespace, ready=re.compile('Updating'))


class Hardware(Node):
    """The hardware component: states by joint and interface, and the commanded efforts."""

    def __init__(self) -> None:
        super().__init__('hardware')
        self.threshold = self.declare_parameter('trigger_joint_command_threshold', 1e-5).value
        self.joints: list[str] = sorted(self.declare_parameter('joints', STRINGS).value)
        self._latest: JointState | None = None
        self.states = {joint: dict.fromkeys(INTERFACES, math.nan) for joint in self.joints}
        self.commands = dict.fromkeys(self.joints, math.nan)
        self._publisher = self.create_publisher(JointState, 'simulated/effort_command', 1)
        self.create_subscription(
            JointState, 'simulated/joint_states', self._keep, qos_profile_sensor_data)

    def _keep(self, message: JointState) -> None:
        self._latest = message

    def read(self) -> None:
        """Store the newest state."""
        message = self._latest
        if message is None:
            return
        for interface in INTERFACES:
            for joint, value in zip(message.name, getattr(message, interface)):
                if joint in self.states and math.isfinite(value):
                    self.states[joint][interface] = value

    def write(self) -> None:
        """Publish the commands, unless their distance to the states is within the threshold."""
        distance = sum(
            abs(self.states[joint]['effort'] - self.commands[joint]) for joint in self.joints)
        if distance <= self.threshold:
            return
        message = JointState(name=self.joints, effort=[self.commands[j] for j in self.joints])
        message.header.stamp = self.get_clock().now().to_msg()
        self._publisher.publish(message)


class Broadcaster(Node):
    """Publishes the states of all joints, stamped with the time of the update."""

    def __init__(self, hardware: Hardware) -> None:
        super().__init__('joint_state_broadcaster')
        self._hardware = hardware
        self._publisher = self.create_publisher(JointState, 'joint_states', 10)

    def update(self) -> None:
        """Publish one message."""
        states = self._hardware.states
        message = JointState(name=list(states), **{
            interface: [state[interface] for state in states.values()]
            for interface in INTERFACES})
        message.header.stamp = self.get_clock().now().to_msg()
        self._publisher.publish(message)


class EffortController(Node):
    """Writes the last command of `~/commands` to the hardware, in the order of `joints`."""

    def __init__(self, hardware: Hardware) -> None:
        super().__init__('effort_controller')
        self._hardware = hardware
        self._joints: list[str] = self.declare_parameter('joints', STRINGS).value
        self._is_active, self._last = True, None
        self.create_subscription(Float64MultiArray, '~/commands', self._keep, 10)
        self.create_service(SetBool, '~/set_active', self._set_active)

    def _keep(self, message: Float64MultiArray) -> None:
        self._last = message.data

    def _set_active(self, request: Any, response: Any) -> Any:
        self._is_active, self._last = request.data, None
        if not request.data:
            self._write([0.0] * len(self._joints))
        response.success = True
        return response

    def update(self) -> None:
        """Write the last command, if the controller is active and has one."""
        if self._is_active and self._last is not None and len(self._last) == len(self._joints):
            self._write(self._last)

    def _write(self, values: Sequence[float]) -> None:
        self._hardware.commands.update(zip(self._joints, values))


def main() -> None:
    """Update until SIGINT, which only sets an event: an exception could interrupt a conversion."""
    end = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: end.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    hardware = Hardware()
    broadcaster, controller = Broadcaster(hardware), EffortController(hardware)
    executor = SingleThreadedExecutor()

    def update() -> None:
        hardware.read()
        broadcaster.update()
        controller.update()
        hardware.write()

    hardware.create_timer(0.01, update)
    for node in (hardware, broadcaster, controller):
        executor.add_node(node)
    hardware.get_logger().info('Updating')
    while not end.is_set():
        executor.spin_once(timeout_sec=0.1)
    rclpy.shutdown()


if __name__ == '__main__':
    main()
