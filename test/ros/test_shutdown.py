# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A process ends after a signal, also if its main thread waits without end."""

import signal
import subprocess
import sys

import children
from children import TIMEOUT
import pytest

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
