# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The `main` of a node: start, spin, and leave in order."""

from collections.abc import Callable, Sequence
import signal
import sys

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from robot_dynamics.exceptions import RobotDynamicsError


def reason_of(error: Exception) -> str:
    """Return what is wrong in words; of an error that nobody foresaw, its type too."""
    return str(error) if isinstance(error, RobotDynamicsError) else f'internal error: {error!r}'


def run_node(make_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """
    Run a node until it is told to stop; return the exit status.

    A node that cannot start says why in one line and gives status 1.
    """
    try:
        rclpy.init(args=args)
    except rclpy_implementation.RCLError as error:  # a parameter file that is none, say
        print(f'robot_dynamics: {error}', file=sys.stderr)
        return 1
    node = executor = None
    try:
        node = make_node()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except RobotDynamicsError as error:
        print(f'robot_dynamics: {error}', file=sys.stderr)
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except rclpy_implementation.RCLError:
        if rclpy.ok():
            raise  # else a callback was about to publish when the node was told to stop
    finally:
        # Ctrl-C under `ros2 launch` arrives twice; the second must not cut this short.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if node is not None:
            node.destroy_node()
        if executor is not None:  # left to the garbage collector, it may meet its parts destroyed
            executor.shutdown()
        rclpy.try_shutdown()
    return 0
