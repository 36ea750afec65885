# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The `main` of a node: start, spin and orderly shutdown, also during the start."""

from collections.abc import Callable, Sequence
import gc
import os
from pathlib import Path
import re
import resource
import sys
import time

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.rclpy_internals import RclError, UnknownArgumentsError
from robot_dynamics.ros.middleware.shutdown import ends_in_time, ShutdownRequest
from robot_dynamics.ros.parameters.node_arguments import NodeUsage, outside_of_ros_args
from robot_dynamics.ros.parameters.parameter_file import check_sections
from robot_dynamics.ros.unblocked_output import STDERR, unblocked_stderr

LONGEST_TURN = 0.0001
"""[s] after which Python switches to a waiting thread, such as control; default: 0.005 s."""
MiddlewareError = (RclError, UnknownArgumentsError)
LAST_ANSWERS = 1.0
"""[s] for the results of actions while the node ends."""
MEMORY_LIMIT = 2**30
"""Memory [bytes] that a node may allocate in addition to that at its start."""
FULL_PASSES_APART = 1000
"""Passes of Python's garbage collector over young objects before a pass over all."""


def run_node(
    make_node: Callable[[], Node], usage: NodeUsage, args: Sequence[str] | None = None,
) -> int:
    """
    Run a node until it is asked to stop; return the exit status.

    `--help` prints `usage` and returns 0. An argument outside `--ros-args` is reported
    in one line, and the status is 2.

    If a node cannot start, the reason is printed in one line and the status is 1. If the node has
    a method `request_shutdown`, a separate thread calls it as soon as the node is asked to stop,
    even while a callback runs.
    """
    arguments = sys.argv if args is None else args
    others = outside_of_ros_args(arguments[1:])
    if {'-h', '--help'} & set(others):
        print(usage.help(), end='')
        return 0
    if others:
        print(usage.refusal(others), file=sys.stderr)
        return 2
    if os.isatty(STDERR):  # rcutils colours no messages that go through a pipe
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    with ShutdownRequest() as end:
        try:
            rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        except MiddlewareError as error:  # for example an invalid parameter file
            return _refuse_to_start(error)
        node = None
        executor = SingleThreadedExecutor()
        try:
            with unblocked_stderr():
                node = make_node()
                check_sections(node, arguments)
                executor.add_node(node)
                end.when_asked(_when_asked(node))
                limit_memory()
                expect_no_garbage()
                sys.setswitchinterval(LONGEST_TURN)
                _spin(executor, node, end)
        except (RobotDynamicsError, ParameterException, *MiddlewareError) as error:
            return _refuse_to_start(error)
        finally:
            end.when_asked(lambda: None)
            if node is not None:
                node.destroy_node()
            executor.shutdown()  # the garbage collector may destroy its parts first
            with ends_in_time():
                rclpy.try_shutdown()
                del node, executor
                # Destroy the objects of the middleware, which announces the end of the process to
                # others; without it they list its nodes for 20 s more. Reference cycles keep the
                # objects, also those that `expect_no_garbage` has excluded from collection.
                gc.unfreeze()
                gc.collect()
    return 0


def _when_asked(node: Node) -> Callable[[], None]:
    # `wake` does not end the wait of an executor; a guard condition does.
    wake = node.create_guard_condition(lambda: None).trigger
    request_shutdown = getattr(node, 'request_shutdown', lambda: None)

    def request() -> None:
        wake()
        request_shutdown()

    return request


def _refuse_to_start(error: Exception) -> int:
    hint = ''
    if isinstance(error, MiddlewareError) and os.environ.get('ROS_SECURITY_ENABLE') == 'true':
        hint = (' (ROS_SECURITY_ENABLE is true, which requires a middleware with DDS security and '
                'the keys of this enclave: docs/security.md)')
    print(f'robot_dynamics: {describe_error(error)}{hint}', file=sys.stderr)
    return 1


def _spin(executor: SingleThreadedExecutor, node: Node, end: ShutdownRequest) -> None:
    """Spin until the node is asked to stop, then while clients await the results of actions."""
    while not end.is_made and node.context.ok():
        try:
            executor.spin_once()
        except ExternalShutdownException:
            return
        except Exception as error:  # rclpy raises it for unreadable data
            if node.context.ok():
                node.get_logger().error(
                    f'A callback failed: {error!r}', throttle_duration_sec=LOG_PERIOD)
    until = time.monotonic() + LAST_ANSWERS
    while getattr(node, 'is_busy', False) and time.monotonic() < until:
        executor.spin_once(0.05)


def limit_memory(beyond: int = MEMORY_LIMIT) -> None:
    """
    Limit the memory of this process to `beyond` bytes more than it has, on Linux.

    The middleware allocates memory for the counts in a service request before it reads the data:
    an invalid request of 16 bytes can therefore allocate all the memory of the computer, which
    then kills the node. With a limit, such a request fails instead. A stricter limit stays active.
    """
    status = Path('/proc/self/status')
    has = re.search(r'^VmData:\s*(\d+) kB', status.read_text(), re.MULTILINE) if (
        status.exists()) else None
    if has is None:
        return
    wanted = 1024 * int(has[1]) + beyond
    limit, most = resource.getrlimit(resource.RLIMIT_DATA)
    if limit == resource.RLIM_INFINITY or wanted < limit:
        resource.setrlimit(resource.RLIMIT_DATA, (wanted, most))


def expect_no_garbage() -> None:
    """
    Exclude the present objects from garbage collection, and collect all others rarely.

    A pass over all objects stops all threads for 10 ms at first, and for 0.1 s if a request has
    many objects. A pass over the young objects finds nearly all unused objects.
    """
    gc.collect()
    gc.freeze()
    young, middle, _ = gc.get_threshold()
    gc.set_threshold(young, middle, FULL_PASSES_APART)
