# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The limit of the effort, which changes the command."""

from fault_bench import figure_of, Q
from fault_stimuli import check_rate, NO_STREAM, UNFOLLOWED, wait_effort
from fault_table import fault
import numpy as np
from robot_dynamics.ros.dynamics.command_status import CommandCounters

GROUP = 'Limits'
EFFORT = 150.0, 60.0
"""Effort limits [N·m]."""
STIFF = {'gains.natural_frequency': [100.0]}
"""A gain that requests more than the effort limit at 0.2 rad of error, at any velocity."""
BENCH = {'parameters': {**NO_STREAM, **UNFOLLOWED}}


@fault(GROUP, 'a reference that needs more than the effort limit; then `effort_limit_fraction` is '
       'lowered to 0.5', 'clamped to the URDF limit × `effort_limit_fraction`, counted; changes '
       'within the rate limit')
def test_an_effort_beyond_its_limit(bench):
    bench.check_alive()
    bench.set_parameters(**STIFF)
    before = bench.known('command', 'held back by effort limit')
    for sign in (-1.0, 1.0):
        bench.set_point(np.add(Q, 0.2 * sign).tolist())
        wait_effort(bench, sign * np.array(EFFORT))
    bench.wait_status('command', lambda status: (
        figure_of(status, 'held back by effort limit') > before
        and status.message == 'held back by a limit'))
    bench.set_parameters(effort_limit_fraction=0.5)
    wait_effort(bench, [75.0, 30.0])
    messages = bench.efforts.messages
    assert all((np.abs(message.effort) <= EFFORT).all() for message in messages)
    check_rate(bench.efforts)


def test_each_limit_is_counted_by_its_name():
    counters = CommandCounters()
    names = ('position limit', 'velocity limit', 'effort rate')
    for k in range(3):
        counters.count_limits(names[k:])
    assert counters.figures == {
        'published': 0, 'held back by position limit': 1, 'held back by velocity limit': 2,
        'held back by effort rate': 3}
