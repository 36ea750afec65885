# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control loop: from a measured state to the effort that is commanded, without ROS.

The node `dynamics`, the benchmark `safe_motion` and the tests use this class. A state passes, in
this order: its plausibility (`state_plausibility`), the check of its velocities
(`motion_consistency`), the control law with its reference (`controller`), the limits of the effort
(`effort_limiter`) and the supervisor (`supervisor`).

With a law that follows references, the arm always has a reference while it is commanded: it stops
from the first measured state, and after each fault, and is held there. Before the command ends
(`deactivate`, `command: none`) the arm stops and is held; then the effort is ramped to zero.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
import math
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput, NonFiniteEffortError
from robot_dynamics.control.controller import Controller, NO_COMMAND, Prepared
from robot_dynamics.control.laws.cartesian import make_cartesian
from robot_dynamics.control.laws.control_law import ControlLaw
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.laws.guiding import make_guiding
from robot_dynamics.control.laws.impedance import make_impedance
from robot_dynamics.control.options import (
    ControllerOptions,
    default_effort_rates,
    DEFAULT_STATE_MAX_AGE,
    POSITION_MARGIN,
)
from robot_dynamics.control.safety.effort_limiter import ActiveLimits, EffortLimits
from robot_dynamics.control.safety.frozen_joints import FrozenJoints
from robot_dynamics.control.safety.supervisor import (
    Brake,
    CommandSupervisor,
    Fault,
    FOLLOWING_ERROR,
    Mode,
    SafetyOptions,
    slower,
)
from robot_dynamics.control.setpoint_stream import SetPointStream
from robot_dynamics.control.trajectory_goal import (
    default_tolerances,
    LATEST_START,
    NO_SLOWER,
    ResultCode,
    Tolerances,
    TrajectoryGoal,
)
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.monitoring.motion_consistency import MotionConsistency
from robot_dynamics.monitoring.state_plausibility import (
    CONTRADICTION,
    ImplausibleStateError,
    StatePlausibility,
    StateVerdict,
)
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

CHECK_PERIOD = 0.005
"""[s] between two states whose velocity is checked and to which the loop adapts, or longer."""
CHECK_PERIOD_NS = round(1e9 * CHECK_PERIOD)
AT_REST, SLOW = 0.002, 0.03
"""[rad] or [m] that no joint moves in REST_TIME when it has stopped, and its velocity then."""
REST_TIME_NS = 100_000_000
"""[ns]"""
JUMP = 1.0
"""[rad/s] between the velocities of two states above which they are checked before the answer."""
FROZEN_RECOVERY = 25
"""Valid states in a row with a signal of all joints after which frozen_joint ends."""


class LoopAnswer(NamedTuple):
    """
    The answer to a state: the effort to publish (n,), or None, and what led to it.

    `limits` are the limits that have changed the effort, None if no limit has.
    """

    effort: FloatArray | None
    output: ControlOutput
    verdict: StateVerdict
    limits: ActiveLimits | None = None


