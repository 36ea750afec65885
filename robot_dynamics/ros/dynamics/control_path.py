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

from collections.abc import Callable
from dataclasses import dataclass
import threading
import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput, NonFiniteEffortError
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.effort_limiter import EffortLimits
from robot_dynamics.control.supervisor import Fault, SafetyOptions
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.monitoring.state_plausibility import (
    CONTRADICTION,
    ImplausibleStateError,
    StateMonitor,
    StateVerdict,
)
from robot_dynamics.ros.cdr_templates import (
    effort_template,
    MessageTemplate,
    SensedState,
    state_template,
)
from robot_dynamics.ros.conversions import stamp_to_ros, terms_to_ros
from robot_dynamics.ros.dynamics.command_output import SafeCommand
from robot_dynamics.ros.dynamics.control_counters import ControlCounters
from robot_dynamics.ros.dynamics.effort_check import EffortCheck
from robot_dynamics.ros.dynamics.live_estimates import Estimates, LiveEstimates
from robot_dynamics.ros.dynamics.markers import LiveMarkers
from robot_dynamics.ros.dynamics.payload_samples import PayloadSamples
from robot_dynamics.ros.dynamics.references import References
from robot_dynamics.ros.dynamics.state_log import StateLog
from robot_dynamics.ros.joint_state_reader import JointStateReader, OtherJointsError
from robot_dynamics.ros.message_bytes import UnreadableMessageError
from robot_dynamics.ros.rclpy_internals import raw_publish, subscription_count
from robot_dynamics.ros.state_assembly import ForeignJointsError, StateAssembly
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState

EXTERNAL_RECOVERY = 25
"""Valid states in a row without an excess after which the fault external_effort ends."""
DISCOVERY_TIME = 2.0
"""[s] after the start within which a publisher of robot_description may be discovered."""
NEWEST_ONLY = QoSProfile(depth=1)
"""Reliable, which matches all subscribers; older messages are of no use."""


@dataclass(frozen=True, eq=False)
class _Served:
    controller: Controller
    assembly: StateAssembly
    reader: JointStateReader
    names: list[str]
    template: MessageTemplate
    reference_template: MessageTemplate
    watch: StateMonitor
    check: EffortCheck


