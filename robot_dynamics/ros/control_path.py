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
from collections.abc import Callable
from dataclasses import dataclass, field
import threading
import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.command_supervisor import Fault, SafetyOptions
from robot_dynamics.controller import Controller, ControlOutput, NonFiniteEffortError
from robot_dynamics.effort_guard import GuardLimits
from robot_dynamics.event_timing import EventTiming
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.ros.conversions import stamp_to_ros, terms_to_ros
from robot_dynamics.ros.effort_check import EffortCheck
from robot_dynamics.ros.joint_states import JointStateReader, OtherJointsError
from robot_dynamics.ros.live_estimates import Estimates, LiveEstimates
from robot_dynamics.ros.live_markers import LiveMarkers
from robot_dynamics.ros.message_bytes import UnreadableMessageError
from robot_dynamics.ros.message_loop import LOG_PERIOD
from robot_dynamics.ros.safe_command import SafeCommand
from robot_dynamics.ros.serialized import (
    effort_template,
    MessageTemplate,
    SensedState,
    state_template,
)
from robot_dynamics.set_point_stream import SetPointStream
from robot_dynamics.state_watch import ImplausibleStateError, StateWatch
from robot_dynamics.trajectory import JointTrajectory
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState

CONFLICT_RECOVERY = 100
"""Good states in a row after which publishers that contradicted each other agree again."""
NEWEST_ONLY = QoSProfile(depth=1)
"""Reliable, so that both kinds of subscribers match; what is old has no worth."""


@dataclass
class ControlCounters:
    """What the control path did since the start; read by the diagnostics."""

    states: int = 0
    repeated: int = 0
    timing: EventTiming = field(default_factory=lambda: EventTiming(time.monotonic()))
    restarts: Counter[str] = field(default_factory=Counter)
    dropped: Counter[str] = field(default_factory=Counter)
    last_drop: str = ''
    following: bool = False
    lacks_velocity: bool = False
    paused_streams: int = 0


@dataclass(frozen=True, eq=False)
class _Served:
    controller: Controller
    reader: JointStateReader
    names: list[str]
    template: MessageTemplate
    reference_template: MessageTemplate
    watch: StateWatch
    check: EffortCheck