class ControlLoop:
    """
    Controls one arm; safe to call from several threads.

    `answer` takes the states. Times are those of a steady clock [s], stamps [ns] those of the
    states.
    """

    def __init__(
        self, controller: Controller, limits: EffortLimits, safety: SafetyOptions,
        monitor: StatePlausibility | None = None, before: 'ControlLoop | None' = None,
    ) -> None:
        """
        Control the arm of a controller, whose lock the loop shares; `activate` begins.

        `before` is the loop of an earlier model. For the same joints the effort continues from its
        last one without a step; a latched fault persists in any case.
        """
        arm = controller.arm
        self.controller, self.lock = controller, controller.lock
        self.monitor = StatePlausibility(
            arm.joint_names, arm.limits.velocity, DEFAULT_STATE_MAX_AGE, arm.is_continuous,
        ) if monitor is None else monitor
        self.consistency = MotionConsistency(
            arm.joint_names, arm.joint_kinds, controller.is_held)
        self._is_consistent, self._checked_ns = True, 0
        self.stream = SetPointStream(controller.options.stream_timeout)
        self.supervisor = CommandSupervisor(arm.joint_names, limits, safety)
        self.is_active = False
        self.goal: TrajectoryGoal | None = None
        """The goal that is executed, or None."""
        self.interruption = ''
        """Reason why the last reference ended early, until the next reference."""
        self.notice = ''
        """Message for the operator; the caller that logs it sets it to an empty string."""
        self.restarts: Counter[str] = Counter()
        self.paused_streams = 0
        self.states = 0
        """Number of answered states."""
        self._steady = 0.0
        self._next_options: ControllerOptions | None = None
        self._frozen: FrozenJoints | None = None
        self._doubt = ''
        self._velocities: list[float] = []
        self._rest: tuple[int, FloatArray] | None = None
        self._fault_count = 0
        if before is not None:
            self._continue(before)

    @classmethod
    def of_arm(
        cls, arm: ArmModel, law: ControlLaw | None = None, **options: Any,
    ) -> 'ControlLoop':
        """
        Return an active loop with the default parameters of the node `dynamics`.

        `options` replace those of `ControllerOptions`, such as `gains` or `command`.
        """
        rates = default_effort_rates(arm)
        defaults: dict[str, Any] = {
            'gains': make_gains(arm.joint_names),
            'impedance': make_impedance(arm.joint_names, arm.limits.effort),
            'guiding': make_guiding(arm), 'cartesian': make_cartesian(arm), 'effort_rate': (
                rates if arm.drive is None else arm.drive.scale * rates),
            'scales_gains': True, 'conditions_references': True, 'stops_and_holds': True,
            'estimates_velocity': True, 'checks_goals': True}
        limits = arm.limits
        loop = cls(
            Controller(arm, ControllerOptions(**{**defaults, **options}), law),
            EffortLimits(
                limits.lower, limits.upper, limits.velocity, POSITION_MARGIN, rates,
                arm.given_drive.limit),
            SafetyOptions())
        loop.activate()
        return loop

    def _continue(self, before: 'ControlLoop') -> None:
        old, new = before.supervisor, self.supervisor
        if before.controller.arm.joint_names == self.controller.arm.joint_names:
            old.set_options(new.limiter.limits, new.options)
            self.supervisor, self._fault_count = old, old.fault_count
        elif old.is_latched:
            new.fault = old.fault
        if before.is_active:
            self.activate()

    # ------------------------------------------------------------------ requests

    def activate(self) -> None:
        """Command efforts from the next state on."""
        with self.lock:
            self.is_active = True
            self.supervisor.activate()
            self._follow_faults()

    def deactivate(self, now: float, reason: str = 'the node was deactivated') -> None:
        """Stop the arm, hold it, ramp the effort to zero, and be inactive."""
        with self.lock:
            self.is_active = False
            self._end(now, reason)

    def _end(self, now: float, reason: str) -> None:
        """Begin the stop before the ramp; the reference is that of the stop."""
        if self.controller.has_reference:
            self.interruption = reason
        self.stream.end()
        was_braking = self.supervisor.mode is Mode.BRAKING
        if self.supervisor.brake(now) and not was_braking:
            self._rest = None
            self.controller.stop()

    def set_options(
        self, options: ControllerOptions, limits: EffortLimits, safety: SafetyOptions,
    ) -> None:
        """Apply options; `command: none` takes effect once the arm has stopped."""
        with self.lock:
            controller = self.controller
            before = controller.options.command
            if options.command == NO_COMMAND != before and self.supervisor.mode in (
                    Mode.RUNNING, Mode.FAULT, Mode.BRAKING):
                self._next_options = options
                options = replace(options, command=before)
                self._end(self._steady, "command was set to 'none'")
            else:
                if self._next_options is not None:
                    self._next_options = None
                    self.supervisor.resume()
                if options.command != before and controller.has_reference:
                    self.interruption = f'command was set to {options.command!r}'
            controller.set_options(options)
            self.stream.set_timeout(options.stream_timeout)
            self.supervisor.set_options(limits, safety)

    def follow(self, trajectory: JointTrajectory, stamp_ns: int = 0) -> None:
        """
        Follow a trajectory from `stamp_ns` on, 0 for the newest state.

        Raises TrajectoryError if it cannot be followed.
        """
        self._check_follows()
        self._start(trajectory, self.controller.prepare(trajectory), stamp_ns)

    def execute(
        self, trajectory: JointTrajectory, stamp_ns: int = 0, tolerances: Tolerances | None = None,
        when_done: Callable[[], object] = lambda: None,
    ) -> TrajectoryGoal:
        """
        Follow a trajectory and judge it by tolerances; the goal before ends.

        `when_done` is called when the goal has a result, and must return soon. Raises
        TrajectoryError if the trajectory cannot be followed, or not within its own time.
        """
        self._check_follows()
        prepared = self.controller.prepare(trajectory)
        if prepared[1] > NO_SLOWER:
            raise TrajectoryError(
                f'the trajectory would take {prepared[1]:.3g} times its duration, expected the '
                'duration itself: send a slower trajectory, such as that of ~/retime_trajectory')
        with self.lock:
            self._start(
                trajectory, prepared, stamp_ns,
                math.inf if trajectory.is_set_point else LATEST_START)
            self.goal = TrajectoryGoal(
                self.controller, tolerances or default_tolerances(trajectory.joint_names),
                when_done)
            return self.goal

    def _start(
        self, trajectory: JointTrajectory, prepared: Prepared, stamp_ns: int,
        latest: float = math.inf,
    ) -> None:
        with self.lock:
            self._check_follows()
            self.controller.start(prepared, stamp_ns, latest)
            if self.goal is not None:
                q = trajectory.points[-1].position.round(4).tolist()
                self.end_goal(f'another goal has replaced this one: {q}')
            self.stream.arrived(trajectory.is_set_point, self._steady)
            self.interruption = ''

    def set_force_feedback(self, external: FloatArray) -> None:
        """Let `hand_guiding` feel the external effort (n,) of a follower for 50 ms."""
        with self.lock:
            self.controller.feel(external)

    def end_goal(self, reason: str) -> None:
        """End the goal that is executed, if there is one."""
        with self.lock:
            if self.goal is not None:
                goal, self.goal = self.goal, None
                goal.end(ResultCode.INVALID_GOAL, reason)

    def cancel(self, goal: TrajectoryGoal) -> None:
        """Stop the arm if it executes this goal, which ends when the arm is at rest."""
        with self.lock:
            if goal is self.goal:
                self.stream.end()
                goal.cancel()

    def _check_follows(self) -> None:
        obstacle = self.obstacle
        if obstacle:
            raise TrajectoryError(f'no reference can be followed now: {obstacle}')

    @property
    def obstacle(self) -> str:
        """The reason why no reference can be followed now, empty if one can."""
        with self.lock:
            supervisor = self.supervisor
            mode, fault = supervisor.mode, supervisor.fault
            if not self.is_active:
                return 'the node is not active'
            if mode is Mode.FAULT and fault is not None:
                return str(fault)
            if mode is Mode.BRAKING:
                return 'the arm is being stopped, because the command ends'
            return 'the command is being ramped to zero' if mode is Mode.STOPPING else ''

    def stop(self) -> str:
        """Stop the arm and hold its position; return a report."""
        with self.lock:
            obstacle = self.obstacle
            if self.supervisor.mode is Mode.FAULT:
                self.controller.stop_from_state()
                return f'the arm will stop and hold its position after the {obstacle}'
            if obstacle:
                return f'nothing to stop: {obstacle}'
            self.stream.end()
            self.interruption = '~/stop was called'
            return self.controller.stop()

    def fail(self, now: float, fault: Fault) -> None:
        """Begin the fault action."""
        with self.lock:
            self.supervisor.fail(now, fault)
            self._follow_faults()

    def reset(self) -> tuple[bool, str]:
        """Reset a latched fault whose cause has ended; return success and a message."""
        with self.lock:
            return self.supervisor.reset()

    @property
    def reference(self) -> Reference | None:
        """The reference at the last state, or None."""
        return self.controller.reference

    # ------------------------------------------------------------------ states

    def answer(
        self, stamp_ns: int, q: FloatArray, v: FloatArray | None, clock_ns: int | None = None,
        steady_ns: int | None = None, has_several_publishers: Callable[[], bool] = lambda: False,
        fault: Fault | None = None, publish: Callable[[FloatArray], object] | None = None,
    ) -> LoopAnswer:
        """
        Return the effort for a state (q, v), each (n,); v is None if it is not measured.

        The loop calls `publish` as soon as it has the effort; then it evaluates the state for the
        next ones.

        `clock_ns` is the time of this computer and `steady_ns` that of a steady clock, both by
        default the stamp. `has_several_publishers` is called for an implausible state; `fault` was
        found by the caller. Raises ImplausibleStateError and NonFiniteEffortError; the state is
        then dropped.
        """
        with self.lock:
            clock_ns = stamp_ns if clock_ns is None else clock_ns
            steady_ns = clock_ns if steady_ns is None else steady_ns
            now = self._steady = 1e-9 * steady_ns
            try:
                verdict = self.monitor.judge(
                    stamp_ns, clock_ns, q, v, has_several_publishers, steady_ns)
                if verdict.restart or verdict.time_shift or now > self.stream.deadline:
                    self._follow_time(verdict, now)
                is_slow = verdict.dt is None or verdict.dt >= CHECK_PERIOD or (
                    v is not None and self._jumps(v))
                is_due = is_slow or not (
                    0 <= verdict.stamp - self._checked_ns < CHECK_PERIOD_NS)
                if is_slow or not self._is_consistent:
                    self._check(verdict.stamp, q, v)
                answer = self._answer(verdict, q, v, now, fault)
                if publish is not None and answer.effort is not None:
                    publish(answer.effort)
                if self.goal is not None:
                    self._judge_goal()
                self.controller.evaluate(is_due)
                if is_due and not is_slow:
                    self._check(verdict.stamp, q, v)
                return answer
            except ImplausibleStateError as error:
                if error.is_conflict:
                    self.fail(now, Fault(
                        'several_publishers', str(error), recovery=CONTRADICTION))
                raise
            except NonFiniteEffortError as error:
                self.fail(now, Fault('non_finite', str(error), latched=True))
                raise

    def _answer(
        self, verdict: StateVerdict, q: FloatArray, v: FloatArray | None, now: float,
        fault: Fault | None,
    ) -> LoopAnswer:
        controller, supervisor, dt, measured = self.controller, self.supervisor, verdict.dt, q
        if not self._is_consistent or self._frozen is not None:
            q, v, frozen = self._judged(verdict.stamp, q, v, dt or 0.0)
            fault = fault or frozen
        before = controller.state
        output = controller.answer(verdict.stamp, q, v)
        self.states += 1
        if controller.has_lost_velocity:
            controller.has_lost_velocity = False
            self.interruption = 'the joint states have no velocity'
        if output.command is None:
            supervisor.deactivate(now)
            return LoopAnswer(None, output, verdict)
        if not verdict.is_new and not self._awaits_command:
            return LoopAnswer(supervisor.repeat(), output, verdict)
        if output.law.exceeds_limit:
            fault = fault or Fault(FOLLOWING_ERROR, controller.following_error(output, q))
        used, limiter = output.velocity, supervisor.limiter
        if supervisor.mode is Mode.RUNNING and fault is None and (
                now - supervisor.last_state <= supervisor.state_timeout
                and limiter.limits.is_clear(q, used)):  # the usual case
            supervisor.last_state, supervisor.holding = now, output.holding_effort
            passed = dt if dt is not None else now - supervisor.last_output
            supervisor.last_output = now
            effort = limiter.rate_limited(output.command, passed)
            if effort is output.command and output.law.scale == 1.0 and (
                    output.clamped is None):
                return LoopAnswer(effort, output, verdict)
            no_joint = limiter.limits.no_joint
            return LoopAnswer(effort, output, verdict, ActiveLimits(
                no_joint, no_joint, effort != output.command))
        if self.is_active and supervisor.mode is Mode.INACTIVE:
            supervisor.activate()
        braked: Brake = controller.braked
        if self._frozen is not None:
            if self._frozen.is_lost(used, verdict.stamp, supervisor.options.hold_time):
                supervisor.act(now)
            braked = partial(self._frozen.stopping_effort, output, dt or 0.0)
            # The limits are those of the measured joints.
            q, used = measured, None if used is None else np.where(self._frozen.marks, 0.0, used)
        mean = controller.mean_velocity(before, verdict.stamp, q)
        limited = supervisor.answer(
            now, q, used, output.command, output.holding_effort, dt, braked, fault,
            partial(controller.motion_equation, output), mean)
        self._follow_faults()
        if supervisor.mode is Mode.BRAKING:
            self._end_when_stopped(verdict.stamp, q, slower(used, mean), now)
        return LoopAnswer(limited, output, verdict, limiter.active if (
            supervisor.mode is Mode.RUNNING) else None)

    def _jumps(self, v: FloatArray) -> bool:
        """Return whether the velocity differs from that of the last state by more than noise."""
        before, self._velocities = self._velocities, v.tolist()
        return len(before) == len(v) and math.dist(before, self._velocities) > JUMP

    def _check(self, stamp: int, q: FloatArray, v: FloatArray | None) -> None:
        """Check the velocities of a state."""
        self._checked_ns = stamp
        self._is_consistent = self.consistency.update(
            stamp, q, v, self.controller.reference_position)

    @property
    def _awaits_command(self) -> bool:
        """Whether a repeated state is answered: a simulation in lock-step waits for a command."""
        return self.monitor.is_other_clock and self.is_active and self.supervisor.mode in (
            Mode.INACTIVE, Mode.WAITING)

    def _judged(
        self, stamp_ns: int, q: FloatArray, v: FloatArray | None, dt: float,
    ) -> tuple[FloatArray, FloatArray | None, Fault | None]:
        """
        Return position and velocity to use, None to estimate the velocity, and a fault.

        When a velocity comes into doubt, an arm in motion stops from where it is: the wrong
        velocity has driven it away from its reference. A joint without a signal is a fault, in
        which its motion is predicted.
        """
        consistency, fault = self.consistency, None
        if consistency.doubtful.any():
            v = None
            if consistency.reason != self._doubt and not consistency.frozen.any():
                self._doubt = consistency.reason
                self.notice = (
                    f'{consistency.reason}. Velocities are estimated from the positions; a '
                    'motion ends with a stop.')
                if self.controller.has_reference:
                    self.interruption = consistency.reason
                    self.stream.end()
                    if self.controller.has_stopped:
                        self.controller.stop()
                    else:
                        self.controller.stop_from_state()
        if not consistency.frozen.any():
            if self._frozen is not None:
                self._frozen = None
                self.controller.set_without_signal(False)
                self.controller.stop_from_state()
            return q, v, None
        self.controller.set_without_signal(True)
        if self._frozen is None:
            self._frozen = FrozenJoints(
                consistency.frozen, consistency.repeats_since_ns, self.controller, stamp_ns,
                dt, q, v)
            self.controller.stop()
        self._frozen.mark(consistency.frozen)
        fault = Fault('frozen_joint', consistency.reason, recovery=FROZEN_RECOVERY)
        return (*self._frozen.predict(stamp_ns, dt, q, v, self.supervisor.limiter.last), fault)

    def _end_when_stopped(
        self, stamp: int, q: FloatArray, v: FloatArray | None, now: float,
    ) -> None:
        """Begin the ramp to zero if the arm has stopped, and was held for REST_TIME."""
        if self._rest is None or not self.controller.has_stopped or not (
                0 <= stamp - self._rest[0] <= 2 * REST_TIME_NS) or not bool(
                (np.abs(q - self._rest[1]) <= AT_REST).all()):
            self._rest = stamp, q
        elif stamp - self._rest[0] >= REST_TIME_NS and (
                v is None or bool((np.abs(v) <= SLOW).all())):
            self.supervisor.deactivate(now)
            self._follow_faults()

    def _judge_goal(self) -> None:
        """Compare the last state with the tolerances of the goal; forget a goal that has ended."""
        goal, state = self.goal, self.controller.state
        if goal is not None:
            goal.end_if_replaced(self.interruption)
            if state is not None and goal.result is None:
                goal.judge(*state)
            if goal.result is not None:
                self.goal = None
                if goal.result.code is ResultCode.PATH_TOLERANCE_VIOLATED and (
                        not self.interruption):
                    self.interruption = goal.result.message

    def tick(self, now: float) -> FloatArray | None:
        """Return the effort (n,) that is due without a state (fault action, ramp), or None."""
        with self.lock:
            effort = self.supervisor.tick(now)
            self._follow_faults()
            if self.goal is not None:
                self.goal.end_if_replaced(self.interruption)
            return effort

    def _follow_time(self, verdict: StateVerdict, now: float) -> None:
        """Restart if the joint states restart, and end a stream of set-points that has paused."""
        if verdict.restart:
            self.consistency.restart()
            if self.states > 0:
                self.restarts[verdict.restart] += 1
                self._interrupt(f'joint states restarted: {verdict.restart}')
                self.controller.restart_states()
        if verdict.time_shift:
            self.controller.shift_time(verdict.time_shift)
            self.consistency.restart()
        if now > self.stream.deadline:
            self.stream.end()
            self.controller.stop()
            self.paused_streams += 1
            self.interruption = (
                'the stream of set-points paused for more than reference_timeout')
            self.notice = (
                'The stream of set-points paused for more than reference_timeout: the arm stops '
                'and holds its position.')

    def _interrupt(self, reason: str) -> None:
        """End the reference; the arm stops from the next measured state, and is held."""
        self.stream.end()
        if self.controller.has_reference:
            self.interruption = reason
            self.controller.stop_from_state()

    def _follow_faults(self) -> None:
        """End the reference when a fault begins; apply the options that await the end."""
        supervisor, controller = self.supervisor, self.controller
        if supervisor.fault_count != self._fault_count and supervisor.fault is not None:
            self._fault_count = supervisor.fault_count
            if self.goal is not None:
                goal, self.goal = self.goal, None
                goal.fail(supervisor.fault)
            if self._frozen is None:
                self._interrupt(str(supervisor.fault))
            else:
                self.stream.end()
                self.interruption = str(supervisor.fault)
        controller.may_hold = supervisor.mode in (Mode.WAITING, Mode.RUNNING, Mode.BRAKING)
        if supervisor.mode in (Mode.STOPPING, Mode.INACTIVE) and controller.has_reference:
            controller.forget_reference()  # the arm may move until the next command
        if self._next_options is not None and supervisor.mode in (Mode.STOPPING, Mode.INACTIVE):
            options, self._next_options = self._next_options, None
            controller.set_options(options)

    def set_monitor_age(self, max_age: float) -> None:
        """Set the largest age of a state [s], 0 for any age."""
        if max_age < 0.0:
            raise InvalidInputError(f'max_age is {max_age}, expected at least 0')
        self.monitor.max_age = max_age
