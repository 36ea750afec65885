# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Unexpected exceptions in callbacks: they are answered and logged; the node continues."""

from collections.abc import Iterator
import re
import time

from failing_node import WORDS
from fault_bench import FaultBench, STEADY
from fault_table import fault, fault_cases
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
import pytest
from ros_harness import NodeProcess, RosClient
from std_msgs.msg import String
from std_srvs.srv import Trigger

GROUP = 'Exceptions in callbacks'
LOG_PERIOD = 5.0
"""[s] between two lines about the same callback."""
REPORTED = 'at most one log line per 5 s; control continues'
CALLS = 10


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[FaultBench]:
    """Return a commanding node with failing callbacks; tests restore its state."""
    with NodeProcess('failing_node', STEADY, namespace='/failing') as node:
        one = FaultBench(client, node, '/failing')
        one.driver.start()
        one.check_commanding()
        yield one
        one.close()


def check_reported(bench: FaultBench, of: str, words: str, since: float) -> None:
    """Check that the log reports a callback, at the limited rate since a time."""
    line = bench.node.wait_for_log(f'The callback of {of} failed: internal error: {words}')
    assert '[ERROR]' in line
    lines = re.findall(f'The callback of {of} failed', bench.node.log)
    assert len(lines) <= 1 + (time.monotonic() - since) / LOG_PERIOD, bench.node.log
    assert 'Traceback' not in bench.node.log
    assert bench.figure('model', 'callbacks that failed') >= CALLS
    bench.check_commanding()


@fault_cases(
    ('service', 'kind', 'words'), GROUP, 'a service that {}',
    f'`success` false and the exception; {REPORTED}', (
        ('raises an exception', 'raises', Trigger, rf"ZeroDivisionError\('{WORDS}'\)"),
        ('returns another type', 'answers_another_type', Trigger,
         r'TypeError\(.the service .* answered .*SetBool')))
def test_a_service_that_fails(bench, service, kind, words):
    begun = time.monotonic()
    for _ in range(CALLS):
        response = bench.ask(service, kind)
        assert not response.success
        assert re.search(f'^internal error: {words}', response.message), response.message
    check_reported(bench, f'~/{service}', words, begun)


@fault(GROUP, 'a subscription that raises an exception', REPORTED)
def test_a_subscription_that_fails(bench):
    begun = time.monotonic()
    publisher = bench.client.publisher(String, bench.name('raises'))
    for _ in range(CALLS):
        publisher.publish(String())
    check_reported(bench, '~/raises', 'ZeroDivisionError', begun)


@fault(GROUP, 'a parameter callback that raises an exception',
       f'rejected with the exception; the value stays; {REPORTED}')
def test_a_parameter_callback_that_fails(bench):
    node = bench.name('').rstrip('/')
    before, begun = bench.client.get_parameter(node, 'hold_time'), time.monotonic()
    for _ in range(CALLS):
        reason = bench.client.rejection(node, 'hold_time', before + 1.0)
        assert reason == f"internal error: ZeroDivisionError('{WORDS}')"
    assert bench.client.get_parameter(node, 'hold_time') == before
    check_reported(bench, 'dynamics/set_parameters', 'ZeroDivisionError', begun)


@fault(GROUP, 'a lifecycle transition that raises an exception',
       '`success` false; the command has ended; the node is unconfigured and can be '
       'configured')
def test_a_transition_that_fails(bench):
    bench.check_commanding()
    assert bench.change(Transition.TRANSITION_DEACTIVATE)
    assert not bench.change(Transition.TRANSITION_CLEANUP)
    state = bench.ask('get_state', GetState).current_state
    assert state.id == State.PRIMARY_STATE_UNCONFIGURED
    assert bench.change(Transition.TRANSITION_CONFIGURE)
    assert bench.change(Transition.TRANSITION_ACTIVATE)
    bench.check_commanding()