class ControlPath:
    """Answers each joint state with the efforts for it, under the stamp of that state."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._served: _Served | None = None
        self._answering = threading.Lock()
        self._stream = SetPointStream()
        self._state_max_age = 0.0
        self.count_publishers: Callable[[], int] = lambda: 1
        """Tells how many publishers of joint states there are."""
        self.counters = ControlCounters()

        def publisher(message_type: type, topic: str) -> Any:
            return node.create_publisher(message_type, topic, NEWEST_ONLY)

        self._gravity = publisher(JointState, '~/gravity_compensation')
        self._computed_torque = publisher(JointState, '~/computed_torque')
        self._terms = publisher(DynamicsTerms, '~/terms')
        self._reference = publisher(JointState, '~/reference')
        self.estimates = LiveEstimates(node)
        self.markers = LiveMarkers(node)
        self.estimates.is_external_wanted = lambda: self.markers.is_on
        self.command = SafeCommand(node, NEWEST_ONLY, self._forget_reference)

    def use(
        self, controller: Controller, watch: StateWatch, check: EffortCheck,
        estimates: Estimates, limits: GuardLimits, options: SafetyOptions,
    ) -> None:
        """Serve this arm from the next joint state on, and let `check` look until it is done."""
        names = controller.arm.joint_names
        watch.max_age, watch.has_age = self._state_max_age, self._has_age
        with self._answering:  # no state is answered by one model and commanded by another
            self._served = _Served(
                controller, JointStateReader(names), list(names), effort_template(names),
                state_template(names, has_effort=False), watch, check)
            self.estimates.use(estimates)
            self.command.use(controller.arm, limits, options)

    def forget(self) -> None:
        """Serve no arm."""
        with self._answering:
            self._served = None
            self.estimates.forget()
            self.markers.forget()
            self.command.forget()

    def set_limits(self, state_max_age: float, reference_timeout: float) -> None:
        """Take over how old [s] a state may be, and how long [s] a stream may pause."""
        self._stream.timeout, self._state_max_age = reference_timeout, state_max_age
        if self._served is not None:
            self._served.watch.max_age = state_max_age

    def follow(self, trajectory: JointTrajectory, stamp_ns: int) -> None:
        """Follow a trajectory; raise RobotDynamicsError where that cannot be."""
        served = self._served
        if served is None:
            raise InvalidInputError('no model yet, so that no trajectory can be followed')
        served.controller.follow(trajectory, stamp_ns)
        self._stream.arrived(trajectory.is_set_point, time.monotonic())

    def _forget_reference(self) -> None:
        if self._served is not None:
            self._served.controller.forget_reference()
        self._stream.end()
        self.counters.following = False

    def on_state(self, state: SensedState) -> None:
        """Publish the efforts for a joint state; whatever is wrong with it drops it alone."""
        try:
            with self._answering:
                self._answer(state)
        except OtherJointsError:
            self.counters.dropped['other joints'] += 1
        except NonFiniteEffortError as error:
            self._drop('no finite effort', f'Dropped a joint state: {error}')
            self.command.fail(Fault('non_finite', str(error), latched=True))
        except ImplausibleStateError as error:
            self._drop(error.reason, f'Dropped a joint state: {error}')
            if error.is_conflict:
                self.command.fail(
                    Fault('several_publishers', str(error), recovery=CONFLICT_RECOVERY))
        except RobotDynamicsError as error:
            self._drop('invalid', f'Dropped a joint state: {error}')
        except Exception as error:  # nothing that arrives may end the control path
            self._drop('internal error', f'Dropped a joint state: {error!r}')

    def refuse(self, error: UnreadableMessageError) -> None:
        """Take note of a joint state that cannot even be read."""
        self._drop('unreadable', f'Dropped a joint state: {error}')

    def _drop(self, reason: str, words: str) -> None:
        self.counters.dropped[reason] += 1
        self.counters.last_drop = words
        self._node.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)

    def _answer(self, state: SensedState) -> None:
        if self._served is None:
            self.counters.dropped['no model yet'] += 1
            self.counters.last_drop = 'Dropped a joint state: no model yet'
            return
        served = self._served
        q, v = served.reader.read(state)
        judgement = served.watch.judge(  # by a clock that does not stand still with /clock
            state.stamp_ns, time.time_ns(), q, v, self._is_crowded)
        if judgement.restart and self.counters.states > 0:
            self.counters.restarts[judgement.restart] += 1
            self._forget_reference()
        if judgement.time_shift:
            served.controller.shift_time(judgement.time_shift)
        now = time.monotonic()
        if self._stream.is_over(now):
            self._forget_reference()
            self.counters.paused_streams += 1
            self._node.get_logger().warning(
                'The stream of set-points paused for more than reference_timeout: gravity '
                'compensation until the next.', throttle_duration_sec=LOG_PERIOD)
        output = served.controller.answer(judgement.stamp, q, v)
        # A simulation in lock-step repeats its state until an effort lets it go on.
        waits = not judgement.is_news and self.command.is_waiting and served.watch.is_other_clock
        if judgement.is_news or waits:
            command = self.command.answer(state.stamp, q, v, output, judgement.dt)
        else:
            command = self.command.repeat(state.stamp)
        if judgement.is_news:
            self.counters.timing.happened(now)
        else:
            self.counters.repeated += 1
        self._publish(state, served, output)
        self.estimates.look(served.reader, state, q, v, judgement, output.robot_gravity)
        if self.markers.is_on:
            self.markers.look(state.stamp_ns, q, output, self.estimates.external_effort)
        self.counters.states += 1
        self.counters.following = output.sample is not None
        self.counters.lacks_velocity = v is None
        if not served.check.done:
            served.check.look(
                served.reader, state, q, v, output.robot_gravity,
                command if self.command.has_listeners() else None)

    def _is_crowded(self) -> bool:
        return self.count_publishers() > 1

    def _has_age(self) -> bool:
        """With use_sim_time stamps have no age by the clock of this computer."""
        return not self._node.get_clock().ros_time_is_active

    def _publish(self, state: SensedState, served: _Served, output: ControlOutput) -> None:
        template = served.template
        self._gravity.publish(template.filled(state.stamp, output.gravity_compensation))
        if output.computed_torque is not None:
            self._computed_torque.publish(template.filled(state.stamp, output.computed_torque))
        if self._terms.get_subscription_count():
            terms = served.controller.terms()
            if terms is not None:
                self._terms.publish(
                    terms_to_ros(terms, served.names, stamp_to_ros(state.stamp_ns)))
        if output.sample is not None and self._reference.get_subscription_count():
            position, velocity, _ = output.sample()
            self._reference.publish(
                served.reference_template.filled(state.stamp, position, velocity))
