# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The work per message and per call, counted instead of timed, so that every increase is detected.

The tests count calls of Python functions, and of functions in C that Python calls. Bounds leave
a margin of a fifth for versions of Python and of libraries; a change that needs more has to state
the reason.
"""

from collections.abc import Iterator
import sys

from counted_calls import calls_of
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.model.unchecked_rigid_body import HAS_PARALLEL_RNEA
from stepped_node import chain, JOINTS, stepped_node, SteppedNode

# ------------------------------------------------------------------------------ the control path

@pytest.fixture
def node() -> Iterator[SteppedNode]:
    with stepped_node() as one:
        yield one


def test_messages_leave_nothing_behind(node):
    node.follow()
    node.take_states(5100)  # no report of the diagnostics takes the arrivals, at most 5000
    loop, growth = node.node._path.loop, []
    answered = loop.states
    for _ in range(4):  # other threads of the process may allocate during one of them
        before = sys.getallocatedblocks()
        node.take_states(500)
        growth.append(sys.getallocatedblocks() - before)
    assert loop.states == answered + 2000
    assert min(growth) < 25, growth


# ------------------------------------------------------------------------------ the library

@pytest.mark.skipif(not HAS_PARALLEL_RNEA, reason='this Pinocchio was built without OpenMP')
def test_a_batch_costs_no_calls_for_a_sample():
    dynamics = ArmDynamics(load_arm(chain(JOINTS)))
    rows = np.zeros((3, 5000, JOINTS))
    few = calls_of(lambda: dynamics.inverse_dynamics_batch(*rows[:, :500])).total()
    many = calls_of(lambda: dynamics.inverse_dynamics_batch(*rows)).total()
    assert many <= 10 * few
