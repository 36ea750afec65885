# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
What RViz draws of `dynamics`: `~/markers`, for those who listen.

The control path leaves the newest state here while somebody subscribes; a timer that runs as long
draws it in the executor's thread. Without subscribers there is neither.
"""

import time
from typing import NamedTuple

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller, ControlOutput
from robot_dynamics.pictures.arm_marks import ArmMarks
from robot_dynamics.ros.conversions import stamp_to_ros
from robot_dynamics.ros.dynamics.marker_messages import drawn
from visualization_msgs.msg import MarkerArray

PERIOD = 1.0 / 30.0
"""[s] between two pictures, on the steady clock."""
TIME_FRACTION = 0.1
"""Share of the time that drawing may take; arms of many joints are drawn less often."""


class _Seen(NamedTuple):
    """What is drawn of a state: all (n,)."""

    stamp_ns: int
    q: FloatArray
    effort: FloatArray
    external: FloatArray | None


class LiveMarkers:
    """Publishes markers; `look` is for the control path's thread, the rest for the executor's."""

    def __init__(self, node: Node) -> None:
        self._controller: Controller | None = None
        self._marks: tuple[object, ArmMarks] | None = None
        self._frame = ''
        self._seen: _Seen | None = None
        self._rests_until = 0.0
        self.is_on = False
        """Whether somebody listens."""
        self._timer = node.create_timer(
            PERIOD, self._draw, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        self._publisher = node.create_publisher(
            MarkerArray, '~/markers', QoSProfile(depth=1),
            event_callbacks=PublisherEventCallbacks(matched=self._match))

    def _match(self, event: object) -> None:
        self.is_on = self._publisher.get_subscription_count() > 0
        if self.is_on:
            self._timer.reset()
        else:
            self._timer.cancel()
            self._seen = None  # not to be drawn when somebody comes again

    def use(self, controller: Controller, frame: str) -> None:
        """Draw this arm, whose base link is `frame`, from the next state on."""
        self._controller, self._frame = controller, frame
        self._seen = self._marks = None

    def forget(self) -> None:
        """Draw nothing."""
        self._controller = self._seen = self._marks = None

    def look(
        self, stamp_ns: int, q: FloatArray, output: ControlOutput, external: FloatArray | None,
    ) -> None:
        """Take a state whose command is out, and the estimate of the external effort (n,)."""
        effort = output.computed_torque
        self._seen = _Seen(
            stamp_ns, q, output.gravity_compensation if effort is None else effort, external)

    def _draw(self) -> None:
        began, controller = time.monotonic(), self._controller
        if controller is None or began < self._rests_until:
            return
        seen, self._seen = self._seen, None
        arm = controller.loaded_arm
        if seen is None or len(seen.q) != arm.joint_count:  # of the arm before
            return
        if self._marks is None or self._marks[0] is not arm:
            self._marks = arm, ArmMarks(arm)
        with np.errstate(over='ignore', invalid='ignore'):
            message = drawn(self._marks[1], arm, seen.q, seen.effort, seen.external)
        stamp = stamp_to_ros(seen.stamp_ns)
        for marker in message.markers:
            marker.header.frame_id, marker.header.stamp = self._frame, stamp
        self._publisher.publish(message)
        self._rests_until = began + (time.monotonic() - began) / TIME_FRACTION
