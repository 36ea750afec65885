# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The loops of `simulated_arm`: step the arm, publish its state, take the effort for it.

In wall time a state is published every period. The newest effort acts until the next one arrives,
or until command_timeout. In lock-step each state waits for the effort with its stamp, so that the
same efforts act on the same states at any speed of the processes. Without an effort, simulated
time is paused, so that no effort can be overdue.
"""

from abc import ABC, abstractmethod
import math
import threading
import time

from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.joints.units import units_of
from robot_dynamics.ros.middleware.cdr_templates import (
    JointStateDecoder,
    stamp_bytes,
    state_template,
)
from robot_dynamics.ros.middleware.conversions import stamp_to_ros
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error, GuardedCallbacks
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.middleware.rclpy_internals import message_inbox
from robot_dynamics.ros.simulated_arm.unanswered_state import reason_of_silence, seconds
from robot_dynamics.simulation.plant import Measured, SimulatedRobot
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

NEWEST_ONLY = QoSProfile(depth=1)
DRIVE_TOPIC = 'dynamics/feed_forward'
"""Commands to drives with their own position loop, from the node `dynamics`."""
MAX_LAG = 0.1
"""Lateness [s] above which the simulation discards its backlog and logs a warning."""
LONGEST_GAP = 0.02
"""[s] by which the arm moves on without a state while it is late."""
UNANSWERED_AFTER = 0.7
"""[s] without an effort for a state of lock-step after which the reason is logged."""
RESEND_PERIOD = 0.1
"""
[s] after which the waiting state of lock-step, or the state of a pause, is published again.

The first message may have been published before there was a subscriber.
"""


class ArmTopics:
    """The joint states and the clock of the simulated arm, and the efforts that it receives."""

    def __init__(
        self, node: Node, joint_names: tuple[str, ...], with_clock: bool,
        has_drive_loop: bool = False,
    ) -> None:
        """With `has_drive_loop`, take position, velocity and effort from ~/feed_forward."""
        self._node = node
        self._decoder, self._reader = JointStateDecoder(), JointStateReader(joint_names)
        self._with_effort = state_template(joint_names)
        self._without_effort = state_template(joint_names, has_effort=False)
        self.states = node.create_publisher(JointState, 'joint_states', NEWEST_ONLY)
        self.topic, self.has_own_time = str(self.states.topic_name), with_clock
        """The full name of the topic of the joint states; whether the time is simulated."""
        self._motors = node.create_publisher(JointState, '~/motor_states', NEWEST_ONLY)
        self._clock = node.create_publisher(Clock, '/clock', 10) if with_clock else None
        self._read = self._reader.drive_command if has_drive_loop else self._reader.finite_effort
        self.inbox = message_inbox(
            node, JointState, DRIVE_TOPIC if has_drive_loop else 'effort_command', NEWEST_ONLY)
        self.efforts = self.inbox.subscription

    def take_effort(self, seconds: float) -> tuple[FloatArray, int] | None:
        """
        Return the next effort or drive command and its stamp [ns], None without one.

        Waits at most `seconds` [s] for it.
        """
        self.inbox.wait(max(0, round(seconds * NANOSECONDS_PER_SECOND)))
        try:
            taken = self.inbox.take()
            if taken is None:
                return None
            state = self._decoder.decode(taken[0])
            effort = self._read(state)
        except Exception as error:  # no message may end the simulation
            self._node.get_logger().warning(
                f'Rejected an effort: {describe_error(error)}', throttle_duration_sec=LOG_PERIOD)
            return None
        return effort, state.stamp_ns

    def publish(self, stamp_ns: int, measured: Measured) -> None:
        """Publish simulated time, then the measured state."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp_to_ros(stamp_ns)))
        template = self._with_effort if len(measured.effort) else self._without_effort
        stamp = stamp_bytes(stamp_ns)
        self.states.publish(template.filled(stamp, *measured[:3]))
        if self._motors.get_subscription_count() > 0:
            self._motors.publish(template.filled(stamp, *measured.motors, measured.effort))


class _Loop(ABC):
    """A thread that waits for efforts and for its end."""

    def __init__(
        self, node: GuardedCallbacks, plant: SimulatedRobot, topics: ArmTopics,
        lock: threading.Lock, period: float,
    ) -> None:
        self._node, self._plant, self._topics, self._lock = node, plant, topics, lock
        self._period = period
        self._period_ns = round(period * NANOSECONDS_PER_SECOND)
        self.is_paused = False
        """Keep simulated time at its present value; may be set from another thread."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._guarded_run, name='simulation', daemon=True)
        self.start = self._thread.start
        """Starts the thread."""

    def stop(self) -> None:
        """End the thread, before the node is destroyed."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self._topics.inbox.close()

    def _guarded_run(self) -> None:
        try:
            self._run()
        except Exception as error:
            if self._node.context.ok():
                self._node.get_logger().fatal(f'The simulation failed, the node ends: {error!r}')
                self._node.context.try_shutdown()  # the node is useless without it

    @abstractmethod
    def _run(self) -> None:
        """Simulate until the loop is stopped."""

    def _running(self) -> bool:
        return not self._stopping.is_set() and self._node.context.ok()

    def _apply(self, effort: FloatArray) -> None:
        """Apply an effort; log the joint at which the drive clips it most."""
        plant = self._plant
        with self._lock:
            joint, limit = plant.take_effort(effort), plant.effort_limit
        if joint is None or limit is None:
            return
        arm = plant.simulation.arm
        unit = units_of(arm.joint_kinds[joint]).effort
        self._node.get_logger().warning(
            f'Clipped the effort of {arm.joint_names[joint]!r}: received {effort[joint]:g} '
            f'{unit}, its effort limit is {limit[joint]:g} {unit} (clip_efforts); '
            f'efforts clipped so far: {plant.clipped_count}', throttle_duration_sec=LOG_PERIOD)

    def _advance(self) -> Measured:
        """Return the measured state one period later; reset the arm if the simulation diverges."""
        with self._lock:
            try:
                self._plant.step(self._period)
            except RobotDynamicsError as error:
                self._node.get_logger().error(
                    f'Simulation diverged ({error}); reset to the initial pose.',
                    throttle_duration_sec=LOG_PERIOD)
                self._plant.reset()
            return self._plant.measure()


