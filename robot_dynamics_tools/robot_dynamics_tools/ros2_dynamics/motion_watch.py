# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Publication of a goal, and waits until the node has accepted it and until the arm rests."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
import json
import math
import time
from typing import Any, NoReturn

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from robot_dynamics.arrays import FloatArray, wrap_to_pi
from robot_dynamics.ros.middleware.conversions import stamp_from_ros, trajectory_to_ros
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

AT_GOAL = 1e-6
"""[rad] or [m] within which the reference has reached the goal."""
AT_REST_TIME = 0.5
"""[s] of rest after which the reference has ended elsewhere."""
_REFERENCE_TIME = 1.0
"""[s] within which a reference that is held is received."""
_EARLY = 'ended early: '
STILL = {'prismatic': 4e-4}
"""[m]: displacement within which a joint is at rest; of other joints 2e-3 rad."""
REST_TIME = 0.5
"""[s] by the stamps without motion after which the arm is at rest."""
_RELIABLE, _NEWEST = QoSProfile(depth=100), QoSProfile(depth=1)
"""References that wait on a busy machine would count as the present one."""


class MotionWatch:
    """What a node publishes of its reference and of the arm, while `following` is entered."""

    def __init__(self, client: DynamicsClient, names: Sequence[str], kinds: Sequence[str]) -> None:
        """Watch the joints `names` of the node, of these kinds."""
        self.client, self.names = client, list(names)
        self._turns = np.array([kind == 'continuous' for kind in kinds])
        self.still = np.array([STILL.get(kind, 2e-3) for kind in kinds])
        self.restless = np.zeros(len(names), dtype=bool)
        """Which joints moved last."""
        self.position: dict[str, float] = {}
        """Measured positions by name, and the stamp [ns] of the newest."""
        self.position_ns = -1
        self.reference: tuple[int, tuple[float, ...], tuple[float, ...]] | None = None
        """Stamp [ns], positions and velocities of the newest reference."""
        self.rejections: int | None = None
        self.rejection = ''
        self._accepted: tuple[int, list[float]] = (0, [])
        """How many goals the node has accepted, and the newest of them."""
        self._goal: Sequence[float] = []
        """The goal that the node has accepted, empty before."""
        self._statuses = self._early = 0
        self._status = ''
        self._last_reference = time.monotonic()

    def following(self) -> AbstractContextManager[None]:
        """Receive in `with`."""
        client = self.client
        return client.subscribed(
            (JointState, client.joint_state_topic(), self.on_state, qos_profile_sensor_data),
            (JointState, client.resolve('~/reference'), self._on_reference, _NEWEST),
            (DiagnosticArray, '/diagnostics', self._on_diagnostics, _RELIABLE))

    def on_state(self, message: JointState) -> None:
        self.position |= {
            name: value for name, value in zip(message.name, message.position)
            if name in self.names}
        self.position_ns = stamp_from_ros(message.header.stamp)

    def _on_reference(self, message: JointState) -> None:
        self._last_reference = time.monotonic()
        order = [list(message.name).index(name) for name in self.names]
        self.reference = (
            stamp_from_ros(message.header.stamp), tuple(message.position[i] for i in order),
            tuple(message.velocity[i] for i in order))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f'{self.client.name}: reference':
                values = {pair.key: pair.value for pair in status.values}
                self.rejections = int(values['refused'])
                self.rejection = values['refusal of the latest']
                self._accepted = int(values['accepted']), json.loads(values['goal of the latest'])
                self._status = status.message
                self._statuses += 1
                self._early = self._early + 1 if status.message.startswith(_EARLY) else 0

    # ------------------------------------------------------------------ waits

    def wait_measured(self) -> None:
        """Wait for the measured positions; raise NoAnswerError."""
        client = self.client
        if not client.wait(lambda: len(self.position) == len(self.names)):
            missing = ', '.join(name for name in self.names if name not in self.position)
            raise NoAnswerError(
                f'no joint states of {missing} on {client.joint_state_topic()} in '
                f'{client.timeout:g} s')

    def wait_ready(self) -> None:
        """Wait for the measured positions and for diagnostics; raise NoAnswerError."""
        client = self.client
        self.wait_measured()
        if not client.wait(lambda: self.rejections is not None):
            raise NoAnswerError(f'{client.name} sends no /diagnostics')
        if self._status != 'none':
            client.wait(lambda: self.reference is not None, _REFERENCE_TIME)

    def wait_taken(
        self, goal: Sequence[float] | None, publish: Callable[[], None],
    ) -> Sequence[float]:
        """
        Publish a goal, wait until the node has accepted it, and return it.

        Without a `goal` of the joints it is the one that the node has computed.

        Raises ToolError with the reason of a rejection or if the node has accepted only another
        goal, NoAnswerError.
        """
        known, (count, _) = self.rejections, self._accepted
        self._goal = []
        publish()

        def is_taken() -> bool:
            if self.rejections != known:
                raise ToolError(f'{self.client.name} rejected the goal: {self.rejection}')
            accepted, newest = self._accepted
            return accepted > count and self.reference is not None and (
                goal is None or self.is_at(goal, newest))

        if not self.client.wait(is_taken, max(self.client.timeout, 3.0)):
            if self._accepted[0] > count:
                self._raise_replaced()
            raise NoAnswerError(
                f'{self.client.name} neither accepts nor rejects the goal; its status '
                f'`reference` is: {self._status}')
        self._goal = self._accepted[1] if goal is None else goal
        return self._goal

    def _raise_replaced(self) -> NoReturn:
        raise ToolError(
            f'another goal has replaced this one: {[round(q, 4) for q in self._accepted[1]]}')

    def wait_end(self, goal: Sequence[float], on_progress: Callable[[float], None]) -> None:
        """
        Wait until the reference rests at `goal`; raise ToolError, NoAnswerError.

        `on_progress` receives the time [s] since the call, by the stamps.
        """
        assert self.reference is not None
        start_ns = moving_ns = self.reference[0]
        self._early, self._last_reference = 0, time.monotonic()

        def has_ended() -> bool:
            nonlocal moving_ns
            assert self.reference is not None
            now_ns, position, velocity = self.reference
            if any(velocity):
                moving_ns = now_ns
            on_progress(1e-9 * (now_ns - start_ns))
            self.check_following()
            rest = 0.0 if self.is_at(goal, position) else AT_REST_TIME
            return now_ns - moving_ns > 1e9 * rest

        self.client.wait(has_ended, math.inf)
        while not self.is_at(goal, position := self.reference[1]):
            self._statuses = 0  # the reference may be one from before the goal
            self.client.wait(lambda: self._statuses > 1)
            self.check_following()
            if self.reference[1] == position:
                raise ToolError(
                    f'the reference ended at {[round(value, 4) for value in position]}, not at '
                    'the goal: another reference replaced it, or infeasible_trajectory is clip')
            self.client.wait(has_ended, math.inf)
        end_ns = self.reference[0]
        self.client.wait(lambda: self.position_ns >= end_ns)

    def check_following(self) -> None:
        """
        Raise ToolError if the reference ended early or another goal replaced it.

        Raises NoAnswerError without references.
        """
        if self._early > 1:  # the first status may be from before the goal
            raise ToolError(f'the motion ended early: {self._status.removeprefix(_EARLY)}')
        if len(self._goal) and not self.is_at(self._goal, self._accepted[1]):
            self._raise_replaced()
        if time.monotonic() - self._last_reference > self.client.timeout:
            raise NoAnswerError(
                f'{self.client.name} has sent no ~/reference for {self.client.timeout:g} s; '
                f'its status `reference` is: {self._status}')

    def rest(self) -> Callable[[], int]:
        """Return a function with the stamp [ns] since which no joint has moved."""
        anchor, since_ns = self.measured(), self.position_ns

        def resting_since() -> int:
            nonlocal anchor, since_ns
            moved = np.abs(self.error(anchor, self.measured())) > self.still
            if moved.any():
                anchor, since_ns, self.restless = self.measured(), self.position_ns, moved
            return since_ns

        return resting_since

    def wait_rest(self) -> tuple[int, bool]:
        """Return the stamp [ns] since which the arm rests, or the present one without rest."""
        resting_since = self.rest()

        def rests() -> bool:
            self.check_following()
            return self.position_ns - resting_since() >= 1e9 * REST_TIME

        is_at_rest = self.client.wait(rests)
        return resting_since() if is_at_rest else self.position_ns, is_at_rest

    def is_at(self, goal: Sequence[float], position: Sequence[float]) -> bool:
        """Return whether a reference has reached a goal."""
        return bool(np.abs(self.error(goal, position)).max() < AT_GOAL)

    def error(self, goal: Sequence[float], position: Sequence[float]) -> FloatArray:
        """Return goal minus position (n,); of continuous joints the shortest angle."""
        error = np.subtract(goal, position)
        return np.where(self._turns, wrap_to_pi(error), error)

    def measured(self) -> list[float]:
        """Return the measured positions in the order of the node."""
        return [self.position[name] for name in self.names]


