# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The client of docs/trajectories.md, which goes through all results of the action."""

from pathlib import Path
import re
import subprocess
import sys

from children import run, TIMEOUT
from closed_loop import START
from ros_harness import DYNAMICS, NodeProcess, running, SIMULATED_ARM

EXAMPLE = Path(__file__).resolve().parents[2] / 'docs' / 'examples' / 'follow_trajectory.py'
RESULTS = [
    ('to its start', 'SUCCEEDED', 0), ('there', 'SUCCEEDED', 0), ('too fast', 'ABORTED', -1),
    ('another joint', 'ABORTED', -2), ('in the past', 'ABORTED', -3),
    ('off the path', 'ABORTED', -4), ('back', 'SUCCEEDED', 0), ('off the goal', 'ABORTED', -5),
    ('replaced', 'ABORTED', -1), ('cancelled', 'CANCELED', -1)]


def test_the_example_gets_each_result():
    with running(
            NodeProcess(DYNAMICS, {'lock_step': True}),
            NodeProcess(SIMULATED_ARM, {
                'rate': 125.0, 'lock_step': True, 'real_time_factor': 1.0,
                'initial_position': START})):
        done = run([sys.executable, str(EXAMPLE)], stdout=subprocess.PIPE,
                   stderr=subprocess.STDOUT, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stdout
    found = re.findall(r'^(.+?): (\w+), (-?\d)', done.stdout, re.MULTILINE)
    assert [(what, status, int(code)) for what, status, code in found] == RESULTS, done.stdout
