# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Fault actions: the commands during a fault, and the first commands after it."""

from fault_bench import FaultBench, G, nanoseconds_of, QUICK, STATE_TIMEOUT
from fault_table import fault
import numpy as np
import pytest
from sensor_msgs.msg import JointState

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Fault actions'
SILENCE = 'joint states time out'
HOLD, RAMP = QUICK['hold_time'], QUICK['ramp_time']
SLACK = 0.01
"""Largest offset [s] between the clock of stamps and the clock of timeouts."""
Timed = tuple[float, JointState]


def wait_ended(bench: FaultBench) -> None:
    """Wait until the node publishes no command between two of its diagnostic reports."""
    before = -1
    while (published := bench.figure('command', 'published')) != before:
        before = published


def go_silent(bench: FaultBench) -> tuple[Timed, list[Timed]]:
    """
    Stop the driver's joint states until the fault action has ended.

    Return the command that answered the last state, and the commands of the fault action.
    """
    bench.efforts.clear()
    bench.efforts.wait_for()
    bench.driver.be_quiet()
    assert 'no valid joint state for 0.3 s' in bench.wait_state_timeout().message
    wait_ended(bench)
    efforts = bench.efforts.published()
    last = efforts[-1][1].header.stamp
    first = next(i for i, (_, message) in enumerate(efforts) if message.header.stamp == last)
    return efforts[first], efforts[first + 1:]


def fractions(efforts: list[Timed]) -> list[float]:
    """Return each command as a fraction of g(q); fail if one is not a multiple of g(q)."""
    found = []
    for _, message in efforts:
        fraction = message.effort[0] / G[0]
        assert message.effort == pytest.approx(fraction * np.array(G), abs=1e-6)
        found.append(fraction)
    return found


def check_course(answer: Timed, action: list[Timed]) -> None:
    """
    Check that the commands decrease from g(q) to zero, and not faster than specified.

    A command that is published late is smaller than a punctual one. The number of commands and
    their delays depend on the load of the machine. test_safety_promises.py checks the exact
    values at given times.
    """
    found = fractions(action)
    assert found == sorted(found, reverse=True)
    assert found[-1] == 0.0
    earliest = 1e-9 * nanoseconds_of(answer[1].header.stamp) + STATE_TIMEOUT - SLACK
    assert action[0][0] > earliest
    for (t, _), fraction in zip(action, found):
        assert fraction >= min(1.0, 1.0 - (t - earliest - HOLD) / RAMP) - 1e-6
    assert action[-1][0] > earliest + HOLD + RAMP


def check_return(bench: FaultBench) -> None:
    """Check that the node resumes automatically, and that its first command is g(q)."""
    assert bench.first_answer(bench.driver.go_on).effort == pytest.approx(G, abs=1e-6)
    bench.check_alive()
    bench.node.wait_for_log('The fault has ended: commanding again')


@fault(GROUP, f'{SILENCE}; `hold_gravity_then_ramp`',
       'g(q) for `hold_time`, then a linear ramp to zero over `ramp_time`, then no command; '
       'the first command after recovery is g(q)')
def test_hold_gravity_then_ramp(bench, seen):
    answer, action = go_silent(bench)
    check_course(answer, action)
    answered, times = answer[0], [t for t, _ in action]
    held = next(i for i, fraction in enumerate(fractions(action)) if fraction < 1.0 - 1e-6)
    seen(f'{times[0] - answered:.3f} s without a command, {times[held] - times[0]:.3f} s of g(q), '
         f'{times[-1] - times[held]:.3f} s of ramp; configured: 0.3 s, 0.3 s and 0.1 s')
    check_return(bench)


@fault(GROUP, f'{SILENCE}; `stop_publishing`',
       'no further command; the first command after recovery is g(q)')
def test_stop_publishing(bench):
    bench.set_parameters(fault_action='stop_publishing')
    bench.check_alive()
    (_, answer), action = go_silent(bench)
    assert action == []
    assert answer.effort == pytest.approx(G, abs=1e-6)
    check_return(bench)
