# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Calls and modules of this package that one joint state passes, and the messages it serializes.

Each 'call' event of `sys.setprofile` in a function of the package counts as one call. There is
also one for a property, a lambda, a comprehension, and for each start or resumption of a
generator. A module is a file of the package. The tests count from the call of
`JointStateLoop._deliver` to its return, while the node follows a trajectory and only
`effort_command` has a subscriber.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
import statistics
import sys
from typing import Any

from bounded_waits import Collector, wait_until
import numpy as np
import pytest
import robot_dynamics
from robot_dynamics.ros.middleware.cdr_templates import MessageTemplate
from ros_harness import RosClient
from sensor_msgs.msg import JointState
from stepped_node import JOINTS, stepped_node, SteppedNode

WARM_UP, SOFT_START, STATES = 600, 200, 30
PACKAGE = f'{Path(robot_dynamics.__file__).parent}/'


def calls_of_a_state(node: SteppedNode) -> list[tuple[str, str]]:
    """Return module and function of each call that one joint state passes, in order."""
    state, calls = node.next_state(), list[tuple[str, str]]()

    def note(frame: Any, event: str, _: Any) -> None:
        file = frame.f_code.co_filename
        if event == 'call' and file.startswith(PACKAGE):
            name = getattr(frame.f_code, 'co_qualname', frame.f_code.co_name)  # Python 3.11
            calls.append((file.removeprefix(PACKAGE), name))

    with np.errstate(over='ignore', invalid='ignore'):
        sys.setprofile(note)
        try:
            node.deliver(state)
        finally:
            sys.setprofile(None)
    return calls


def check_follows(node: SteppedNode) -> None:
    """Check that no state was dropped and that the trajectory is followed."""
    counters = node.node._path.states
    assert counters.following
    assert not counters.dropped


@pytest.fixture
def following(client: RosClient) -> Iterator[SteppedNode]:
    """Return a node that follows a trajectory."""
    with stepped_node() as node, client.collect(
            JointState, f'{node.namespace}/effort_command') as commands:
        node.follow()
        node.take_states(WARM_UP)
        deliver_until(node, commands)
        node.take_states(SOFT_START)  # which begins when the drive is discovered
        yield node


def deliver_until(node: SteppedNode, received: Collector) -> None:
    """Let the node answer joint states until one of its messages arrives."""

    def is_answered() -> bool:
        node.deliver(node.next_state())
        return bool(received.messages)

    wait_until(is_answered, 'a message of the node')


def test_a_state_passes_few_calls_and_modules(following):
    states = [calls_of_a_state(following) for _ in range(STATES)]
    check_follows(following)
    typical = statistics.median_low(len(calls) for calls in states)
    calls = next(calls for calls in states if len(calls) == typical)
    modules = {file for file, _ in calls}
    assert len(calls) <= 35, Counter(calls)
    assert len(modules) <= 16, modules


# ------------------------------------------------------------------ messages without subscribers

@pytest.fixture
def filled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list of the functions that fill a template, one entry per message."""
    callers, original = list[str](), MessageTemplate.filled

    def noting(template: MessageTemplate, *arguments: Any) -> bytes:
        code = sys._getframe(1).f_code
        callers.append(f'{code.co_filename.removeprefix(PACKAGE)}: {code.co_name}')
        return original(template, *arguments)

    monkeypatch.setattr(MessageTemplate, 'filled', noting)
    return callers


def test_only_efforts_with_subscribers_are_serialized(client, following, filled):
    following.deliver(following.next_state())
    assert len(filled) == 1, filled  # the command
    topic = f'{following.namespace}/dynamics/gravity_compensation'
    with client.collect(JointState, topic) as received:
        deliver_until(following, received)
        filled.clear()
        following.deliver(following.next_state())
        check_follows(following)
        assert len(filled) == 2, filled  # the command, and this effort
        assert len(received.messages[0].effort) == JOINTS
