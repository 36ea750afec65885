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
The loops of `simulated_arm`: step the arm, publish its state, take the effort for it.

In wall time a state goes out every period, and the newest effort acts until the next, or until
none has arrived for too long. In lock-step a state waits for the effort that carries its stamp, so
that the same efforts meet the same states however fast the processes run; time stands still
without an effort, so that none can be overdue.
"""

from abc import ABC, abstractmethod
import math
import threading
import time

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.ros.cdr_templates import JointStateDecoder, stamp_bytes, state_template
from robot_dynamics.ros.conversions import stamp_to_ros
from robot_dynamics.ros.guarded_callbacks import describe_error
from robot_dynamics.ros.joint_state_reader import JointStateReader
from robot_dynamics.ros.message_loop import LOG_PERIOD
from robot_dynamics.ros.rclpy_internals import message_inbox
from robot_dynamics.ros.simulated_arm.unanswered_state import UnansweredState
from robot_dynamics.simulation.plant import Measured, Plant
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

NEWEST_ONLY = QoSProfile(depth=1)
MAX_LAG = 0.1
"""[s] that the simulation may run late before it says so, and lets go of it."""
FASTEST_PERIOD = 0.5
"""Share of the period between two states while the simulation catches up."""
RESEND_PERIOD = 0.1
"""
[s] after which a state is published again that lock-step waits with, or that is paused at.

The first time there may have been no subscriber yet.
"""


class ArmTopics:
    """The joint states and the clock of the simulated arm, and the efforts that it takes."""

    def __init__(self, node: Node, joint_names: tuple[str, ...], with_clock: bool) -> None:
        self._node = node
        self._decoder, self._reader = JointStateDecoder(), JointStateReader(joint_names)
        self._with_effort = state_template(joint_names)
        self._without_effort = state_template(joint_names, has_effort=False)
        self.states = node.create_publisher(JointState, 'joint_states', NEWEST_ONLY)
        self._motors = node.create_publisher(JointState, '~/motor_states', NEWEST_ONLY)
        self._clock = node.create_publisher(Clock, '/clock', 10) if with_clock else None
        self.inbox = message_inbox(
            node, JointState, 'effort_command', NEWEST_ONLY, can_wake=True)
        self.efforts = self.inbox.subscription

    @property
    def topic(self) -> str:
        """The full name of the topic of the joint states."""
        return str(self.states.topic_name)

    @property
    def has_own_time(self) -> bool:
        return self._clock is not None

    def take_effort(self) -> tuple[FloatArray, int] | None:
        """Return the newest effort that has arrived and its stamp, or None."""
        try:
            taken = self.inbox.take()
            if taken is None:
                return None
            state = self._decoder.decode(taken[0])
            effort = self._reader.finite_effort(state)
        except Exception as error:  # nothing that arrives may end the simulation
            self._node.get_logger().warning(
                f'Refused an effort: {describe_error(error)}', throttle_duration_sec=LOG_PERIOD)
            return None
        return effort, state.stamp_ns

    def publish(self, stamp_ns: int, measured: Measured) -> None:
        """Publish what is measured, after the time that it is of."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp_to_ros(stamp_ns)))
        template = self._with_effort if len(measured.effort) else self._without_effort
        stamp = stamp_bytes(stamp_ns)
        self.states.publish(template.filled(stamp, *measured[:3]))
        if self._motors.get_subscription_count() > 0:
            self._motors.publish(template.filled(stamp, *measured.motors, measured.effort))


class _Loop(ABC):
    """A thread that waits for efforts and for being stopped."""

    def __init__(
        self, node: Node, plant: Plant, topics: ArmTopics, lock: threading.Lock, period: float,
    ) -> None:
        self._node, self._plant, self._topics, self._lock = node, plant, topics, lock
        self._period = period
        self._period_ns = round(period * NANOSECONDS_PER_SECOND)
        self.is_paused = False
        """Keep simulated time at its present value; may be set from another thread."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._guarded_run, name='simulation', daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread, before the node is destroyed."""
        self._stopping.set()
        if self._thread.is_alive():
            self._topics.inbox.wake()
            self._thread.join()
        self._topics.inbox.close()

    def _guarded_run(self) -> None:
        try:
            self._run()
        except Exception as error:
            if self._node.context.ok():
                self._node.get_logger().fatal(f'The simulation ended: {error!r}')
                self._node.context.try_shutdown()  # a node without a simulation is none

    @abstractmethod
    def _run(self) -> None:
        """Simulate until the loop is stopped."""

    def _running(self) -> bool:
        return not self._stopping.is_set() and self._node.context.ok()

    def _wait_for_effort(self, seconds: float) -> bool:
        """Return whether an effort can be taken; wait for it at most so long."""
        inbox = self._topics.inbox
        inbox.wait(max(0, round(seconds * NANOSECONDS_PER_SECOND)))
        return inbox.is_ready()

    def _apply(self, effort: FloatArray) -> None:
        """Apply an effort; log the joint at which the drive clips it most."""
        plant = self._plant
        with self._lock:
            joint, limit = plant.take_effort(effort), plant.effort_limit
        if joint is None or limit is None:
            return
        arm = plant.simulation.arm
        unit = 'N' if arm.joint_kinds[joint] == 'prismatic' else 'N m'
        self._node.get_logger().warning(
            f'Clipped the effort of {arm.joint_names[joint]!r}: received {effort[joint]:g} '
            f'{unit}, the effort limit of the URDF is {limit[joint]:g} {unit} (clip_efforts); '
            f'efforts clipped so far: {plant.clipped_count}', throttle_duration_sec=LOG_PERIOD)

    def _advance(self) -> Measured:
        """Return what is measured one period on; an arm flung to infinity starts again."""
        with self._lock:
            try:
                self._plant.step(self._period)
            except RobotDynamicsError as error:
                self._node.get_logger().error(
                    f'Back to the initial pose: {error}', throttle_duration_sec=LOG_PERIOD)
                self._plant.reset()
            return self._plant.measure()


