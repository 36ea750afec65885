# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of the first joint states after the start, and joint states at an excessive rate."""

import time

from fault_bench import NAMES, nanoseconds_of, Q
from fault_stimuli import altered, shifted, wait_states
from fault_table import fault
from joint_state_driver import DriverProcess
import numpy as np
from sensor_msgs.msg import JointState

GROUP = 'First joint states'
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


@fault('Joint states at an excessive rate', 'joint states as fast as a process can publish them, '
       'until 500 are answered',
       'newer ones are answered, older ones are skipped; services answer; normal operation '
       'afterwards')
def test_a_flood(bench):
    bench.check_alive()
    bench.driver.be_quiet()
    flood = DriverProcess(bench.client, f'{bench.namespace}/joint_states', rate=1e6).start()
    try:
        bench.efforts.clear()
        moment = time.time_ns()
        bench.efforts.wait_for(lambda message: nanoseconds_of(message.header.stamp) > moment)
        bench.check_answers()
        bench.efforts.wait_count(500)
    finally:
        flood.close()
    stamps = [nanoseconds_of(message.header.stamp) for message in bench.efforts.messages
              if nanoseconds_of(message.header.stamp) > moment]
    assert all(step >= 0 for step in np.diff(stamps))
    bench.check_alive()