class ControlPath:
    """Publishes the efforts for each joint state, with the stamp of this state."""

    def __init__(
        self, node: Node, count_publishers: Callable[[], int],
        when_changed: Callable[[], object],
    ) -> None:
        """
        Publish on the topics of a node.

        `count_publishers` returns the number of publishers of joint states; `when_changed` is
        called when a fault begins or ends, and must return soon.
        """
        self._node, self._count_publishers = node, count_publishers
        self._served: _Served | None = None
        self._answering = threading.Lock()
        self._state_max_age = self._sample_max_age = 0.0
        self._foreign_joints = ''
        """Reason why the embedded arm is not served, empty if it is."""
        self._awaits_description, self._used_at = False, 0.0
        self.counters = ControlCounters()
        self._log = StateLog(node, self.counters)

        def publisher(message_type: type, topic: str) -> Any:
            return node.create_publisher(message_type, topic, NEWEST_ONLY)

        gravity = publisher(JointState, '~/gravity_compensation')
        computed_torque = publisher(JointState, '~/computed_torque')
        self._terms = publisher(DynamicsTerms, '~/terms')
        self._reference = publisher(JointState, '~/reference')
        self._send_gravity = raw_publish(gravity)
        self._send_computed_torque = raw_publish(computed_torque)
        self._count_terms = subscription_count(self._terms)
        self._count_reference = subscription_count(self._reference)
        self.markers = LiveMarkers(node)
        self.estimates = LiveEstimates(node, lambda: self.markers.is_on)
        self.payload_samples = PayloadSamples()
        self.references = References(
            self.counters, lambda: self.command.obstacle, lambda: self.command.is_faulty)
        self.command = SafeCommand(
            node, NEWEST_ONLY, self.references.interrupt, self.references.resume, when_changed)

    def use(
        self, controller: Controller, watch: StateMonitor, check: EffortCheck,
        estimates: Estimates, limits: EffortLimits, options: SafetyOptions,
        is_embedded: bool = False,
    ) -> None:
        """
        Serve this arm from the next joint state on, and run `check` until it is done.

        With `is_embedded` nothing is published once the joint states contain other joints.
        """
        names = controller.arm.joint_names
        self.references.note_lost('another model was loaded')
        watch.max_age, watch.has_age = self._state_max_age, self._has_age
        with self._answering:  # the same model for both
            self._served = _Served(
                controller, StateAssembly(names, self._sample_max_age, is_embedded),
                JointStateReader(names), list(names), effort_template(names),
                state_template(names, has_effort=False), watch, check)
            self.references.controller = controller
            self._foreign_joints = ''
            self._awaits_description = is_embedded
            self._used_at = time.monotonic()
            self.counters.velocities = 'measured'
            self.estimates.use(estimates)
            self.command.use(controller.arm, limits, options)

    def forget(self) -> None:
        """Serve no arm."""
        with self._answering:
            self._served = self.references.controller = None
            self.estimates.forget()
            self.markers.forget()
            self.command.forget()

    def set_limits(
        self, state_max_age: float, sample_max_age: float, reference_timeout: float,
        external_effort: FloatArray | None = None,
    ) -> None:
        """
        Set the largest age of a state and of a joint's sample, and the longest pause of a stream.

        All in [s]; a `sample_max_age` of 0 is half a period of the messages.
        `external_effort` (n,) is the limit of the external effort [N·m] or [N], None for none.
        """
        self.estimates.external_limit = external_effort
        self.references.stream.timeout = reference_timeout
        self._state_max_age = state_max_age
        self._sample_max_age = sample_max_age
        if self._served is not None:
            self._served.watch.max_age = state_max_age
            self._served.assembly.max_age = sample_max_age

    def on_state(self, state: SensedState) -> None:
        """Publish the efforts for a joint state; an error drops only this state."""
        try:
            with self._answering:
                self._answer(state)
        except OtherJointsError:
            self.counters.dropped['other joints'] += 1
        except ForeignJointsError as error:
            self._foreign_joints = str(error)
            self._log.refuse_embedded(str(error))
        except NonFiniteEffortError as error:
            self._log.drop('no finite effort', f'Dropped a joint state: {error}')
            self.command.fail(Fault('non_finite', str(error), latched=True))
        except ImplausibleStateError as error:
            self._log.drop(error.reason, f'Dropped a joint state: {error}')
            if error.reason == 'too old':
                self._look_for_replay(state.stamp_ns)
            if error.is_conflict:
                self.command.fail(
                    Fault('several_publishers', str(error), recovery=CONTRADICTION))
        except RobotDynamicsError as error:
            self._log.drop('invalid', f'Dropped a joint state: {error}')
        except Exception as error:  # no message may end the control path
            self._log.drop('internal error', f'Dropped a joint state: {error!r}')

    def refuse(self, error: UnreadableMessageError) -> None:
        """Count and log a joint state that cannot be read."""
        self._log.drop('unreadable', f'Dropped a joint state: {error}')

    def _look_for_replay(self, stamp_ns: int) -> None:
        replay = self.counters.replay
        if self._has_age() and replay.look(stamp_ns, time.time_ns()):
            self._log.warn('replay', replay.text)

    def _description_is_published(self) -> bool:
        """Return whether a description that is not received yet will replace the embedded arm."""
        self._awaits_description = time.monotonic() - self._used_at < DISCOVERY_TIME
        return bool(self._node.count_publishers('robot_description') > 0)

    def _answer(self, received: SensedState) -> None:
        served = self._served
        if served is None:
            self._log.count('no model yet')
            return
        steady_ns = time.monotonic_ns()
        state = self._completed(served, received, 1e-9 * steady_ns)
        if state is None:
            return
        q, v = served.reader.read(state)
        verdict = served.watch.judge(  # by a clock that a paused /clock does not stop
            state.stamp_ns, time.time_ns(), q, v, self._has_several_publishers, steady_ns)
        self._follow_time(served, state, verdict, 1e-9 * steady_ns)
        output = self._computed(served, verdict, q, v)
        v = v if v is not None else output.velocity
        command = self._commanded(served, state, verdict, q, output)
        self._count(verdict, output, 1e-9 * steady_ns)
        self._publish(state, served, output)
        self.estimates.look(served.reader, state, q, v, verdict, output.robot_gravity)
        self.payload_samples.take(served.reader, state, q, v, verdict, output.robot_gravity)
        if self.estimates.external_limit is not None:
            joint = self.estimates.excess()
            if joint is not None:
                self._fail_by_external_effort(served, joint)
        if self.markers.is_on:
            self.markers.look(state.stamp_ns, q, output, self.estimates.external_effort)
        if not served.check.done:
            served.check.look(
                served.reader, state, q, v, output.robot_gravity,
                command if self.command.has_listeners() else None)

    def _completed(
        self, served: _Served, received: SensedState, now: float,
    ) -> SensedState | None:
        """Return the state that a message completes, None if it completes no state."""
        if self._foreign_joints:
            self._log.refuse_embedded(self._foreign_joints)
            return None
        if self._awaits_description and self._description_is_published():
            self._log.count('robot_description not received yet')
            return None
        state = served.assembly.take(received)
        if state is None:
            self._log.part(
                served.assembly.missing, now - max(self._used_at, self.counters.answered_at))
        return state

    def _follow_time(
        self, served: _Served, state: SensedState, verdict: StateVerdict, now: float,
    ) -> None:
        """Restart if the joint states restart, and end a stream of set-points that has paused."""
        if served.watch.is_other_clock:
            self._look_for_replay(state.stamp_ns)
        elif self.counters.replay.text:
            self.counters.replay.reset()
        if verdict.restart and self.counters.states > 0:
            self.counters.restarts[verdict.restart] += 1
            self.references.interrupt(f'joint states restarted: {verdict.restart}')
            served.controller.restart_states()
            self.references.resume()
        if verdict.time_shift:
            served.controller.shift_time(verdict.time_shift)
        if self.references.stream.is_over(now):
            self.references.end_stream()
            self._log.warn(
                'stream',
                'The stream of set-points paused for more than reference_timeout; reference_loss '
                'defines the reaction.')

    def _computed(
        self, served: _Served, verdict: StateVerdict, q: FloatArray, v: FloatArray | None,
    ) -> ControlOutput:
        """Return the efforts for a state; record the source of its velocities."""
        controller, counters = served.controller, self.counters
        had_reference = v is None and controller.has_reference
        output = controller.answer(verdict.stamp, q, v)
        if v is None:
            self._log.velocities(controller, output.velocity)
            if output.velocity is None and had_reference:
                counters.interruption = 'the joint states have no velocity'
        elif counters.velocities != 'measured':
            counters.velocities = 'measured'
        if controller.bandwidth_scale != self._log.bandwidth_scale:
            self._log.bandwidth(controller)
        return output

    def _commanded(
        self, served: _Served, state: SensedState, verdict: StateVerdict, q: FloatArray,
        output: ControlOutput,
    ) -> FloatArray | None:
        """Return the effort that is published for a state, None if none is published."""
        # A simulation in lock-step repeats its state until an effort arrives.
        waits = not verdict.is_new and self.command.is_waiting and served.watch.is_other_clock
        if not (verdict.is_new or waits):
            return self.command.repeat(state.stamp)
        fault = Fault('following_error', served.controller.following_error(output, q)) if (
            output.is_far) else None
        return self.command.answer(
            state.stamp, q, output.velocity, output, verdict.dt, served.controller.braked, fault)

    def _count(self, verdict: StateVerdict, output: ControlOutput, now: float) -> None:
        counters = self.counters
        counters.answered_at = now
        counters.states += 1
        counters.following = output.sample is not None
        if verdict.is_new:
            counters.timing.happened(now)
        else:
            counters.repeated += 1

    def _fail_by_external_effort(self, served: _Served, j: int) -> None:
        effort, limit = self.estimates.external_effort, self.estimates.external_limit
        if effort is not None and limit is not None:
            self.command.fail(Fault(
                'external_effort', f'external effort at {served.names[j]!r} is {effort[j]:.3g}, '
                f'expected at most {limit[j]:.3g} (external_effort_limit)',
                recovery=EXTERNAL_RECOVERY))

    def _has_several_publishers(self) -> bool:
        return self._count_publishers() > 1

    def _has_age(self) -> bool:
        """Return whether stamps have an age: with use_sim_time they have none."""
        return not self._node.get_clock().ros_time_is_active

    def _publish(self, state: SensedState, served: _Served, output: ControlOutput) -> None:
        template = served.template
        self._send_gravity(template.filled(state.stamp, output.gravity_compensation))
        if output.computed_torque is not None:
            self._send_computed_torque(template.filled(state.stamp, output.computed_torque))
        if self._count_terms():
            terms = served.controller.terms()
            if terms is not None:
                self._terms.publish(
                    terms_to_ros(terms, served.names, stamp_to_ros(state.stamp_ns)))
        if output.sample is not None and self._count_reference():
            position, velocity, _ = output.sample()
            self._reference.publish(
                served.reference_template.filled(state.stamp, position, velocity))