class WallTimeLoop(_Loop):
    """
    A state every period of the wall clock.

    Stamps are whole periods apart, as the simulated time is. A late loop catches up at no more
    than 1 / FASTEST_PERIOD times real time, so that the controller still answers every state. What
    it lags behind beyond MAX_LAG it lets go: a time of its own stands still for that long, and by
    the computer's clock, where a state would soon be too old to be answered, the arm does.
    """

    def _run(self) -> None:
        own_time = self._topics.has_own_time
        # A stamp of 0 would be read as "no stamp".
        first_ns = self._period_ns if own_time else self._node.get_clock().now().nanoseconds
        start, tick, before = time.monotonic(), 0, -math.inf
        with self._lock:
            measured = self._plant.measure()
        while self._running():
            stamp_ns = first_ns + tick * self._period_ns
            self._topics.publish(stamp_ns, measured)
            tick += 1
            due = start + tick * self._period
            self._take_efforts_until(max(due, before + FASTEST_PERIOD * self._period))
            pause = self._pause(stamp_ns, measured)
            start, due, before = start + pause, due + pause, before + pause
            now = time.monotonic()
            passed, before = now - before, now
            if before - due > MAX_LAG:
                self._node.get_logger().warning(
                    f'{before - due:.3f} s behind the rate of {1.0 / self._period:g} Hz',
                    throttle_duration_sec=LOG_PERIOD)
                if own_time:
                    start += before - due
                else:
                    tick += math.ceil((before - due) / self._period)
            self._watch_commands(passed, stamp_ns)
            measured = self._advance()

    def _pause(self, stamp_ns: int, measured: Measured) -> float:
        """Publish the same state while the simulation is paused; return how long [s] it was."""
        begin = time.monotonic()
        while self.is_paused and self._running():
            self._topics.publish(stamp_ns, measured)
            self._take_efforts_until(time.monotonic() + RESEND_PERIOD)
        return time.monotonic() - begin

    def _take_efforts_until(self, deadline: float) -> None:
        while self._running():
            remaining = deadline - time.monotonic()
            if self._wait_for_effort(max(remaining, 0.0)):
                taken = self._topics.take_effort()
                if taken is not None:
                    self._give(taken[0])
            if remaining <= 0.0:
                return

    def _give(self, effort: FloatArray) -> None:
        with self._lock:
            had_timed_out = self._plant.timed_out
        self._apply(effort)
        if had_timed_out:
            self._node.get_logger().info(
                'Efforts arrive again: the arm goes on from where it is.',
                throttle_duration_sec=LOG_PERIOD)

    def _watch_commands(self, passed: float, stamp_ns: int) -> None:
        """Hold the arm where efforts have failed to come, and say so; all that came are taken."""
        plant = self._plant
        with self._lock:
            if not plant.watch_commands(passed, self._period):
                return
            silence, steps = plant.commands.silence, plant.commands.silent_steps
        since = (stamp_ns - steps * self._period_ns) / NANOSECONDS_PER_SECOND
        done = 'the brakes hold the arm where it is' if plant.has_brakes else (
            'no effort acts on the arm, which has no brakes')
        self._node.get_logger().warning(
            f'No valid effort for {silence:.3f} s (command_timeout), since the joint state of '
            f'{since:.3f} s: {done}, until the next effort arrives.',
            throttle_duration_sec=LOG_PERIOD)


class LockStepLoop(_Loop):
    """
    A state, then the effort that carries its stamp, then the next state, in simulated time.

    That time is at most `real_time_factor` times as fast as a clock; infinite for no limit.
    """

    real_time_factor = math.inf

    def __init__(
        self, node: Node, plant: Plant, topics: ArmTopics, lock: threading.Lock, period: float,
    ) -> None:
        super().__init__(node, plant, topics, lock, period)
        self._unanswered = UnansweredState(node, topics.states, topics.efforts)

    def _run(self) -> None:
        tick = 1  # a stamp of 0 would read as "no stamp"
        least, due = self._period / self.real_time_factor, -math.inf
        with self._lock:
            measured = self._plant.measure()
        while self._running():
            stamp_ns = tick * self._period_ns
            due = max(due + least, time.monotonic())  # what is lost is not caught up with
            effort = self._ask(stamp_ns, measured)
            while effort is not None and self.is_paused:
                self._stopping.wait(RESEND_PERIOD)
                effort = self._ask(stamp_ns, measured)
            if effort is None:
                return
            self._apply(effort)
            tick += 1
            self._stopping.wait(due + least - time.monotonic())
            measured = self._advance()

    def _ask(self, stamp_ns: int, measured: Measured) -> FloatArray | None:
        """Publish a state until its effort arrives; return None when told to stop."""
        self._unanswered.begin(stamp_ns, stamp_ns - self._period_ns)
        while self._running():
            self._topics.publish(stamp_ns, measured)
            self._unanswered.look()
            deadline = time.monotonic() + RESEND_PERIOD
            while (remaining := deadline - time.monotonic()) > 0.0 and self._running():
                if not self._wait_for_effort(remaining):
                    continue
                taken = self._topics.take_effort()
                if taken is None:
                    continue
                if taken[1] == stamp_ns:
                    return taken[0]
                self._unanswered.receive_other(taken[1])
        return None
