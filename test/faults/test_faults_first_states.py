# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of the first joint states after the start, and joint states at an excessive rate."""

import os
from pathlib import Path
import subprocess
import sys
import time

import children
from fault_bench import NAMES, nanoseconds_of, Q
from fault_stimuli import altered, shifted, wait_states
from fault_table import fault
import numpy as np
from ros_harness import TIMEOUT
from sensor_msgs.msg import JointState

GROUP = 'First joint states'
FLOOD = Path(__file__).parents[1] / 'support' / 'state_flood.py'
BENCH = {'stream': False}
"""The node receives no valid joint state until the last tests of this module."""


FIRST = (
    (lambda _: JointState(), 'dropped: other joints'),
    (altered(name=NAMES[:1], position=Q[:1], velocity=[]), "no samples of ['joint2']"),
    (altered(position=[Q[0], float('nan')]), 'is nan'),
    (shifted(-10.0), 's old'),
    (shifted(10.0), 's in the future'))
"""Changes of the first joint states, and what the diagnostics report."""


@fault(GROUP, 'first joint states: empty, without a joint, NaN in a position, stamps 10 s in the '
       'past, then in the future', 'dropped and reported; no command')
def test_nothing_before_the_first_valid_state(bench):
    for change, reported in FIRST:
        bench.driver.stream_changed(change)
        bench.wait_status('joint states', lambda one, text=reported: text in str(one))
        wait_states(bench, 20)
        assert bench.status('command').message == 'waiting for the first state'
    bench.driver.be_quiet()
    assert bench.figure('command', 'published') == 0
    assert bench.efforts.messages == []


@fault(GROUP, 'a set-point 2 rad away, sent before the first valid state',
       'rejected with the reason; the first command is g(q), and the arm is held')
def test_the_first_effort(bench):
    bench.set_point([Q[0] + 2.0, Q[1]])
    bench.node.wait_for_log('no joint state has been received')
    bench.driver.go_on()
    bench.check_hold(100)
    bench.check_alive()


@fault('Joint states at an excessive rate', '20,000 joint states per second for 1 s',
       'the newest is answered, older ones are skipped; services answer; normal operation '
       'afterwards')
def test_a_flood(bench, seen):
    bench.check_alive()
    bench.driver.be_quiet()
    flood = children.popen(
        [sys.executable, str(FLOOD), f'{bench.namespace}/joint_states', '20000', '1'],
        stdout=subprocess.PIPE, text=True, env=os.environ)
    try:
        bench.efforts.clear()
        moment = time.time_ns()
        bench.efforts.wait_for(lambda message: nanoseconds_of(message.header.stamp) > moment)
        bench.check_answers()
        output, _ = flood.communicate(timeout=TIMEOUT)
    finally:
        flood.kill()
        flood.wait()
    sent, _ = map(int, output.split())
    stamps = [nanoseconds_of(message.header.stamp) for message in bench.efforts.messages
              if nanoseconds_of(message.header.stamp) > moment]
    assert all(step >= 0 for step in np.diff(stamps))
    assert 0 < len(stamps) <= sent
    seen(f'{sent} sent in 1 s, {len(stamps)} answered')
    bench.check_alive()
