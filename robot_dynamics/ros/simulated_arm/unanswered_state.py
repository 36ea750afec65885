# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The reason why a joint state of `simulated_arm` in lock-step gets no effort."""

import time

from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from robot_dynamics.arrays import NANOSECONDS_PER_SECOND
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks

UNANSWERED_AFTER = 0.7
"""[s] without an effort for a state after which the reason is logged."""


class UnansweredState:
    """Watches one joint state until its effort arrives, and logs why none does."""

    def __init__(
        self, node: GuardedCallbacks, states: Publisher, efforts: Subscription, stamp_ns: int,
        previous_ns: int,
    ) -> None:
        """
        Wait for the effort under `stamp_ns`; one under `previous_ns` may still arrive.

        `states` publishes the joint states, `efforts` receives the efforts.
        """
        self._node, self._states, self._efforts = node, states, efforts
        self._stamp_ns, self._previous_ns = stamp_ns, previous_ns
        self._since = time.monotonic()
        self._others = self._other_ns = 0

    def receive_other(self, stamp_ns: int) -> None:
        """Count an effort under another stamp than that of the state [ns]."""
        if stamp_ns != self._previous_ns:
            self._others, self._other_ns = self._others + 1, stamp_ns

    def log_reason(self) -> None:
        """Log the reason if the state has been unanswered for too long."""
        waited = time.monotonic() - self._since
        if waited >= UNANSWERED_AFTER:
            kind, reason = self._reason()
            self._node.log_rarely(
                f'lock_step: {kind}', self._node.get_logger().warning,
                f'lock_step: no effort for the joint state of {_seconds(self._stamp_ns)} s for '
                f'{waited:.1f} s: {reason}')

    def _reason(self) -> tuple[str, str]:
        """Return the kind of the reason, and the reason."""
        states, efforts = self._states.topic_name, self._efforts.topic_name
        if self._states.get_subscription_count() == 0:
            return 'subscriber', (
                f'{states} has no subscriber, expected a controller such as dynamics')
        if self._efforts.get_publisher_count() == 0:
            return 'publisher', (
                f'{efforts} has no publisher, expected a controller such as dynamics')
        if self._others == 0:
            return 'silence', (
                f'the publisher of {efforts} has sent no valid effort since. lock_step needs an '
                'effort for every state; use lock_step:=false behind ros2_control')
        stamp = f'{_seconds(self._other_ns)} s' if self._other_ns else '0 (none)'
        return 'stamps', (
            f'{self._others} efforts arrived on {efforts} under other stamps, the last is '
            f'{stamp}. lock_step needs efforts under the stamp of the state; use '
            'lock_step:=false behind ros2_control')


def _seconds(stamp_ns: int) -> str:
    return f'{stamp_ns / NANOSECONDS_PER_SECOND:.3f}'
