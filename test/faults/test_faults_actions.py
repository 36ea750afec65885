# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Each fault action: the commands during a fault, and the first commands after it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from fault_bench import fault_bench, FaultBench, G, nanoseconds_of, Q, QUICK, STATE_TIMEOUT
from fault_stimuli import check_rate, DIRECT, NO_STREAM, RATE
from fault_table import fault
import numpy as np
import pytest
from ros_harness import RosClient
from sensor_msgs.msg import JointState

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Fault actions'
SILENCE = 'joint states time out'
HOLD, RAMP = QUICK['hold_time'], QUICK['ramp_time']
LIMITS = [150.0, 60.0]
"""Effort limits of the default arm [N·m]."""
SLACK = 0.01
"""Largest offset [s] between the clock of stamps and the clock of timeouts."""
Timed = tuple[float, JointState]
Seen = Callable[[str], Any]
BENCH = {'parameters': {**NO_STREAM, **DIRECT}}


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


def check_course(answer: Timed, action: list[Timed], hold: float) -> None:
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
        assert fraction >= min(1.0, 1.0 - (t - earliest - hold) / RAMP) - 1e-6
    assert action[-1][0] > earliest + hold + RAMP


def check_return(bench: FaultBench) -> None:
    """Check that the node resumes automatically, and that its first command is g(q)."""
    assert bench.first_answer(bench.driver.go_on).effort == pytest.approx(G, abs=1e-6)
    bench.check_alive()
    bench.node.wait_for_log('The fault has ended: commanding again')


@contextmanager
def acting(bench: FaultBench, action: str) -> Iterator[None]:
    """Set the fault action; afterwards the node must resume, with the default action again."""
    bench.set_parameters(fault_action=action)
    bench.check_alive()
    yield
    check_return(bench)
    bench.set_parameters(fault_action='hold_gravity_then_ramp')


@fault(GROUP, f'{SILENCE}; `hold_gravity_then_ramp`',
       'g(q) for `hold_time`, then a linear ramp to zero over `ramp_time`, then no command; '
       'the first command after recovery is g(q)')
def test_hold_gravity_then_ramp(bench, seen):
    answer, action = go_silent(bench)
    check_course(answer, action, HOLD)
    answered, times = answer[0], [t for t, _ in action]
    held = next(i for i, fraction in enumerate(fractions(action)) if fraction < 1.0 - 1e-6)
    seen(f'{times[0] - answered:.3f} s without a command, {times[held] - times[0]:.3f} s of g(q), '
         f'{times[-1] - times[held]:.3f} s of ramp; configured: 0.3 s, 0.3 s and 0.1 s')
    check_return(bench)


@fault(GROUP, 'a set-point 2 rad away with `condition_references: false`; joint states time out '
       'while the command is at the effort limits; `hold_gravity_then_ramp`',
       'the command changes to the effort limits and to g(q) within the rate limit, counted; then '
       'g(q), ramp and no command')
def test_hold_gravity_from_a_large_effort(bench):
    before = bench.known('command', 'held back by effort rate')
    bench.set_point([Q[0] + 2.0, Q[1] + 2.0])
    bench.efforts.wait_for(lambda message: list(message.effort) == LIMITS)
    check_rate(bench.efforts)
    assert all((np.abs(message.effort) <= LIMITS).all() for message in bench.efforts.messages)
    bench.wait_figure('command', 'held back by effort rate', before + 1)
    bench.set_parameters(hold_time=60.0)  # longer than the change to g(q) takes
    bench.efforts.clear()
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    bench.efforts.wait_for(lambda message: message.effort == pytest.approx(G))
    efforts = [message.effort[0] for message in bench.efforts.messages]
    assert efforts == sorted(efforts, reverse=True)
    bench.set_parameters(hold_time=HOLD)
    bench.wait_silent()
    bench.efforts.check_steps(RATE)
    check_return(bench)


@fault(GROUP, f'{SILENCE}; `ramp_to_zero`',
       'an immediate linear ramp to zero over `ramp_time`, then no command; the first command '
       'after recovery is g(q)')
def test_ramp_to_zero(bench):
    with acting(bench, 'ramp_to_zero'):
        check_course(*go_silent(bench), hold=0.0)


@fault(GROUP, f'{SILENCE}; `stop_publishing`',
       'no further command; the first command after recovery is g(q)')
def test_stop_publishing(bench):
    with acting(bench, 'stop_publishing'):
        (_, answer), action = go_silent(bench)
        assert action == []
        assert answer.effort == pytest.approx(G, abs=1e-6)


# --- a robot that compensates gravity ------------------------------------------------------------

@pytest.fixture(scope='module')
def compensating(client: RosClient) -> Iterator[FaultBench]:
    """Return a node for a robot that compensates gravity."""
    with fault_bench(
            client, '/faults_compensating', {'robot_compensates': ['gravity'], **DIRECT},
            stream=False) as one:
        one.hold = [0.0, 0.0]
        yield one


@fault(GROUP, '`robot_compensates: [gravity]`: the first state, a set-point, then a timeout',
       'the first command is zero, and the fault action holds the arm with zero')
def test_a_robot_that_compensates_gravity(compensating):
    bench = compensating
    bench.driver.go_on()
    assert list(bench.efforts.wait_for().effort) == [0.0, 0.0]
    bench.set_point([Q[0] + 2.0, Q[1] + 2.0])
    bench.efforts.wait_for(lambda message: message.effort[0] > 100.0)
    _, action = go_silent(bench)
    efforts = [message.effort[0] for _, message in action]
    assert efforts == sorted(efforts, reverse=True)
    assert efforts[-1] == 0.0
    bench.check_alive()
    for message in bench.efforts.messages:
        assert message.effort == pytest.approx([0.0, 0.0], abs=1e-9)
