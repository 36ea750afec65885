# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Memory of a node, the length of its error messages, and the end of a blocked process."""

import signal
import subprocess
import sys

import children
from children import TIMEOUT
import pytest
from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error

LIMITED = """
from robot_dynamics.ros.running import limit_memory
import numpy as np
limit_memory(200 * 2**20)
some = np.ones(100 * 2**20, dtype=np.uint8)
print('some', flush=True)
try:
    np.ones(300 * 2**20, dtype=np.uint8)
except MemoryError:
    print('not so much')
print(len(some))
"""
UNLIMITED_AGAIN = """
import resource
_, most = resource.getrlimit(resource.RLIMIT_DATA)
resource.setrlimit(resource.RLIMIT_DATA, (most, most))
"""
SELDOM = """
import gc
from robot_dynamics.ros.running import expect_no_garbage
expect_no_garbage()
assert gc.isenabled() and gc.get_threshold()[2] == 1000
assert gc.get_freeze_count() > 1000 and not gc.get_objects(2)
loop = []
loop.append(loop)
del loop
assert gc.collect(1) == 1
print('found')
"""


def output_of(program: str) -> list[str]:
    """Return the lines that a program prints in a separate process."""
    return children.run(
        [sys.executable, '-c', program], check=True, text=True,
        capture_output=True).stdout.splitlines()


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='only Linux reports its memory')
def test_more_memory_than_the_limit_cannot_be_had():
    assert output_of(UNLIMITED_AGAIN + LIMITED) == ['some', 'not so much', str(100 * 2**20)]


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='only Linux reports its memory')
def test_a_stricter_limit_of_the_user_stays():
    strict = """
import resource
_, most = resource.getrlimit(resource.RLIMIT_DATA)
resource.setrlimit(resource.RLIMIT_DATA, (2**30, most))
from robot_dynamics.ros.running import limit_memory
limit_memory(2**40)
print(resource.getrlimit(resource.RLIMIT_DATA)[0])
"""
    assert output_of(strict) == [str(2**30)]


def test_what_is_no_longer_needed_is_found_by_the_passes_that_are_left():
    assert output_of(SELDOM) == ['found']


@pytest.mark.parametrize(('error', 'words'), [
    (InvalidInputError('position is nan'), 'position is nan'),
    (ParameterException('Invalid name', 'x'), 'Invalid name: x'),
    (rclpy_implementation.RCLError('no node:\n nothing, at /src/node.c:1, at /src/b.c:2'),
     'no node: nothing'),
    (rclpy_implementation.UnknownROSArgsError("['--x']"), "unknown ROS arguments ['--x']"),
    (MemoryError(),
     'this needs more memory than the limit of the node, expected less data at a time'),
    (KeyError('x'), "internal error: KeyError('x')"),
])
def test_reasons(error, words):
    assert describe_error(error) == words


WAITS = """
import threading
from robot_dynamics.ros.middleware.shutdown import end_later, ShutdownRequest
with ShutdownRequest() as end:
    end.when_asked(lambda: end_later(0.2))
    print('waits', flush=True)
    lock = threading.Lock()
    lock.acquire()
    lock.acquire()
"""


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM'])
def test_a_blocked_process_ends_with_tracebacks(name):
    with children.popen([sys.executable, '-c', WAITS], stdout=subprocess.PIPE,
                        stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == 'waits\n'
        process.send_signal(getattr(signal, name))
        _, err = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert 'Timeout (0:00:00.200000)!' in err
    assert 'line 9 in <module>' in err


def test_a_second_destroy_node_does_nothing():
    program = (
        'import rclpy\n'
        'from robot_dynamics.ros.dynamics.node import DynamicsNode\n'
        'from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode\n'
        'rclpy.init()\n'
        'for kind in (DynamicsNode, SimulatedArmNode):\n'
        '    node = kind()\n'
        '    node.destroy_node()\n'
        '    node.destroy_node()\n'
        'rclpy.shutdown()\n')
    done = children.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
