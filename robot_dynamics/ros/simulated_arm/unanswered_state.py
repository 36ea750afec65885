# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The reason why a joint state of `simulated_arm` in lock-step gets no effort."""

from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from robot_dynamics.arrays import NANOSECONDS_PER_SECOND


def reason_of_silence(
    states: Publisher, efforts: Subscription, others: int, other_ns: int,
) -> tuple[str, str]:
    """
    Return why no effort has arrived for a joint state: the kind of the reason, and the reason.

    `states` publishes the joint states, `efforts` receives the efforts. `others` efforts have
    arrived under other stamps, the last of which is `other_ns`.
    """
    if states.get_subscription_count() == 0:
        return 'subscriber', (
            f'{states.topic_name} has no subscriber, expected a controller such as dynamics')
    if efforts.get_publisher_count() == 0:
        return 'publisher', (
            f'{efforts.topic_name} has no publisher, expected a controller such as dynamics')
    if others == 0:
        return 'silence', (
            f'the publisher of {efforts.topic_name} has sent no valid effort since. lock_step '
            'needs an effort for every state; use lock_step:=false behind ros2_control')
    stamp = f'{seconds(other_ns)} s' if other_ns else '0 (none)'
    return 'stamps', (
        f'{others} efforts arrived on {efforts.topic_name} under other stamps, the last is '
        f'{stamp}. lock_step needs efforts under the stamp of the state; use lock_step:=false '
        'behind ros2_control')


def seconds(stamp_ns: int) -> str:
    """Return a stamp [ns] in seconds as text."""
    return f'{stamp_ns / NANOSECONDS_PER_SECOND:.3f}'