@contextmanager
def goal_publication(
    client: DynamicsClient, names: Sequence[str],
) -> Iterator[Callable[[Sequence[float], float], None]]:
    """
    Yield a function that publishes a goal, once the node and all others have subscribed.

    It takes the goal and the duration [s] of the motion. The goal is one point, so that the node
    plans the motion from its present reference. Raises NoAnswerError without a subscription of
    the node.
    """
    with publication(client, JointTrajectory, '~/joint_trajectory') as publish:
        yield lambda goal, duration: publish(
            trajectory_to_ros(make_trajectory(names, [duration], [goal])))


@contextmanager
def publication(
    client: DynamicsClient, message_type: type, topic: str,
) -> Iterator[Callable[[Any], None]]:
    """Yield a function that publishes, once the node and all others have subscribed."""
    topic, node = client.resolve(topic), client.node
    publisher = node.create_publisher(message_type, topic, _RELIABLE)

    def has_subscriber() -> bool:
        subscriptions = node.get_subscriptions_info_by_topic(topic)
        return client.name in [
            f'{one.node_namespace.rstrip("/")}/{one.node_name}' for one in subscriptions
        ] and publisher.get_subscription_count() >= len(subscriptions)

    try:
        if not client.wait(has_subscriber):
            raise NoAnswerError(
                f'{client.name} does not subscribe to {topic} in {client.timeout:g} s')
        yield publisher.publish
    finally:
        node.destroy_publisher(publisher)
