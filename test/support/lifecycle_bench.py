# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Shared by the tests of models and of the lifecycle: transitions, states, published messages.

The topic of g(q) shows that the node publishes no commands: it continues meanwhile. If a number
of its messages arrive without a command, there is no command.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from fault_bench import FaultBench, nanoseconds_of, STEADY
from fault_stimuli import from_now
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import GetState
from ros_harness import Collector, DYNAMICS, KEEP_MANY, NodeProcess, RosClient, wait_until
from sensor_msgs.msg import JointState

CONFIGURE = Transition.TRANSITION_CONFIGURE
CLEANUP = Transition.TRANSITION_CLEANUP
ACTIVATE = Transition.TRANSITION_ACTIVATE
DEACTIVATE = Transition.TRANSITION_DEACTIVATE
SHUTDOWN = Transition.TRANSITION_ACTIVE_SHUTDOWN
STATES_OF_SILENCE = 50
"""Number of joint states without a command that count as the end of commands."""


class LifecycleBench(FaultBench):
    """A bench whose test chooses the initial state of the node."""

    def __init__(self, *args: Any, **driver: Any) -> None:
        super().__init__(*args, **driver)
        self.gravity: Collector = self.client.collect(
            JointState, self.name('gravity_compensation'), KEEP_MANY)
        self.gravity.wait_matched()

    def state(self) -> str:
        """Return the name of the lifecycle state."""
        return str(self.client.call(GetState, self.name('get_state')).current_state.label)

    def check_silent(self) -> None:
        """Check that the node publishes g(q) for states, and no command."""
        self.wait_ended()
        moment = from_now(self)
        self.gravity.wait_for(lambda m: nanoseconds_of(m.header.stamp) >= moment)
        self.gravity.clear()
        self.gravity.wait_count(STATES_OF_SILENCE)
        assert self.efforts.messages == []

    def wait_ended(self) -> None:
        """Wait for the final zero command if there were commands; discard all messages."""
        wait_until(
            lambda: not self.efforts.messages or not any(self.efforts.messages[-1].effort),
            'the end of the efforts')
        self.efforts.clear()

    def close(self) -> None:
        """Stop the driver and destroy the subscriptions."""
        super().close()
        self.gravity.close()


@contextmanager
def lifecycle_bench(
    client: RosClient, namespace: str, parameters: Mapping[str, Any], hold: Sequence[float] = (),
) -> Iterator[LifecycleBench]:
    """
    Run a node and a driver; messages of other nodes are ignored.

    Commands end with zeros, which `check_silent` waits for.
    """
    diagnostics = f'{namespace}/diagnostics'
    with NodeProcess(
            DYNAMICS, {**STEADY, 'end_action': 'ramp_to_zero', **parameters}, namespace=namespace,
            remaps={'/diagnostics': diagnostics}, ready=None) as node:
        bench = LifecycleBench(client, node, namespace, diagnostics=diagnostics)
        bench.hold = hold or bench.hold
        try:
            bench.driver.start()
            yield bench
        finally:
            bench.close()
            client.forget(namespace)
