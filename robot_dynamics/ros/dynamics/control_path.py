# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a joint state message to effort messages: the control path of `dynamics`."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
import math
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.ros.dynamics.command_output import CommandOutput
from robot_dynamics.ros.dynamics.drive_commands import DriveCommands
from robot_dynamics.ros.dynamics.effort_check import EffortCheck
from robot_dynamics.ros.dynamics.external_effort_fault import ExternalEffortFault
from robot_dynamics.ros.dynamics.state_log import ControlCounters, StateLog
from robot_dynamics.ros.middleware.cdr_templates import (
    effort_template,
    Layout,
    MessageTemplate,
    SensedState,
    state_template,
)
from robot_dynamics.ros.middleware.conversions import stamp_to_ros, terms_to_ros
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader, OtherJointsError
from robot_dynamics.ros.middleware.message_bytes import UnreadableMessageError
from robot_dynamics.ros.middleware.rclpy_internals import raw_publish, subscription_count
from robot_dynamics.ros.middleware.state_assembly import ForeignJointsError, StateAssembly
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState

DISCOVERY_TIME = 2.0
"""[s] after the start within which a publisher of robot_description may be discovered."""
NEWEST_ONLY = QoSProfile(depth=1)
"""Reliable, which matches all subscribers; older messages are of no use."""


