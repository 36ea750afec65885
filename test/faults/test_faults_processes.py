# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of the driver and of the node as processes: timeouts, stalls and SIGKILL."""

import os
import signal
import threading
import time

from fault_bench import G, LONGEST_STEP, STEADY
from fault_stimuli import wait_effort
from fault_table import fault
from joint_state_driver import DriverProcess
import numpy as np
import pytest
from ros_harness import wait_until

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Timeouts, stalls and kills of processes'
SOON = 'the fault action starts after `state_timeout` and is reported'
BACK = 'commands resume with the next state'
STALL, SHORT_TIMEOUT = 0.2, 0.1
"""Duration of a stall, the stimulus of a test, and the timeout that it exceeds [s]."""
BENCH = {'driver_type': DriverProcess}


# --- the driver ----------------------------------------------------------------------------------

@fault(GROUP, 'SIGKILL of the driver', f'{SOON}; {BACK}, which another driver publishes')
def test_the_driver_is_killed(bench):
    bench.driver.kill()
    bench.wait_state_timeout()
    bench.wait_silent()


@fault(GROUP, 'SIGSTOP of the driver, SIGCONT when commands have ended', f'{SOON}; {BACK}')
def test_the_driver_is_stopped_and_continued(bench):
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    bench.wait_silent()


# --- the node ------------------------------------------------------------------------------------

@fault(GROUP, 'the node stalls for 200 ms, `state_timeout` 0.1 s, while the command changes at '
       '`effort_rate_limit`',
       'the node answers the next state or reports the timeout; the command continues from the '
       f'last one, within `effort_rate_limit` times {LONGEST_STEP:g} s')
def test_the_node_stalls(bench):
    rate = 100.0
    bench.set_parameters(effort_rate_limit=rate)
    try:
        bench.check_alive()
        bench.set_point([1.3, 0.0])  # far away, so that the command changes for long
        bench.efforts.wait_for(lambda m: abs(m.effort[0] - G[0]) > 1.0)
        bench.set_parameters(state_timeout=SHORT_TIMEOUT)
        os.kill(bench.node.pid, signal.SIGSTOP)
        threading.Event().wait(STALL)
        continued = time.time()
        os.kill(bench.node.pid, signal.SIGCONT)
        wait_until(lambda: bench.efforts.published()[-1][0] > continued, 'an effort')
        bench.set_point(bench.driver.q)
        wait_effort(bench, G)
        times = [t for t, _ in bench.efforts.published()]
        bench.efforts.check_steps(rate)
        after = int(np.searchsorted(times, continued))
        assert times[after] - times[after - 1] > SHORT_TIMEOUT
        bench.check_alive()
    finally:
        bench.set_parameters(**STEADY, effort_rate_limit=0.0)
