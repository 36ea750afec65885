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

"""
The `main` of a node: start, spin, and leave in order.

rclpy's own signal handlers shut the context down at once, after which a node cannot publish a
last effort. Here a signal is written to a pipe, as Python does even while its main thread waits in
C, and a thread that reads the pipe asks the spinning one to end. rclpy also ends its spin at
whatever a callback raises, and at some requests that it cannot read itself; here that is logged,
and the node goes on.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import signal
import sys
import threading

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from robot_dynamics.exceptions import RobotDynamicsError

END_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def reason_of(error: Exception) -> str:
    """Return what is wrong in words; of an error that nobody foresaw, its type too."""
    return str(error) if isinstance(error, RobotDynamicsError) else f'internal error: {error!r}'


def run_node(make_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """
    Run a node until it is told to stop; return the exit status.

    A node that cannot start says why in one line and gives status 1.
    """
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.RCLError as error:  # a parameter file that is none, say
        print(f'robot_dynamics: {error}', file=sys.stderr)
        return 1
    node = None
    executor = SingleThreadedExecutor()
    try:
        with _told_to_end(executor) as end:
            node = make_node()
            executor.add_node(node)
            _spin(executor, node, end)
    except RobotDynamicsError as error:
        print(f'robot_dynamics: {error}', file=sys.stderr)
        return 1
    finally:
        if node is not None:
            node.destroy_node()
        if executor is not None:  # left to the garbage collector, it may meet its parts destroyed
            executor.shutdown()
        rclpy.try_shutdown()
    return 0


def _spin(executor: SingleThreadedExecutor, node: Node, end: threading.Event) -> None:
    while not end.is_set() and node.context.ok():
        try:
            executor.spin_once()
        except ExternalShutdownException:
            return
        except Exception as error:  # whatever arrives, the node goes on
            if node.context.ok():
                node.get_logger().error(f'A callback failed: {error!r}')


@contextmanager
def _told_to_end(executor: SingleThreadedExecutor) -> Iterator[threading.Event]:
    """Give an event that is set, and the executor woken, at a signal to end."""
    end = threading.Event()
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def wait() -> None:
        os.read(reading, 1)
        end.set()
        executor.wake()

    for end_signal in END_SIGNALS:
        signal.signal(end_signal, lambda *_: None)
    signal.set_wakeup_fd(writing)
    waiter = threading.Thread(target=wait, name='signals', daemon=True)
    waiter.start()
    try:
        yield end
    finally:  # signals are still taken, and do nothing: a last effort may be on its way
        os.write(writing, b'.')
        waiter.join()