class WallTimeLoop(_Loop):
    """
    Publishes one state per period of the wall clock.

    Stamps are whole periods apart, as in simulated time. A loop that is late by a period or more
    moves the arm on without a state, as an arm does while its driver is late. A lag of more than
    MAX_LAG is discarded: simulated time is paused for that long. Without simulated time the stamps
    skip it while the arm does not move, because old states are dropped.

    An effort with the stamp of the last state acts from this state on. The loop then computes the
    next state at once, in the time until it is due, so that it is published without delay.
    """

    _next: tuple[Measured, int] | None = None
    """The next state, if it has been computed, and the number of resets before it."""

    def _run(self) -> None:
        own_time = self._topics.has_own_time
        # A stamp of 0 would be read as "no stamp".
        first_ns = self._period_ns if own_time else self._node.get_clock().now().nanoseconds
        before = start = time.monotonic()
        tick = 0
        with self._lock:
            measured = self._plant.measure()
        while self._running():
            stamp_ns = first_ns + tick * self._period_ns
            self._topics.publish(stamp_ns, measured)
            due = start + (tick + 1) * self._period
            self._take_efforts_until(due, stamp_ns)
            if self.is_paused:
                self._take_efforts_until(time.monotonic() + RESEND_PERIOD)
                before = time.monotonic()
                start = before - (tick + 1) * self._period  # the time of the pause does not pass
                continue
            tick += 1
            now = time.monotonic()
            passed, before = now - before, now
            if before - due > MAX_LAG:
                self._node.get_logger().warning(
                    f'The simulation was {before - due:.3f} s late at {1.0 / self._period:g} Hz; '
                    'it discards this backlog.', throttle_duration_sec=LOG_PERIOD)
                if own_time:
                    start += before - due
                else:
                    tick += math.ceil((before - due) / self._period)
            self._watch_commands(passed, stamp_ns)
            computed, self._next = self._next, None
            is_valid = computed is not None and computed[1] == self._plant.reset_count
            measured = computed[0] if computed is not None and is_valid else self._advance()
            missed = int((time.monotonic() - start) / self._period) - tick
            for _ in range(min(missed, int(LONGEST_GAP / self._period))):
                tick += 1
                measured = self._advance()

    def _take_efforts_until(self, deadline: float, stamp_ns: int | None = None) -> None:
        """Take efforts; compute the next state after one with this stamp."""
        while self._running():
            remaining = deadline - time.monotonic()
            taken = self._topics.take_effort(min(remaining, RESEND_PERIOD))
            if taken is not None:
                self._apply(taken[0])
                if taken[1] == stamp_ns and self._next is None and not self.is_paused:
                    self._next = self._advance(), self._plant.reset_count
            if remaining <= 0.0:
                return

    def _watch_commands(self, passed: float, stamp_ns: int) -> None:
        """Engage the brakes and log it if efforts time out; received efforts are taken before."""
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
    Publishes a state, waits for the effort with its stamp, then advances simulated time.

    Simulated time is at most `real_time_factor` times as fast as real time; infinite: no limit.
    """

    real_time_factor = math.inf

    def _run(self) -> None:
        tick = 1  # a stamp of 0 would read as "no stamp"
        least, due = self._period / self.real_time_factor, -math.inf
        with self._lock:
            measured = self._plant.measure()
        while self._running():
            stamp_ns = tick * self._period_ns
            due = max(due + least, time.monotonic())  # a delay is not caught up
            effort = self._ask(stamp_ns, measured)
            if effort is None:
                return
            if self.is_paused:
                self._stopping.wait(RESEND_PERIOD)
                continue
            self._apply(effort)
            tick += 1
            self._stopping.wait(due + least - time.monotonic())
            measured = self._advance()

    def _ask(self, stamp_ns: int, measured: Measured) -> FloatArray | None:
        """Publish a state until its effort arrives; return None if the loop must stop."""
        since, others, other_ns = time.monotonic(), 0, 0
        while self._running():
            self._topics.publish(stamp_ns, measured)
            now = time.monotonic()
            if now - since >= UNANSWERED_AFTER:
                kind, reason = reason_of_silence(
                    self._topics.states, self._topics.efforts, others, other_ns)
                self._node.log_rarely(
                    f'lock_step: {kind}', self._node.get_logger().warning,
                    f'lock_step: no effort for the joint state of {seconds(stamp_ns)} s for '
                    f'{now - since:.1f} s: {reason}')
            deadline = now + RESEND_PERIOD
            while (remaining := deadline - time.monotonic()) > 0.0 and self._running():
                taken = self._topics.take_effort(remaining)
                if taken is None:
                    continue
                if taken[1] == stamp_ns:
                    return taken[0]
                if taken[1] != stamp_ns - self._period_ns:  # that one may come twice
                    others, other_ns = others + 1, taken[1]
        return None
