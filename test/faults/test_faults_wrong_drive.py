# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A drive whose effort does not brake its joint: a fault until the reset."""

from typing import Any

from fault_bench import FaultBench, figure_of, G, Q
from fault_stimuli import follow, NO_STREAM, run_away, wait_effort, wait_states
from fault_table import fault
import pytest
from std_srvs.srv import Trigger

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Wrong drives'
BENCH = {'parameters': NO_STREAM}


def reset(bench: FaultBench) -> Any:
    """Call `~/reset_fault`; return the response."""
    return bench.ask('reset_fault', Trigger)


@fault(GROUP, 'a joint that becomes faster, above its limit, against the effort that brakes it',
       'released (effort 0); latched fault `wrong_drive`, which `~/reset_fault` resets once '
       'states are valid; without a fault there is nothing to reset')
def test_a_joint_that_its_effort_does_not_brake(bench):
    follow(bench, Q)
    run_away(bench)
    status = bench.wait_fault('wrong_drive')
    assert "'joint1'" in status.message
    assert 'waits for ~/reset_fault' in status.message
    answer = reset(bench)
    assert not answer.success
    assert answer.message.startswith('wrong_drive persists: ')
    bench.efforts.clear()
    bench.driver.go_on()
    wait_effort(bench, [0.0, G[1]])
    wait_states(bench, 100)
    # the status of the change of the level may be older than the count
    status = bench.wait_figure('command', 'faults: wrong_drive', 1)
    assert figure_of(status, 'faults: wrong_drive') == 1
    assert status.message.startswith('fault wrong_drive')
    answer = reset(bench)
    assert answer.success
    assert answer.message.startswith('reset wrong_drive: ')
    wait_states(bench, 5)  # the next valid state ends the fault
    answer = reset(bench)
    assert not answer.success
    assert answer.message == 'there is no fault'
