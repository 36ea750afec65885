# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Run the controller, the simulated arm and a node of your own in one executor.

    python docs/examples/one_process.py --threads 2 --ros-args -p rate:=200.0
"""

from argparse import ArgumentParser
import signal
import sys
import threading

import rclpy
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode
from sensor_msgs.msg import JointState


class Monitor(Node):
    """Logs once per second where the arm is."""

    def __init__(self) -> None:
        super().__init__('monitor')
        self._state = JointState()
        self.create_subscription(JointState, 'joint_states', self._keep, 1)
        self.create_timer(1.0, self._log)

    def _keep(self, state: JointState) -> None:
        self._state = state

    def _log(self) -> None:
        self.get_logger().info(f'Positions: {[round(q, 3) for q in self._state.position]}')


def main() -> None:
    """Spin three nodes until Ctrl-C, SIGTERM or SIGHUP."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--threads', type=int, default=1, help='Number of threads of the executor')
    threads = parser.parse_args(remove_ros_args(sys.argv)[1:]).threads
    end = threading.Event()
    # No exception, which rclpy could convert.
    for end_signal in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(end_signal, lambda *_: end.set())
    sys.setswitchinterval(0.0001)
    # The handlers of rclpy would shut the context down before the command ends.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor() if threads == 1 else MultiThreadedExecutor(threads)
    nodes = [Monitor(), DynamicsNode(), SimulatedArmNode()]
    for node in nodes:
        executor.add_node(node)
    try:
        while not end.is_set():
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        for node in nodes:  # the controller before the arm
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
