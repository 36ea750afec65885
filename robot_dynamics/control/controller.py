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

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.control_output import ControlOutput, non_finite_effort
from robot_dynamics.control.followed_reference import FollowedReference
from robot_dynamics.control.gains.adaptation import Adaptation
from robot_dynamics.control.gains.gain_scaling import loop_gains, LoopGains, StableGains
from robot_dynamics.control.laws.cartesian_impedance import CartesianImpedance
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import (
    ControlLaw,
    further_laws,
    GravityCompensation,
    LawFactory,
    LawInput,
    LawOutput,
    load_law,
)
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.hand_guiding import HandGuiding
from robot_dynamics.control.laws.joint_impedance import JointImpedance
from robot_dynamics.control.loaded_arm import LoadedArm
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.effort_bounds import EffortBounds, NOTHING, robot_effort
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.joints.angle_wrapping import nearest_turn
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.model.payload import Payload
from robot_dynamics.monitoring.velocity_estimate import VelocityEstimate
from robot_dynamics.references.follower import ActiveTrajectory
from robot_dynamics.references.motion_limits import WorkspaceInertia
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

LAWS: dict[str, LawFactory] = {
    'cartesian_impedance': CartesianImpedance,
    'computed_torque': ComputedTorque,
    'gravity_compensation': GravityCompensation,
    'hand_guiding': HandGuiding,
    'joint_impedance': JointImpedance,
}
"""The control laws of this package, by the values of the parameter `command`."""
NO_COMMAND = 'none'
LONGEST_DIFFERENCE = 0.1
"""[s] between two states whose positions give the velocity at which a stop starts."""
USUAL_FRICTION = 0.1
"""Largest dry friction of usual gearboxes, as a fraction of the effort limit."""
HELD_ERROR = 0.03
"""[rad] or [m] that a joint may be away from its reference without friction."""
FAULT_DAMPING = 0.5
"""Fraction of K_d with which a joint is damped in a fault."""

LastState = tuple[int, FloatArray, FloatArray]
"""A stamp [ns], and the position and velocity (n,) in use."""
Prepared = tuple[JointTrajectory, float]
"""A trajectory that the arm can follow, and the factor by which it was slowed down."""


def command_modes() -> tuple[str, ...]:
    """Return the values of the parameter `command`: all laws, and `none`."""
    return (*LAWS, *sorted(further_laws().keys() - LAWS.keys()), NO_COMMAND)


