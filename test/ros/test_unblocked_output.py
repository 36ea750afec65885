# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A terminal that accepts no output, as after Ctrl-S, holds up no effort."""

from contextlib import contextmanager
import os
import pty
import signal
import sys

from bounded_waits import wait_until
from children import popen, TIMEOUT
import pytest
from ros_harness import DYNAMICS, NodeProcess, RosClient, SIMULATED_ARM
from sensor_msgs.msg import JointState


@contextmanager
def full_pipe():
    """Yield the end of a pipe into which nothing more can be written."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    try:
        while True:
            os.write(writer, bytes(65536))
    except BlockingIOError:
        os.set_blocking(writer, True)
    yield writer
    os.close(reader)
    os.close(writer)


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM])
def test_a_node_commands_and_ends_although_its_messages_are_not_read(ending):
    with full_pipe() as stderr, NodeProcess(SIMULATED_ARM), RosClient() as client:
        efforts = client.collect(JointState, '/effort_command')
        node = popen([sys.executable, '-m', DYNAMICS, '--ros-args', '--log-level', 'debug'],
                     stderr=stderr)
        wait_until(lambda: len(efforts.messages) > 1000, 'efforts')
        node.send_signal(ending)
        assert node.wait(TIMEOUT) == 0


def test_messages_reach_a_terminal_in_colour_and_before_the_end():
    ours, theirs = pty.openpty()
    node = popen([sys.executable, '-m', DYNAMICS], stderr=theirs)
    os.close(theirs)
    text = b''
    while b'Waiting for' not in text and b"Model '" not in text:
        text += os.read(ours, 4096)
    node.send_signal(signal.SIGINT)
    assert node.wait(TIMEOUT) == 0
    os.close(ours)
    assert b'\x1b[' in text