class _Served:
    """The arm that is served: its loop, and what reads and writes its messages."""

    def __init__(
        self, loop: ControlLoop, check: EffortCheck, external: ExternalEffortFault,
        sample_max_age: float, is_exact: bool,
    ) -> None:
        names = loop.controller.arm.joint_names
        self.loop, self.check, self.names = loop, check, list(names)
        self.external = external
        self.assembly = StateAssembly(names, sample_max_age, is_exact)
        self.reader = JointStateReader(names)
        self.template: MessageTemplate = effort_template(names)
        self.reference_template: MessageTemplate = state_template(names, has_effort=False)
        self.layout: Layout | None = None
        """The layout of complete states whose numbers `places` finds."""
        self.places = np.zeros(0, dtype=np.intp)


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
        self._node = node
        self._has_several_publishers = lambda: count_publishers() > 1
        self._served: _Served | None = None
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
        self._drives = DriveCommands(node, NEWEST_ONLY)
        self._counts = [*(subscription_count(one) for one in (
            gravity, computed_torque, self._terms, self._reference)), *self._drives.counts]
        self.command = CommandOutput(node, NEWEST_ONLY, when_changed)

    @property
    def loop(self) -> ControlLoop | None:
        """The control loop of the arm that is served, or None."""
        return self.command.loop

    @property
    def lock(self) -> AbstractContextManager[object]:
        """The lock of the control path."""
        return self.command.lock

    def set_loop(
        self, loop: ControlLoop, check: EffortCheck, external: ExternalEffortFault,
        is_embedded: bool = False,
    ) -> None:
        """
        Serve this arm from the next joint state on, and run `check` until it is done.

        With `is_embedded` nothing is published once the joint states contain other joints.
        """
        loop.monitor.max_age, loop.monitor.has_age = self._state_max_age, self._has_age
        before = self.loop
        if before is not None:
            before.goals.end(Ending(Kind.HOLD, 'another model was loaded'))
            if before.controller.trajectory is not None:
                loop.goals.interruption = 'another model was loaded'
        with self.lock:
            self._served = _Served(loop, check, external, self._sample_max_age, is_embedded)
            self._foreign_joints = ''
            self._awaits_description = is_embedded
            self._used_at = time.monotonic()
            self._drives.set_loop(loop)
            self.command.set_loop(loop)

    def forget(self) -> None:
        """Serve no arm."""
        with self.lock:
            if self.loop is not None:
                self.loop.goals.end(Ending(Kind.HOLD, 'the model was unloaded'))
            self._served = None
            self.command.forget()

    def set_limits(self, state_max_age: float, sample_max_age: float) -> None:
        """
        Set the largest age of a state and of a joint's sample, both in [s].

        A `sample_max_age` of 0 is half a period of the messages.
        """
        self._state_max_age = state_max_age
        self._sample_max_age = sample_max_age
        served = self._served
        if served is not None:
            served.loop.monitor.max_age = state_max_age
            served.assembly.max_age = sample_max_age

    # ------------------------------------------------------------------ states

    def on_state(self, state: SensedState) -> None:
        """Publish the efforts for a joint state; an error drops only this state."""
        try:
            served, command = self._served, self.command
            if served is None:
                self._log.count('no model yet')
                return
            steady_ns = time.monotonic_ns()
            values = None
            if state.layout is served.layout and not self._foreign_joints:  # the usual case
                values = state.numbers[served.places]
                if not math.isfinite(sum(values.tolist())):
                    values = None
            if values is not None:
                n = len(served.names)
                q, v = values[:n], values[n:] if len(values) > n else None
            else:
                whole = self._completed(served, state, 1e-9 * steady_ns)
                if whole is None:
                    return
                state, (q, v) = whole, self._read(served, whole)
            answer = served.loop.answer(
                state.stamp_ns, q, v, time.time_ns(), steady_ns,
                self._has_several_publishers, command.order.fault,
                partial(command.publish, state.stamp))
            mode = served.loop.supervisor.mode
            if mode is not command.mode_seen or mode is not Mode.RUNNING or (
                    answer.limits is not None):
                command.follow(answer)
            self._follow(served, state, answer, q, v, 1e-9 * steady_ns)
        except OtherJointsError:
            self.counters.dropped['other joints'] += 1
        except ForeignJointsError as error:
            self._foreign_joints = str(error)
            self._log.refuse_embedded(str(error))
        except NonFiniteEffortError as error:
            self._log.drop('no finite effort', f'Dropped a joint state: {error}')
            self.command.notify()
        except ImplausibleStateError as error:
            self._log.drop(error.reason, f'Dropped a joint state: {error}')
            if error.reason == 'too old':
                self._look_for_replay(state.stamp_ns)
            if error.is_conflict:
                self.command.notify()
        except RobotDynamicsError as error:
            self._log.drop('invalid', f'Dropped a joint state: {error}')
        except Exception as error:  # no message may end the control path
            self._log.drop('internal error', f'Dropped a joint state: {error!r}')

    def refuse(self, error: UnreadableMessageError) -> None:
        """Count and log a joint state that cannot be read."""
        self._log.drop('unreadable', f'Dropped a joint state: {error}')

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

    def _read(
        self, served: _Served, state: SensedState,
    ) -> tuple[FloatArray, FloatArray | None]:
        """Return position and velocity (n,) of a state, and learn where its layout has them."""
        q, v = served.reader.read(state)
        if state.layout is served.assembly.whole and not self._awaits_description:
            served.layout, served.places = state.layout, served.reader.places
        return q, v

    def _look_for_replay(self, stamp_ns: int) -> None:
        replay = self.counters.replay
        if self._has_age() and replay.examine(stamp_ns, time.time_ns()):
            self._log.warn('replay', replay.text)

    def _description_is_published(self) -> bool:
        """Return whether a description that is not received yet will replace the embedded arm."""
        self._awaits_description = time.monotonic() - self._used_at < DISCOVERY_TIME
        return bool(self._node.count_publishers('robot_description') > 0)

    # ------------------------------------------------------------------ after the command

    def _follow(
        self, served: _Served, state: SensedState, answer: LoopAnswer, q: FloatArray,
        v: FloatArray | None, now: float,
    ) -> None:
        """Count and publish what follows from a state, after its command."""
        counters, output, verdict = self.counters, answer.output, answer.verdict
        counters.answered_at, counters.following = now, output.state.trajectory is not None
        if verdict.is_new:
            counters.arrivals.append(now)
        else:
            counters.repeated += 1
        if served.loop.monitor.is_other_clock:
            self._look_for_replay(state.stamp_ns)
        elif counters.replay.text:
            counters.replay.reset()
        if output.scale != self._log.bandwidth_scale:
            self._log.bandwidth(served.loop.controller)
        if served.loop.goals.notice:
            self._log.warn('notice', served.loop.goals.notice)
            served.loop.goals.notice = ''
        for count in self._counts:
            if count():
                self._publish(state, served, answer)
                break
        if served.external.is_on or not served.check.done:
            self._examine(served, state, answer, q)

    def _examine(
        self, served: _Served, state: SensedState, answer: LoopAnswer, q: FloatArray,
    ) -> None:
        """Compare the measured effort with its limit, and with the command."""
        output, reader = answer.output, served.reader
        v, gravity = output.state.v, output.robot_gravity
        if served.external.is_on:
            fault = served.external.fault(reader, state, q, v, answer.verdict, gravity)
            if fault is not None:
                self.command.fail(fault)
        if not served.check.done:
            served.check.add_state(
                reader, state, q, v, gravity,
                answer.effort if self.command.has_listeners() or self._drives.has_listeners()
                else None)

    def _has_age(self) -> bool:
        """Return whether stamps have an age: with use_sim_time they have none."""
        return not self._node.get_clock().ros_time_is_active

    def _publish(self, state: SensedState, served: _Served, answer: LoopAnswer) -> None:
        template, output = served.template, answer.output
        gravity, computed_torque, terms_count, reference_count = (
            count() for count in self._counts[:4])
        if gravity:
            self._send_gravity(template.filled(state.stamp, output.gravity_compensation))
        if computed_torque and output.computed_torque is not None:
            self._send_computed_torque(template.filled(state.stamp, output.computed_torque))
        if terms_count:
            terms = output.terms
            if terms is not None:
                self._terms.publish(
                    terms_to_ros(terms, served.names, stamp_to_ros(state.stamp_ns)))
        reference = output.reference if reference_count else None
        if reference is not None:
            self._reference.publish(served.reference_template.filled(
                state.stamp, reference.position, reference.velocity))
        self._drives.publish(state.stamp, answer)
