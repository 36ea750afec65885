# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control loop: from a measured state to the effort that is commanded, without ROS.

The node `dynamics`, the benchmark `safe_motion` and the tests use this class. A state passes, in
this order: the gate, which judges its values (`gate`), the control law with its reference
(`controller`), the limits of the effort (`effort_limiter`) and the supervisor (`supervisor`).

With a law that follows references, the arm always has a reference while it is commanded: it stops
from the first measured state, and after each fault, and is held there. Before the command ends
(`deactivate`, `command: none`) the arm stops and is held; then `end_action` decides.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.braking import braked, braking_share, coasting
from robot_dynamics.control.control_output import ControlOutput, NonFiniteEffortError
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.drive_check import DriveCheck
from robot_dynamics.control.endings import Endings
from robot_dynamics.control.gate import Gate, Signals
from robot_dynamics.control.goal_execution import GoalExecution
from robot_dynamics.control.laws.control_law import ControlLaw
from robot_dynamics.control.laws.law_table import NO_COMMAND
from robot_dynamics.control.options import (
    ControllerOptions,
    default_limits,
    default_options,
    DEFAULT_STATE_MAX_AGE,
)
from robot_dynamics.control.rest import is_held
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault, FOLLOWING_ERROR
from robot_dynamics.control.safety.motion_checks import frozen_joint
from robot_dynamics.control.safety.supervisor import Brake, CommandSupervisor, Mode
from robot_dynamics.control.trajectory_goal import Tolerances, TrajectoryGoal
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.monitoring.state_plausibility import (
    CONTRADICTION,
    ImplausibleStateError,
    StateVerdict,
)
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

_ENDS = {
    Mode.BRAKING: 'the arm is being stopped, because the command ends',
    Mode.STOPPING: 'the command is being ramped to zero'}
STOPPED = '~/stop was called'


class LoopAnswer(NamedTuple):
    """
    The answer to a state: the effort to publish (n,), or None, and what led to it.

    `limits` are the names of the limits that have changed the effort.
    """

    effort: FloatArray | None
    output: ControlOutput
    verdict: StateVerdict
    limits: tuple[str, ...] = ()


