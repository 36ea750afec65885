# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control law of an arm with its reference: from a measured state to an effort, without ROS.

Time on this path is the stamp of the joint states. A lock-step simulation or a recording therefore
gives the same efforts at any playback speed.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
import math
import threading
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput, NonFiniteEffortError
from robot_dynamics.control.followed_reference import FollowedReference, LastState, Prepared
from robot_dynamics.control.gains.gain_scaling import Candidates, StableGains
from robot_dynamics.control.gains.oscillation import REST_SPEED
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput, LawTopic
from robot_dynamics.control.laws.error_feedback import Tracking
from robot_dynamics.control.laws.law_table import all_laws, NO_COMMAND
from robot_dynamics.control.loaded_arm import LoadedArm
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_bounds import EffortBounds, NOTHING, robot_effort
from robot_dynamics.control.scaled_laws import ScaledLaws
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.payload import Payload
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory


class Controller:
    """
    Computes efforts from measured states; safe to call from several threads.

    `answer` is the control path. The other methods change its next results. They prepare their
    data outside the lock and hold the lock only while they exchange these data.
    """

    def __init__(
        self, arm: ArmModel, options: ControllerOptions, law: ControlLaw | None = None,
        lock: AbstractContextManager[object] | None = None,
    ) -> None:
        """
        Use the law that `options.command` names, or the given `law`.

        `lock` protects the control path; `ControlLoop` shares it.
        """
        self.arm = arm
        self.lock: AbstractContextManager[object] = threading.RLock() if lock is None else lock
        self._exchange = threading.Lock()
        """Held while loads and gravity are prepared and exchanged."""
        self._given_law = law
        self.load = LoadedArm(arm)
        """The dynamics with the active loads, and those for planning."""
        self.followed = FollowedReference(arm)
        """The trajectory or stop that is followed."""
        self.gains = StableGains(arm.joint_count)
        """Period and noise of the joint states, and the bandwidth that they allow."""
        self._interval = 0.0
        """Time of the last state after the one before [s]."""
        self._candidates: Candidates = ()
        self._tracking: Tracking | None = None
        self.state: LastState | None = None
        """The last state with a velocity, or None."""
        self.may_hold = True
        """Whether a stop may begin, if `stops_and_holds`; not during a fault."""
        self.options = options
        """The options in use."""
        self.set_options(options)

    def set_options(self, options: ControllerOptions) -> None:
        """
        Apply gains, law and limits; a change of the law ends the reference.

        Raises InvalidInputError for an unknown law.
        """
        laws = ScaledLaws(self.arm, options, self.gains, self._given_law)
        bounds = EffortBounds(
            self.arm.limits.effort, options.effort_limit_fraction, self.arm.drive)
        robot = None if options.effort_convention.robot_gravity is None else (
            UncheckedArmDynamics(self.arm.with_gravity(options.effort_convention.robot_gravity)))
        with self.lock:
            if options.command != self.options.command:
                self.followed.end()
            self.options, self.laws, self._bounds, self._robot = options, laws, bounds, robot
            self.law = laws.law
            """The law that `options.command` names."""
            self._limit_motion()

    def _limit_motion(self) -> None:
        """Derive the limits of references and gains from the arm, the load and the options."""
        options, workspace, scaled = self.options, self.load.workspace, self._bounds.scaled
        rate = np.broadcast_to(options.effort_rate, scaled.shape)
        self._motion_limits = (
            workspace.motion_limits(scaled, rate) if options.conditions_references else None)
        self.followed.generator.stream_timeout = options.stream_timeout
        self.followed.brake = lambda limits, q, v: limits.with_braking(
            self.load.dynamics.rigid_body, scaled, rate, q, v)
        self.laws.limit(workspace, rate)
        self._scale_references()

    def _scale_references(self) -> None:
        """Follow new references with the fraction of the limits that the gains permit."""
        limits = self._motion_limits
        self.followed.limits = None if limits is None else (
            limits.slower(self.gains.reference_scale))

    # ------------------------------------------------------------------ references

    def follow(self, trajectory: JointTrajectory, stamp_ns: int = 0) -> None:
        """
        Follow a trajectory from `stamp_ns`; 0 means now, which is the stamp of the newest state.

        Raises TrajectoryError if no reference can be followed, if the trajectory has already
        ended, or if the arm cannot follow it.
        """
        prepared = self.prepare(trajectory)
        with self.lock:
            self.start(prepared, stamp_ns)

    def prepare(self, trajectory: JointTrajectory) -> Prepared:
        """Return a trajectory that the arm can follow, for `start`; raise TrajectoryError."""
        self._check_follows()
        return self.followed.feasible(trajectory, self.load.planning, self.options)

    def start(self, prepared: Prepared, stamp_ns: int, latest: float = math.inf) -> None:
        """
        Follow a prepared trajectory; the caller holds `lock`.

        Raises TrajectoryError, also if it would end more than `latest` [s] late.
        """
        self.followed.start(*prepared, self._check_follows(), stamp_ns, latest)

    def _check_follows(self) -> tuple[int, FloatArray, FloatArray]:
        """Return the last state; raise TrajectoryError if no reference can start from it."""
        if not self.laws.follows:
            names = [name for name, law in all_laws().items() if law.follows]
            raise TrajectoryError(
                f'command is {self.options.command!r}, expected '
                f'{" or ".join(map(repr, names))} to follow a reference')
        if self.state is None:
            raise TrajectoryError(
                'no joint state has been received, so that there is no state to start from')
        return self.state

    def stop(self) -> str:
        """Stop as early as the limits permit, and hold; return a report."""
        with self.lock:
            if self.options.command == NO_COMMAND or self.state is None:
                return 'nothing to stop: the node does not command the arm'
            start = 'along the reference' if self.followed.active else 'from the measured state'
            self.followed.stop(*self.state)
            return f'stopping {start}, then holding the position'

    @property
    def has_stopped(self) -> bool:
        """Whether no reference is active, or it has ended at the last state."""
        active = self.followed.active
        return active is None or self.state is not None and self.state[0] >= active.end_ns

    def stop_from_state(self) -> None:
        """End the reference; stop from the next measured state and hold if `stops_and_holds`."""
        with self.lock:
            self.followed.end(self.options.stops_and_holds)

    @property
    def reference(self) -> Reference | None:
        """The reference at the last state, None without one."""
        active, state = self.followed.active, self.state
        return None if active is None or state is None else active.sample(state[0])

    @property
    def trajectory(self) -> ActiveTrajectory | None:
        """The trajectory or stop that is followed, or None."""
        return self.followed.active

    def position_error(self, reference: FloatArray, q: FloatArray) -> FloatArray:
        """Return reference minus q (n,); of continuous joints the shortest angle."""
        return self.laws.feedback.position_error(reference, q)

    # ------------------------------------------------------------------ the arm

    @property
    def dynamics(self) -> UncheckedArmDynamics:
        """The dynamics of the control path, with the active loads."""
        return self.load.dynamics

    def set_payloads(
        self, payloads: Sequence[Payload], transition_time: float,
        when_done: Callable[[tuple[Payload, ...]], None],
    ) -> None:
        """
        Replace the active payloads with `payloads` over transition_time [s].

        `when_done` is called with the new payloads once they are active: immediately if
        transition_time is 0.
        """
        with self._exchange:
            load = self.load.prepare(payloads)
            with self.lock:
                self.load.begin_transition(load, transition_time, when_done)
                self._limit_motion()
        if transition_time == 0.0:
            when_done(load.dynamics.arm.payloads)

    def set_gravity(self, gravity: FloatArray, rate: float) -> None:
        """
        Change gravity to `gravity` (3,) in the base frame [m/s²], at most by `rate` [m/s³].

        The gravity of the control path changes with the stamps of the states; planning uses the
        new gravity at once.
        """
        with self._exchange:
            load = self.load.prepare(gravity=gravity)
            with self.lock:
                self.load.begin_gravity_change(load, rate)
                self._limit_motion()

    def deliver(self, topic: LawTopic, message: Any) -> None:
        """Let the law take a message of a topic, between two states, if the topic is its own."""
        with self.lock:
            if topic in self.law.TOPICS:
                topic.take(self.law, message)

    # ------------------------------------------------------------------ the control path

    def answer(
        self, stamp_ns: int, q: FloatArray, v: FloatArray, candidates: Candidates = (),
    ) -> ControlOutput:
        """
        Return the efforts for the state (q, v), each (n,), at stamp_ns.

        The caller holds `lock`, and calls `evaluate` afterwards. v is one of the `candidates`, by
        default the only one. Raises NonFiniteEffortError if an effort is not finite: the state is
        outside the range of the model.
        """
        load, gains, laws = self.load, self.gains, self.laws
        if load.changes:
            load.advance(stamp_ns)
        law, q_ahead, last = laws.at_rest, q, self.state
        self._interval = 0.0 if last is None else 1e-9 * (stamp_ns - last[0])
        self._candidates = candidates or ((v, 0.0),)
        self.state = stamp_ns, q, v
        reference = self.followed
        trajectory = reference.generator.active
        if self.may_hold and (
                laws.holds or reference.stops_next if trajectory is None else
                trajectory is reference.first_stop and (last is None or stamp_ns != last[0])):
            trajectory = reference.stop_from(last is None, stamp_ns, q, v)
        if trajectory is not None:
            law = laws.with_reference
            if gains.lag > 0.0:  # the arm moves before the effort acts
                q_ahead = q + gains.lag * v
        state = LawInput(load.dynamics, stamp_ns, q, v, q_ahead, trajectory, laws.feedback)
        answer, options, drive = law(state), self.options, self.arm.drive
        effort, bounds, self._tracking = answer.effort, self._bounds, answer.tracking
        is_clear = bounds.range.contains(effort.tolist())
        if not is_clear and not np.isfinite(effort).all():
            raise NonFiniteEffortError(
                f'the efforts at position {q.tolist()} are not finite: gravity '
                f'{state.gravity.tolist()}, command {effort.tolist()}')
        own = self._robot if self._robot is not None else load.unloaded
        robot = NOTHING
        if options.effort_convention.robot_compensates:
            robot = robot_effort(
                options.effort_convention, own.rigid_body.gravity(state.q),
                0.0 if effort is answer.gravity else answer.friction, drive)
        output = ControlOutput(
            state, answer, gains.least * answer.scale, robot, own, bounds, drive, self.lock)
        if options.command == NO_COMMAND:
            return output
        output.command = effort
        if answer.scale < 1.0:
            output.limits = ('scaled gains',)
        if robot is not NOTHING or not is_clear:
            output.command, clamped = bounds.bounded(
                robot.command(effort), robot,
                None if effort is answer.gravity else output.holding_torque())
            if clamped.any():
                output.clamped, output.limits = clamped, (*output.limits, 'effort limit')
        if drive is not None:
            output.command = drive.command(output.command)
        return output

    def evaluate(self) -> None:
        """Adapt gains and references to the last state; the caller holds `lock`."""
        laws, state, tracking = self.laws, self.state, self._tracking
        if state is None or not self.options.scales_gains:
            return
        (stamp_ns, _, v), oscillation = state, laws.oscillation
        has_changed = self.gains.take(self._interval, self._candidates)
        if tracking is not None and self.gains.is_known and (
                tracking.largest > REST_SPEED or oscillation.factor < 1.0):
            has_changed |= oscillation.take(
                1e-9 * stamp_ns, tracking.error, tracking.velocity - v)
        if has_changed:
            laws.scale()
            self._scale_references()
