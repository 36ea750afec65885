# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Commands that are not finite: never published; a fault until the reset."""

from typing import Any

from fault_bench import FaultBench, figure_of
from fault_stimuli import (
    follow,
    NO_STREAM,
    overflow,
    SLIDING,
    SLIDING_G,
    wait_effort,
    wait_states,
)
from fault_table import fault
import pytest
from std_srvs.srv import Trigger

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Non-finite commands'
BENCH = {'parameters': {**NO_STREAM, 'robot_description': SLIDING}}


@pytest.fixture(scope='module')
def bench(bench: FaultBench) -> FaultBench:
    """Return a node that holds the sliding arm."""
    bench.hold = SLIDING_G
    return bench


def reset(bench: FaultBench) -> Any:
    """Call `~/reset_fault`; return the response."""
    return bench.ask('reset_fault', Trigger)


@fault(GROUP, 'six consecutive positions of 10³⁰⁸ m, at which the computed torque overflows',
       'not published; latched fault `non_finite`, which `~/reset_fault` resets once states are '
       'valid; without a fault there is nothing to reset')
def test_an_effort_that_is_not_finite(bench):
    follow(bench, bench.driver.q)
    overflow(bench)
    status = bench.wait_fault('non_finite')
    assert 'are not finite' in status.message
    assert 'waits for ~/reset_fault' in status.message
    bench.wait_dropped('no finite effort')
    answer = reset(bench)
    assert not answer.success
    assert answer.message.startswith('non_finite persists: ')
    bench.driver.go_on()
    bench.efforts.clear()
    wait_effort(bench, SLIDING_G)
    wait_states(bench, 100)
    # the status of the change of the level may be older than the count
    status = bench.wait_figure('command', 'faults: non_finite', 1)
    assert figure_of(status, 'faults: non_finite') == 1
    assert status.message.startswith('fault non_finite')
    answer = reset(bench)
    assert answer.success
    assert answer.message.startswith('reset non_finite: ')
    wait_states(bench, 5)  # the next valid state ends the fault
    answer = reset(bench)
    assert not answer.success
    assert answer.message == 'there is no fault'
