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

"""From a joint state message to effort messages: the control path of `dynamics`."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.controller import Controller
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.ros.conversions import floats_to_ros, stamp_from_ros, terms_to_ros
from robot_dynamics.ros.effort_check import EffortCheck
from robot_dynamics.ros.joint_states import JointStateReader, OtherJointsError
from robot_dynamics.ros.message_loop import LOG_PERIOD
from robot_dynamics.validation import FloatArray
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

NEWEST_ONLY = QoSProfile(depth=1)
"""Reliable, so that both kinds of subscribers match; what is old has no worth."""


@dataclass
class ControlCounters:
    """What the control path did since the start; read by the diagnostics."""

    states: int = 0
    commands: int = 0
    clamped: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    last_drop: str = ''
    following: bool = False


class ControlPath:
    """Answers each joint state with the efforts for it, under the stamp of that state."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._served: tuple[Controller, JointStateReader, list[str], EffortCheck] | None = None
        self.counters = ControlCounters()

        def publisher(message_type: type, topic: str) -> Any:
            return node.create_publisher(message_type, topic, NEWEST_ONLY)

        self._gravity = publisher(JointState, '~/gravity_compensation')
        self._computed_torque = publisher(JointState, '~/computed_torque')
        self._command = publisher(JointState, 'effort_command')
        self._commands = publisher(Float64MultiArray, '~/commands')
        self._terms = publisher(DynamicsTerms, '~/terms')

    def use(self, controller: Controller, check: EffortCheck) -> None:
        """Serve this arm from the next joint state on, and let `check` look until it is done."""
        names = controller.arm.joint_names
        # all at once: there is a thread
        self._served = controller, JointStateReader(names), list(names), check

    def on_state(self, message: JointState) -> None:
        """Publish the efforts for a joint state; whatever is wrong with it drops it alone."""
        try:
            self._answer(message)
        except OtherJointsError:
            self.counters.dropped['other joints'] += 1
        except RobotDynamicsError as error:
            self._drop('invalid', f'Dropped a joint state: {error}')
        except Exception as error:  # nothing that arrives may end the control path
            self._drop('internal error', f'Dropped a joint state: {error!r}')

    def _drop(self, reason: str, words: str) -> None:
        self.counters.dropped[reason] += 1
        self.counters.last_drop = words
        self._node.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)

    def _answer(self, message: JointState) -> None:
        if self._served is None:
            self.counters.dropped['no model yet'] += 1
            self.counters.last_drop = 'Dropped a joint state: no model yet'
            return
        controller, reader, names, check = self._served
        q, v = reader.read(message)
        with_terms = self._terms.get_subscription_count() > 0
        stamp = message.header.stamp
        output = controller.update(stamp_from_ros(stamp), q, v, with_terms)
        counters = self.counters
        if output.command is not None:
            effort = _effort_message(message, names, output.command)
            self._command.publish(effort)
            self._commands.publish(
                Float64MultiArray(data=effort.effort))
            counters.commands += 1
            counters.clamped += bool(output.clamped.any())
        self._gravity.publish(
            _effort_message(message, names, output.gravity_compensation))
        if output.computed_torque is not None:
            self._computed_torque.publish(
                _effort_message(message, names, output.computed_torque))
        if output.terms is not None:
            self._terms.publish(
                terms_to_ros(output.terms, names, stamp))
        counters.states += 1
        counters.following = output.reference is not None
        if not check.done:
            check.look(
                reader, message, q, v, output.robot_gravity,
                output.command if self._is_commanding() else None)

    def _is_commanding(self) -> bool:
        """Tell whether anybody gets the command."""
        return bool(
            self._command.get_subscription_count() or self._commands.get_subscription_count())


def _effort_message(state: JointState, names: list[str], effort: FloatArray) -> JointState:
    message = JointState()
    message.header.stamp = state.header.stamp
    message.name = names
    message.effort = floats_to_ros(effort)
    return message
