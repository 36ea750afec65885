# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What would let tests pass wrongly: a node of an earlier run, an excused end."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import blocked_ends
from children import is_gone, popen
import pytest
from ros_harness import wait_until

TEST_RUN = """
import sys
from ros_harness import DYNAMICS, NodeProcess
node = NodeProcess(DYNAMICS, namespace='/orphan').start()
print(node.pid, flush=True)
sys.stdin.read()
"""
"""Starts a node as the tests do, and keeps running."""


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='PR_SET_PDEATHSIG is of Linux')
def test_a_node_ends_with_a_test_run_that_is_killed():
    with popen(
            [sys.executable, '-c', TEST_RUN], env={**os.environ, 'PYTHONPATH': os.pathsep.join(
                [str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')])},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as test_run:
        pid = int(test_run.stdout.readline())
        assert not is_gone(pid)
        test_run.kill()
    try:
        wait_until(lambda: is_gone(pid), 'the end of the node')
    finally:
        if not is_gone(pid):
            os.kill(pid, signal.SIGKILL)


def test_one_end_that_fast_dds_blocks_is_no_failure(monkeypatch):
    monkeypatch.setattr(blocked_ends, '_seen', [])
    log = f'Ending: no command was active.\n{blocked_ends.WATCHDOG}\n  {blocked_ends.PLACE}\n'
    assert not blocked_ends.is_excused(log.replace(blocked_ends.PLACE, 'in _spin'))
    assert blocked_ends.is_excused(log)
    assert not blocked_ends.is_excused(log)