class ControlLoop:
    """
    Controls one arm; safe to call from several threads.

    `answer` takes the states. Times are those of a steady clock [s], stamps [ns] those of the
    states.
    """

    def __init__(
        self, controller: Controller, limits: EffortLimits, safety: SafetyOptions,
        before: 'ControlLoop | None' = None,
    ) -> None:
        """
        Control the arm of a controller, whose lock the loop shares; `activate` begins.

        `before` is the loop of an earlier model. For the same joints the effort continues from its
        last one without a step; a latched fault persists in any case.
        """
        arm = controller.arm
        self.controller, self.lock = controller, controller.lock
        self.goals = GoalExecution(controller, lambda: self.obstacle, lambda: self._steady)
        self.gate = Gate(
            arm.joint_names, arm.is_continuous, arm.limits.velocity, DEFAULT_STATE_MAX_AGE,
            lambda: controller.reference, partial(is_held, controller),
            lambda: self.supervisor.limiter.last is not None, lambda: controller.gains.choice)
        self.supervisor = CommandSupervisor(arm.joint_names, limits, safety)
        self.gate.plausibility.is_lock_step = safety.is_lock_step
        if before is not None:
            self._continue(before.supervisor)
        self._endings = Endings(controller, self.goals, self.supervisor)
        self.drives = DriveCheck(controller)
        self.is_heard = True
        """Whether a drive receives the command."""
        self.is_active = False
        self.restarts: Counter[str] = Counter()
        self.states = 0
        """Number of answered states."""
        self._steady = 0.0
        self._output: ControlOutput | None = None
        """The output for the last new state."""
        if self.supervisor.limiter.last is not None:
            self.drives.go_on()
        if before is not None and before.is_active:
            self.activate()

    @classmethod
    def of_arm(
        cls, arm: ArmModel, law: ControlLaw | None = None, **options: Any,
    ) -> 'ControlLoop':
        """
        Return an active loop with the default parameters of the node `dynamics`.

        `options` replace those of `ControllerOptions`, such as `gains` or `command`.
        """
        loop = cls(
            Controller(arm, default_options(arm, **options), law), default_limits(arm),
            SafetyOptions())
        loop.activate()
        return loop

    def _continue(self, old: CommandSupervisor) -> None:
        new = self.supervisor
        if old.joint_names == new.joint_names:
            old.set_options(new.limiter.limits, new.options)
            self.supervisor = old
        elif old.is_latched:
            new.fault = old.fault

    # ------------------------------------------------------------------ requests

    def activate(self) -> None:
        """Command efforts from the next state on."""
        with self.lock:
            self.is_active = True
            self.supervisor.activate()
            self._endings.follow(self._steady)

    def deactivate(self, now: float, reason: str = 'the node was deactivated') -> None:
        """Stop the arm, hold it, end the command by `end_action`, and be inactive."""
        with self.lock:
            self.is_active = False
            self._endings.end(now, Ending(Kind.RELEASE, reason))

    def set_options(
        self, options: ControllerOptions, limits: EffortLimits, safety: SafetyOptions,
    ) -> None:
        """Apply options; `command: none` takes effect once the arm has stopped."""
        with self.lock:
            controller = self.controller
            before = controller.options.command
            reason = f'command was set to {options.command!r}'
            if options.command == NO_COMMAND != before and self.supervisor.mode in (
                    Mode.RUNNING, Mode.FAULT, Mode.BRAKING):
                self._endings.awaiting, options = options, replace(options, command=before)
                self._endings.end(self._steady, Ending(Kind.RELEASE, reason))
            else:
                if self._endings.awaiting is not None:
                    self._endings.awaiting = None
                    self.supervisor.resume()
                if options.command != before:
                    self.goals.end(Ending(Kind.HOLD, reason))
            controller.set_options(options)
            self.goals.stream.timeout = options.stream_timeout
            self.supervisor.set_options(limits, safety)
            self.gate.plausibility.is_lock_step = safety.is_lock_step

    def follow(self, trajectory: JointTrajectory, stamp_ns: int = 0) -> None:
        """
        Follow a trajectory from `stamp_ns` on, 0 for the newest state.

        Raises TrajectoryError if it cannot be followed.
        """
        self.goals.follow(trajectory, stamp_ns)

    def execute(
        self, trajectory: JointTrajectory, stamp_ns: int = 0, tolerances: Tolerances | None = None,
        when_done: Callable[[], object] = lambda: None,
    ) -> TrajectoryGoal:
        """
        Follow a trajectory and judge it by tolerances; the goal before ends.

        `when_done` is called when the goal has a result, and must return soon. Raises
        TrajectoryError if the trajectory cannot be followed, or not within its own time.
        """
        return self.goals.execute(trajectory, stamp_ns, tolerances, when_done)

    @property
    def obstacle(self) -> str:
        """The reason why no reference can be followed now, empty if one can."""
        with self.lock:
            mode, fault = self.supervisor.mode, self.supervisor.standing_fault
            if not self.is_active:
                return 'the node is not active'
            return _ENDS.get(mode, '' if fault is None else str(fault))

    def stop(self) -> str:
        """Stop the arm and hold its position, whatever was sent before; return a report."""
        with self.lock:
            obstacle = self.obstacle
            if obstacle and self.supervisor.mode is not Mode.FAULT:
                self.goals.refuse(STOPPED)
                return f'nothing to stop: {obstacle}'
            report = self._endings.end(self._steady, Ending(Kind.HOLD, STOPPED))
            return report if not obstacle else (
                f'the arm will stop and hold its position after the {obstacle}')

    def end(self, now: float, ending: Ending) -> None:
        """Execute an ending, from wherever it was raised, such as a fault, at a time [s]."""
        with self.lock:
            self._endings.end(now, ending)

    def reset(self) -> tuple[bool, str]:
        """Reset a latched fault whose cause has ended; return success and a message."""
        with self.lock:
            done, words = self.supervisor.reset()
            if done:
                self.goals.interruption = ''
            return done, words

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

        The loop calls `publish` as soon as it has the effort, before it evaluates the state.
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
                if v is None and self.supervisor.options.requires_velocities:
                    raise ImplausibleStateError(
                        'no velocity', 'velocity is empty, expected one value per joint '
                        '(require_measured_velocities)')
                signals = self.gate.take(
                    stamp_ns, q, v, clock_ns, steady_ns, has_several_publishers)
                if signals.verdict.restart and self.states > 0:
                    self.restarts[signals.verdict.restart] += 1
                    self._endings.restart(now, signals.verdict.restart)
                    self.drives.restart()
                if now > self.goals.stream.deadline:
                    self._endings.end(now, self.goals.pause())
                answer = self._answer(signals, now, fault)
                if publish is not None and answer.effort is not None:
                    publish(answer.effort)
                if signals.verdict.is_new:
                    wrong = self.drives.take(
                        1e-9 * signals.verdict.stamp, answer.output, signals.candidates[0][0],
                        answer.effort if self.is_heard else None)
                    if wrong is not None:
                        self.end(now, Ending.by(wrong))
                    if self.goals.goal is not None:
                        self.goals.judge()
                    self.controller.evaluate()
                return answer
            except ImplausibleStateError as error:
                if error.is_conflict:
                    self.end(now, Ending.by(Fault(
                        'several_publishers', str(error), recovery=CONTRADICTION)))
                raise
            except NonFiniteEffortError as error:
                self.end(now, Ending.by(Fault('non_finite', str(error), latched=True)))
                raise

    def _answer(self, signals: Signals, now: float, fault: Fault | None) -> LoopAnswer:
        controller, supervisor = self.controller, self.supervisor
        q, v, verdict, candidates, lost = signals
        if not verdict.is_new and self._output is not None and not self._awaits_command:
            return LoopAnswer(supervisor.repeat(), self._output, verdict)
        if lost is not None:
            fault = fault or frozen_joint(controller.arm.joint_names, lost)
            if supervisor.is_held_in_vain(v):
                supervisor.end(now, Ending.by(fault, Kind.RELEASE_NOW))
        output = self._output = controller.answer(verdict.stamp, q, v, candidates)
        self.states += 1
        if output.command is None:
            supervisor.end(now, Ending(Kind.RELEASE_NOW, 'there is no command'))
            return LoopAnswer(None, output, verdict)
        if output.law.tracking is not None and 1e-9 * verdict.stamp < self.drives.soft_until:
            output.command = self.drives.softened(1e-9 * verdict.stamp, output, output.command)
        tracking = output.law.tracking
        if tracking is not None and tracking.exceeds_limit:
            fault = fault or Fault(FOLLOWING_ERROR, output.state.feedback.worst_error(
                tracking.error, controller.arm.joint_names))
        if fault is None:
            effort = supervisor.usual(now, q, v, output.command, output.holding_effort, verdict.dt)
            if effort is not None:
                return LoopAnswer(effort, output, verdict, output.limits if (
                    effort is output.command) else (*output.limits, 'effort rate'))
        if self.is_active and supervisor.mode is Mode.INACTIVE:
            supervisor.activate()
        brake: Brake = partial(
            braked, controller, returns=supervisor.was_inside, lost=lost,
            planned=self.gate.planned)
        limited = supervisor.answer(
            now, q, v, output.command, output.holding_effort, verdict.dt, brake, fault,
            output.motion_equation, output.state.trajectory is not None)
        if lost is not None:
            self.gate.braking = braking_share(controller, *supervisor.damping)
        self._endings.follow_state(now, verdict.stamp, q, v)
        return LoopAnswer(limited, output, verdict, output.limits + (
            supervisor.limiter.active if supervisor.mode is Mode.RUNNING else ()))

    @property
    def _awaits_command(self) -> bool:
        """Whether a repeated state is answered: a simulation in lock-step waits for a command."""
        waits = self.supervisor.mode in (Mode.INACTIVE, Mode.WAITING)
        return self.is_active and waits and self.gate.plausibility.is_other_clock

    def tick(self, now: float) -> FloatArray | None:
        """Return the effort (n,) that is due without a state (fault action, ramp), or None."""
        with self.lock:
            effort = self.supervisor.tick(now, partial(coasting, self.controller))
            self._endings.follow(now)
            if effort is not None and self.controller.state is not None:
                self.drives.command(
                    1e-9 * self.controller.state[0] + now - self._steady, effort)
            return effort
