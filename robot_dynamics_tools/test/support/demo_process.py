# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The demo as a process, the nodes that it starts, and its output."""

import os
from pathlib import Path
import re
import subprocess
import sys

import children
import pytest
from ros_harness import TIMEOUT


def start_demo(directory, *arguments, shares_domain=False):
    """Start the demo, which chooses a free ROS domain, or shares that of the tests."""
    environment = {
        name: value for name, value in os.environ.items()
        if name != 'ROS_DOMAIN_ID' or shares_domain}
    return children.popen(
        [sys.executable, '-m', 'robot_dynamics_tools', 'demo', *map(str, arguments)],
        cwd=directory, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True)


def run_demo(directory, *arguments):
    """Run the demo to its end; return its exit status, its output and its error output."""
    with start_demo(directory, *arguments) as process:
        out, err = process.communicate(timeout=4 * TIMEOUT)
        return process.returncode, out, err


def wait_for_line(stream, pattern):
    """Read the output or the progress (stderr) of the demo to a line with this pattern."""
    lines = []
    for line in stream:
        lines.append(line)
        if found := re.search(pattern, line):
            return found
    pytest.fail(f'the demo ended without {pattern!r}: {"".join(lines)}')


def nodes_of(process):
    """Return the processes that the demo has started, by the name of their program."""
    pids = Path(f'/proc/{process.pid}/task/{process.pid}/children').read_text().split()
    commands = {int(pid): Path(f'/proc/{pid}/cmdline').read_text().split('\0') for pid in pids}
    return {words[2].split('.')[-2]: pid for pid, words in commands.items()
            if len(words) > 2 and '.' in words[2]}  # a fork is still the demo


def relative_residuals(out):
    """Return the relative residual of each joint [%]."""
    table = out.partition('Residual, measured')[2].partition('Use of limits')[0]
    return {name: float(fraction) for name, fraction in re.findall(
        r'^(\w+) .*?([\d.]+) % ', table, re.MULTILINE)}