class Controller:
    """
    Computes efforts from measured states; safe to call from several threads.

    `update` is the control path. The other methods change its next results. They prepare their
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
        self._load = LoadedArm(arm)
        self._reference = FollowedReference(arm)
        self._gains = StableGains(arm.joint_kinds)
        self._restore_gains()
        self._velocity = VelocityEstimate(arm.is_continuous)
        self.state: LastState | None = None
        """The last state with a velocity, or None."""
        self._is_estimated = False
        """Whether the velocity of the last state was estimated from positions."""
        self._first_stop: ActiveTrajectory | None = None
        """The stop at a first state, which the second state replaces."""
        self.has_lost_velocity = False
        """Whether a reference has ended because states have no velocity; the reader resets it."""
        self.may_hold = True
        """Whether a stop may begin, if `stops_and_holds`; not during a fault."""
        self._options = options
        self.set_options(options)

    def set_options(self, options: ControllerOptions) -> None:
        """
        Apply gains, law and limits; a change of the law ends the reference.

        Raises InvalidInputError for an unknown law.
        """
        feedback = ErrorFeedback(
            options.gains, self.arm.joint_kinds, options.largest_error(self.arm.limits.velocity))
        gravity = GravityCompensation(feedback, options)
        law = gravity if options.command == NO_COMMAND else self._make_law(feedback, options)
        bounds = EffortBounds(
            self.arm.limits.effort, options.effort_limit_fraction, self.arm.drive)
        robot = None if options.effort_convention.robot_gravity is None else (
            UncheckedArmDynamics(self.arm.with_gravity(options.effort_convention.robot_gravity)))
        with self.lock:
            if options.command != self._options.command:
                self._reference.clear()
            self._restore_gains()
            self._options, self._feedback, self._bounds = options, feedback, bounds
            self._robot = robot
            self._law_at_rest: ControlLaw = gravity if law.follows else law
            self._stop_law: ControlLaw = law if isinstance(law, ComputedTorque) else (
                ComputedTorque(feedback, options))
            self._own_law = law if law.follows else self._stop_law
            self._law_with_reference = self._own_law
            self._follows = law.follows
            self._limit_motion()

    def _make_law(self, feedback: ErrorFeedback, options: ControllerOptions) -> ControlLaw:
        if self._given_law is not None:
            return self._given_law
        if options.command in LAWS:
            return LAWS[options.command](feedback, options)
        if options.command not in further_laws():
            raise InvalidInputError(
                f'command is {options.command!r}, expected one of {list(command_modes())}')
        return load_law(options.command)(feedback, options)

    def _limit_motion(self) -> None:
        """Derive the limits of references and gains from the arm, the load and the options."""
        options, workspace, scaled = self._options, self._load.workspace, self._bounds.scaled
        rate = np.broadcast_to(options.effort_rate, scaled.shape)
        self._reference.limit(
            workspace.motion_limits(scaled, rate) if options.conditions_references else None,
            options.stream_timeout, lambda limits, q, v: limits.with_braking(
                self._load.dynamics.rigid_body, scaled, rate, q, v))
        self._gains_of_laws: dict[int, LoopGains] = {}
        for law in (self._own_law, self._stop_law):
            if id(law) not in self._gains_of_laws:
                self._gains_of_laws[id(law)] = loop_gains(law.closed_loop, workspace.matrices)
                if options.scales_gains:
                    law.limit_rate(rate, workspace.row_sums())
        self._use_law(self._law_with_reference)

    def _use_law(self, law: ControlLaw) -> None:
        """Follow references with this law, at the bandwidth that states and oscillations allow."""
        options = self._options
        self._law_with_reference, self.loop_gains = law, self._gains_of_laws[id(law)]
        self._gains.set_loop_gains(
            self.loop_gains if options.scales_gains else None,
            np.broadcast_to(options.effort_rate, self._bounds.scaled.shape))
        self._scale_motion()

    def set_without_signal(self, is_without: bool) -> None:
        """Stop by computed torque while a joint has no signal: its motion is predicted with it."""
        law = self._stop_law if is_without else self._own_law
        if law is not self._law_with_reference:
            self._use_law(law)

    def _restore_gains(self) -> None:
        """Forget what the loop has learned, because it changes."""
        self.adaptation = Adaptation(self.arm.joint_names, self.arm.limits.velocity)
        self._followed: tuple[LawInput, LawOutput] | None = None

    def _scale_motion(self) -> None:
        """Scale gains and references to the bandwidth that states and oscillations allow."""
        law = self._law_with_reference
        self._reference.scale(self._gains.reference_scale)
        scale = self._gains.scale * self.adaptation.scale
        for each in (law, self._law_at_rest):
            each.scale_gains(scale)
        self.adaptation.apply(law)

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
        return self._reference.feasible(trajectory, self._load.planning, self._options)

    def start(self, prepared: Prepared, stamp_ns: int, latest: float = math.inf) -> None:
        """
        Follow a prepared trajectory; the caller holds `lock`.

        Raises TrajectoryError, also if it would end more than `latest` [s] late.
        """
        self._reference.start(*prepared, self._check_follows(), stamp_ns, latest)

    def _check_follows(self) -> tuple[int, FloatArray, FloatArray]:
        """Return the last state; raise TrajectoryError if no reference can start from it."""
        if not self._follows:
            names = [name for name in command_modes()
                     if name not in ('gravity_compensation', 'hand_guiding', NO_COMMAND)]
            raise TrajectoryError(
                f'command is {self._options.command!r}, expected '
                f'{" or ".join(map(repr, names))} to follow a reference')
        if self.state is None:
            raise TrajectoryError(
                'no joint state with velocities has been received, so that there is no state to '
                'start from')
        return self.state

    def stop(self) -> str:
        """Stop as early as the limits permit, and hold; return a report."""
        with self.lock:
            if self._options.command == NO_COMMAND or self.state is None:
                return 'nothing to stop: the node does not command the arm'
            start = 'along the reference' if self._reference.active else 'from the measured state'
            self._reference.stop(*self.state)
            return f'stopping {start}, then holding the position'

    @property
    def has_stopped(self) -> bool:
        """Whether no reference is active, or it has ended at the last state."""
        active = self._reference.active
        return active is None or self.state is not None and self.state[0] >= active.end_ns

    def forget_reference(self) -> None:
        """End the reference; a law that follows continues with a stop, if `stops_and_holds`."""
        with self.lock:
            self._reference.clear()

    def stop_from_state(self) -> None:
        """End the reference; stop from the next measured state and hold if `stops_and_holds`."""
        with self.lock:
            self._reference.stop_from_next(self._options.stops_and_holds)

    def restart_states(self) -> None:
        """Treat the next state as a first one: it need not be consistent with the last state."""
        with self.lock:
            self.state = None
            self._velocity.restart()

    def shift_time(self, shift_ns: int) -> None:
        """Continue the reference unchanged when the stamps of the states decrease by shift_ns."""
        with self.lock:
            self._reference.shift_time(shift_ns)

    @property
    def reference(self) -> Reference | None:
        """The reference at the last state, None without one."""
        active, state = self._reference.active, self.state
        return None if active is None or state is None else active.sample(state[0])

    @property
    def trajectory(self) -> ActiveTrajectory | None:
        """The trajectory or stop that is followed, or None."""
        return self._reference.active

    def position_error(self, reference: FloatArray, q: FloatArray) -> FloatArray:
        """Return reference minus q (n,); of continuous joints the shortest angle."""
        return self._feedback.position_error(reference, q)

    def reference_position(self) -> FloatArray | None:
        """Return the position of the reference (n,) at the last state, None without one."""
        reference = self.reference
        return None if reference is None else reference.position

    # ------------------------------------------------------------------ the arm

    @property
    def options(self) -> ControllerOptions:
        """The options in use."""
        return self._options

    @property
    def follows(self) -> bool:
        """Whether the law follows references."""
        return self._follows

    @property
    def loaded_arm(self) -> ArmModel:
        """The arm with its active loads."""
        return self._load.dynamics.arm

    @property
    def estimates_velocity(self) -> bool:
        """Whether velocities that are not measured are estimated from the positions."""
        return self._options.estimates_velocity

    @property
    def dynamics(self) -> UncheckedArmDynamics:
        """The dynamics of the control path, with the active loads."""
        return self._load.dynamics

    @property
    def planning_dynamics(self) -> ArmDynamics:
        """Dynamics of the arm with its loads, or those that a transition leads to."""
        return self._load.planning

    @property
    def compensates_friction_at_rest(self) -> bool:
        """Whether dry friction is compensated at joints that rest away from their goal."""
        friction = self.arm.friction
        return self._follows and self._options.friction_compensation == 'reference' and bool(
            (friction.at_rest.static + friction.load_coefficient).any())

    @property
    def has_reference(self) -> bool:
        """Whether a reference is active."""
        return self._reference.active is not None

    @property
    def slowness(self) -> float:
        """Factor by which the last trajectory was slowed down."""
        return self._reference.slowness

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
            load = self._load.prepare(payloads)
            with self.lock:
                self._restore_gains()
                if transition_time == 0.0:
                    self._load.replace(load)
                else:
                    self._load.begin_transition(load, transition_time, when_done)
                self._limit_motion()
        if transition_time == 0.0:
            when_done(load.payloads)

    def set_gravity(self, gravity: FloatArray, rate: float) -> None:
        """
        Change gravity to `gravity` (3,) in the base frame [m/s²], at most by `rate` [m/s³].

        The gravity of the control path changes with the stamps of the states; planning uses the
        new gravity at once.
        """
        with self._exchange:
            load = self._load.prepare(gravity=gravity)
            with self.lock:
                self._load.begin_gravity_change(load, rate)
                self._limit_motion()

    def feel(self, external: FloatArray) -> None:
        """Let the law without a reference feel an external effort (n,) from the last state on."""
        if self.state is not None:
            self._law_at_rest.feel(external, self.state[0])

    def __repr__(self) -> str:
        following = 'following a reference' if self.has_reference else 'no reference'
        return f'<Controller of {self.loaded_arm!r}, {self._options.command}, {following}>'

    # ------------------------------------------------------------------ the control path

    def update(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> ControlOutput:
        """
        Return the efforts for the state (q, v) measured at stamp_ns; v may be unknown (None).

        Without a velocity, measured or estimated, only gravity compensation is computed. Raises
        NonFiniteEffortError if an effort is not finite: the state is outside the range of the
        model.
        """
        with self.lock, np.errstate(over='ignore', invalid='ignore'):
            if not np.isfinite(q).all():
                raise non_finite_effort(q, np.full_like(q, np.nan), np.full_like(q, np.nan))
            output = self.answer(stamp_ns, q, v)
            self.evaluate()
            return output

    def answer(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> ControlOutput:
        """Do the same as `update`; the caller holds `lock`, and calls `evaluate` afterwards."""
        velocity_delay = 0.0
        load, gains = self._load, self._gains
        if load.changes:
            load.advance(stamp_ns)
        if v is None and self._options.estimates_velocity:
            if self.state is not None and not self._is_estimated:
                self._velocity.restart()
                self._velocity.update(*self.state[:2])
            v, velocity_delay = self._velocity.update(stamp_ns, q), self._velocity.delay
            self._is_estimated = True
        else:
            self._is_estimated = False
        law, q_ahead, lag, trajectory = self._law_at_rest, q, 0.0, None
        if v is None:
            self._lose_velocity()
        else:
            last = self.state
            v = gains.take(
                1e-9 * (stamp_ns - last[0]) if last is not None else 0.0, q, v, velocity_delay)
            self.state = stamp_ns, q, v
            trajectory = self._reference.active
            if self.may_hold and (
                    self._stops_now() if trajectory is None else
                    trajectory is self._first_stop and (last is None or stamp_ns != last[0])):
                trajectory = self._stop_from(last, stamp_ns, q)
        if trajectory is not None:
            law = self._law_with_reference
            if gains.least < 1.0 and v is not None:  # the arm moves before the effort acts
                lag = gains.lag
                q_ahead = q + lag * v
        state = LawInput(
            load.dynamics, stamp_ns, q, v, q_ahead, trajectory, self._feedback, lag)
        answer, options, drive = law(state), self._options, self.arm.drive
        self._followed = (state, answer) if trajectory is not None else None
        effort, bounds = answer.effort, self._bounds
        is_clear = math.dist(effort.tolist(), bounds.center) <= bounds.clearance or (
            bounds.is_clear(effort))
        if not is_clear and not np.isfinite(effort).all():
            raise non_finite_effort(q, state.gravity, effort)
        own = self._robot if self._robot is not None else load.unloaded
        robot = NOTHING
        if options.effort_convention.robot_compensates:
            robot = robot_effort(
                options.effort_convention, own.rigid_body.gravity(state.q),
                None if effort is answer.gravity else answer.friction, drive)
        output = ControlOutput(
            state, answer, v, gains.least * answer.scale, robot, own, bounds, drive, self.lock)
        if options.command == NO_COMMAND:
            return output
        output.command = effort
        if robot is not NOTHING or not is_clear:
            output.command, clamped = bounds.bounded(
                robot.command(effort), robot,
                None if effort is answer.gravity else output.holding_torque())
            output.clamped = clamped if clamped.any() else None
        if drive is not None:
            output.command = drive.command(output.command)
        return output

    def evaluate(self, adapts: bool = True) -> None:
        """Adapt gains and references to the last state; the caller holds `lock`."""
        has_changed = self._gains.evaluate(self._law_with_reference.bounces)
        if adapts and self._followed is not None and self._options.scales_gains:
            (state, answer), self._followed = self._followed, None
            friction = answer.friction if self.compensates_friction_at_rest else None
            has_changed |= self.adaptation.take(state, friction, self._law_with_reference)
        if has_changed:
            self._scale_motion()

    def mean_velocity(
        self, last: LastState | None, stamp_ns: int, q: FloatArray,
    ) -> FloatArray | None:
        """Return the mean velocity (n,) since the last state, or None if that is too long ago."""
        dt = 0.0 if last is None else 1e-9 * (stamp_ns - last[0])
        if last is None or not 0.0 < dt <= LONGEST_DIFFERENCE:
            return None
        return np.asarray((nearest_turn(q, last[1], self.arm.is_continuous) - last[1]) / dt)

    def _stop_from(
        self, last: LastState | None, stamp_ns: int, q: FloatArray,
    ) -> ActiveTrajectory | None:
        """
        Start a stop at q (n,), with the velocity since the last state (stamp, q, v).

        One sample of a noisy velocity would move the reference. A first state is a stop at rest
        until a state with another stamp.
        """
        v = self.mean_velocity(last, stamp_ns, q)
        self._reference.forget()
        self._reference.stop(stamp_ns, q, np.zeros_like(q) if v is None else v)
        self._first_stop = self._reference.active if last is None else None
        return self._reference.active

    def _stops_now(self) -> bool:
        """Return whether the arm stops and is held although there is no reference."""
        return self._reference.stops_next or self._follows and self._options.stops_and_holds

    def _lose_velocity(self) -> None:
        """End the reference: without velocities, no motion can be followed or started."""
        if self._reference.active is not None:
            self._reference.stop_from_next(self._options.stops_and_holds)
            self.has_lost_velocity = True
        self.state = None

    def motion_equation(
        self, output: ControlOutput, q: FloatArray, v: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return M(q) (n, n), and C(q, v) v + friction (n,) of the output, as command efforts."""
        with self.lock:
            body, drive, robot = self._load.dynamics.rigid_body, self.arm.drive, output.robot
            M, passive = body.mass_matrix(q), output.law.friction
            if robot.friction is not None:
                passive = passive - robot.friction
            if v is not None:
                passive = passive + body.nonlinear(q, v) - body.gravity(q)
            return (M, passive) if drive is None else (
                M / drive.scale[:, np.newaxis], passive / drive.scale)

    def braked(self, q: FloatArray, v: FloatArray | None, holding: FloatArray) -> FloatArray:
        """Return `holding` (n,) with a damping torque −M(q) D v, within the effort limits."""
        if v is None:
            return holding
        drive = self.arm.drive
        torque = holding if drive is None else drive.torque(holding)
        with self.lock, np.errstate(over='ignore', invalid='ignore'):
            M, limit = self._load.dynamics.rigid_body.mass_matrix(q), self.arm.limits.effort
            damping = M @ (FAULT_DAMPING * self.feedback_gains[1] * v)
            clipped = torque - np.clip(torque - damping, -limit, limit)
            free = np.maximum(limit - np.where(damping > 0.0, -torque, torque), 0.0)
            with np.errstate(divide='ignore', invalid='ignore'):
                share = np.where(damping != 0.0, free / np.abs(damping), 1.0)
            scaled = min(1.0, float(share.min(initial=1.0))) * damping
            # The damping of one joint alone may accelerate the others.
            braked = torque - (clipped if v @ clipped > v @ scaled else scaled)
            if not np.isfinite(braked).all():
                return holding
            return braked if drive is None else drive.command(braked)

    def is_held(self, q: FloatArray, error: FloatArray) -> BoolArray:
        """
        Return at which joints (n,) dry friction can hold the arm against the feedback, at rest.

        `q` and `error`, the reference minus q, are (n,) [rad] or [m]. Friction that is not known
        is assumed to be as large as usual in gearboxes; a further HELD_ERROR is tolerated.
        """
        friction, limit = self.arm.friction.at_rest, self.arm.limits.effort
        usual = np.where(np.isfinite(limit), USUAL_FRICTION * limit, 0.0)
        with self.lock:
            M, K_p = self._load.dynamics.rigid_body.mass_matrix(q), self.feedback_gains[0]
        K, drives = M * K_p, self._options.drive_stiffness
        if drives is not None:
            K = np.diag(drives)
        holding = np.maximum(friction.static + friction.offset, usual) + HELD_ERROR * (
            np.diagonal(K))
        return np.asarray(np.abs(K @ error) <= holding)

    def stiffness(self, q: FloatArray) -> FloatArray | None:
        """Return the scaled stiffness (n,) [N·m/rad] or [N/m] at q (n,), None without one."""
        if not self._follows or self._options.command == NO_COMMAND:
            return None
        return self._law_with_reference.stiffness(self._load.dynamics.rigid_body.mass_matrix(q))

    @property
    def feedback_gains(self) -> tuple[FloatArray, FloatArray]:
        """K_p [1/s²] and K_d [1/s] (n,) of the feedback in use, scaled."""
        s, gains = self._gains.scale * self.adaptation.scale, self._feedback.gains
        return s * s * gains.kp, s * gains.kd

    # ------------------------------------------------------------------ reports

    @property
    def quality(self) -> str:
        """A description of the joint states, from which `bandwidth_scale` follows."""
        return str(self._gains)

    @property
    def knows_quality(self) -> bool:
        """Whether enough joint states have been received for a meaningful `bandwidth_scale`."""
        return self._gains.is_known

    @property
    def bandwidth_scale(self) -> float:
        """Fraction of the natural frequency that the rate and the noise of the states allow."""
        return self._gains.least

    @property
    def workspace(self) -> WorkspaceInertia:
        """M(q) and g(q) over the workspace, with the load."""
        return self._load.workspace

    def following_error(self, output: ControlOutput, q: FloatArray) -> str:
        """Return which joint exceeds its limit of the following error most, and by how much."""
        reference = output.reference
        return '' if reference is None else self._feedback.worst_error(
            reference.position, q, self.arm.joint_names)
