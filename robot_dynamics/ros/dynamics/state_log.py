# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Logs and counters of `dynamics` for dropped, incomplete and degraded joint states."""

import math
import time

from rclpy.node import Node
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.monitoring.velocity_estimate import SPAN
from robot_dynamics.ros.dynamics.control_counters import ControlCounters
from robot_dynamics.ros.message_loop import LOG_PERIOD

COMPLETION_TIME = 1.0
"""[s] without a complete state after which the missing joints are logged."""
REMEDIES = {
    'too old': 'synchronise the clocks of driver and computer, or set `state_max_age`',
    'from the future': 'synchronise the clocks of driver and computer, or set `state_max_age`',
    'stamp went back': 'stop all but one publisher of the joints of this arm',
    'jump': 'stop all but one publisher of the joints of this arm',
    'stamp jumped ahead': 'stop all but one publisher of the joints of this arm',
    'unreadable': 'expected a sensor_msgs/msg/JointState: check the driver',
}
"""Remedy for dropped joint states, by reason."""


class StateLog:
    """
    Logs at most one line per kind and LOG_PERIOD.

    rclpy throttles per source line, but `warn` is one source line for all kinds.
    """

    def __init__(self, node: Node, counters: ControlCounters) -> None:
        self._node, self._counters = node, counters
        self.bandwidth_scale = self._reported_scale = 1.0
        self._refused = ''
        self._logged_at: dict[str, float] = {}

    def warn(self, kind: str, words: str) -> None:
        """Log a warning of a kind."""
        now = time.monotonic()
        if now - self._logged_at.get(kind, -math.inf) >= LOG_PERIOD:
            self._logged_at[kind] = now
            self._node.get_logger().warning(words)

    def count(self, reason: str) -> None:
        """Count a dropped state without logging it."""
        self._counters.dropped[reason] += 1
        self._counters.last_drop = f'Dropped a joint state: {reason}'

    def drop(self, reason: str, words: str) -> None:
        """Count and log a dropped state, with the remedy."""
        remedy = REMEDIES.get(reason)
        words = f'{words}; {remedy}' if remedy is not None else words
        self._counters.dropped[reason] += 1
        self._counters.last_drop = words
        self.warn('dropped', words)

    def part(self, missing: list[str], seconds: float) -> None:
        """Count a message that completes no state; log it if `seconds` passed without one."""
        self._counters.incomplete += 1
        self._counters.missing = tuple(missing)
        if seconds > COMPLETION_TIME:
            self.warn(
                'incomplete',
                f'No joint state is complete: there are no new samples of {missing}. Publish '
                'them on joint_states, or set the parameter joints to the joints in use.')

    def refuse_embedded(self, words: str) -> None:
        """Count a state of another robot than the embedded arm; log the first one."""
        self._counters.dropped['not the embedded arm'] += 1
        self._counters.last_drop = f'Nothing is published: {words}'
        if words != self._refused:
            self._refused = words
            self._node.get_logger().error(self._counters.last_drop)

    def quality(self, loop: ControlLoop, is_estimated: bool, output: ControlOutput) -> None:
        """Log the source of the velocities, their contradictions and the gain scaling."""
        controller, v = loop.controller, output.velocity
        source = 'measured' if not is_estimated else (
            'estimated from positions' if v is not None else 'missing')
        if is_estimated and (v is not None or not controller.estimates_velocity):
            self._velocities(source)
        self._counters.velocities = source if v is not None or not is_estimated else (
            self._counters.velocities)
        if output.scale != self.bandwidth_scale:
            self._bandwidth(controller)

    def _velocities(self, source: str) -> None:
        """Log once that the joint states have no velocities, and the effect of that."""
        if source == self._counters.velocities:
            return
        self._counters.velocities = source
        self._node.get_logger().warning(
            'The joint states have no velocities: only gravity is compensated, and no reference '
            'is followed. Publish velocities, or set require_measured_velocities to false.'
            if source == 'missing' else
            'The joint states have no velocities: they are estimated from the positions, over '
            f'{1e3 * SPAN:g} ms or one period, and the gains are lowered if necessary.')

    def _bandwidth(self, controller: Controller) -> None:
        """Log the gain scaling if it has changed much."""
        scale = self.bandwidth_scale = controller.bandwidth_scale
        if not controller.knows_quality or (
                0.8 < scale / self._reported_scale < 1.25 and scale < 1.0):
            return
        if scale != self._reported_scale:
            self._node.get_logger().info(
                f'Gains and references at {scale:.2f} of their bandwidth: {controller.quality}.',
                throttle_duration_sec=LOG_PERIOD)
        self._reported_scale = scale
