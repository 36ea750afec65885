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
From a measured state to the efforts for it: everything on the control path, without ROS.

Time on this path is the stamp of the joint states, so that a simulation that runs in lock-step,
or a recording, gives the same efforts however fast it is played.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import math
import threading
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.control.control_law import ErrorFeedback, Gains
from robot_dynamics.control.gain_softening import crossover_frequency, gain_scale
from robot_dynamics.control.payload_transition import PayloadTransition
from robot_dynamics.control.segment_tracking import FEW, TrackingLaw, TrackingOutput
from robot_dynamics.control.stable_gains import longest_period, StateQuality, UNKNOWN
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, EffortTerms
from robot_dynamics.model.payload import Payload
from robot_dynamics.trajectories.interpolation import ActiveTrajectory, JointTrajectory, Reference
from robot_dynamics.trajectories.motion_limits import MotionLimits, WorkspaceInertia
from robot_dynamics.trajectories.path_conditioning import feasible_trajectory
from robot_dynamics.trajectories.reference_generator import ReferenceGenerator
from robot_dynamics.validation import FloatArray, largest

BoolArray = npt.NDArray[np.bool_]
COMMAND_MODES = ('computed_torque', 'gravity_compensation', 'none')
FOLLOWING = COMMAND_MODES[0]
"""The command that follows a reference."""
FRICTION_MODES = ('reference', 'measured', 'none')


ERROR_TIME = 0.3
"""[s]: the limit of the following error is the way at the velocity limit in this time."""
DEFAULT_ERROR = 0.5
"""[rad] or [m], limit of the following error of a joint without a velocity limit."""
FAULT_DAMPING = 0.5
"""Share of K_d with which a joint is damped in a fault."""
_NS = 1e-9
_STEP = 1.1


class NonFiniteEffortError(InvalidInputError):
    """A state for which the model has no finite effort."""


class ControlOutput(NamedTuple):
    """
    The efforts for one state, each (n,) [N·m] or [N], or None where there is none.

    `gravity_compensation` and `computed_torque` are whole efforts at the joints; `command` and
    `terms` are without what the robot adds by itself, of which `robot_gravity` is g(q) without a
    load. `hold` is the command that holds the arm still, and what a command starts from.
    `clamped` tells which joints of `command` met their effort limit. `gain_scale` is s where
    the command has softer gains than `computed_torque` (`soft_gains`). All numbers are finite.
    """

    gravity_compensation: FloatArray
    robot_gravity: FloatArray
    computed_torque: FloatArray | None
    command: FloatArray | None
    hold: FloatArray
    clamped: BoolArray
    gain_scale: float = 1.0
    sample: Callable[[], Reference] | None = None
    velocity: FloatArray | None = None
    """The velocity (n,) that was used, measured or differentiated (`stable_gains`)."""
    is_far: bool = False
    """Whether the following error of a joint exceeds its limit."""
    terms: EffortTerms | None = None

    @property
    def reference(self) -> Reference | None:
        """Return what is followed, None where there is nothing."""
        return None if self.sample is None else self.sample()


@dataclass(frozen=True)
class ControllerOptions:
    """What may change while the controller runs."""

    gains: Gains
    command: str = 'computed_torque'
    effort_scale: float = 1.0
    """The command is clamped to this share of the effort limits of the URDF."""
    friction_compensation: str = 'reference'
    """The velocity at which computed torque compensates friction; see `control`."""
    effort_rate: FloatArray | float = math.inf
    """Largest rate of change of the command [N·m/s] or [N/s], (n,) or one for all joints."""
    semantics: EffortConvention = EffortConvention()
    """What the robot adds to the command by itself is left out of it."""
    softens_gains: bool = False
    """Scale the feedback down for errors whose effort the rate limit would delay."""
    conditions_references: bool = False
    """Follow references within the limits of the arm; see `reference_generator`."""
    slows_down: bool = False
    """Slow an infeasible trajectory down instead of rejecting it."""
    stops_and_holds: bool = False
    """Stop and hold where a reference ends early; otherwise compensate gravity alone."""
    following_error: FloatArray | None = None
    """(n,) [rad] or [m], limit of the following error, 0 for none; None for the default."""
    stream_timeout: float = 0.1
    """[s] for which a set-point with a velocity is followed."""


class Controller:
    """
    Computes efforts from measured states; safe to call from several threads.

    `update` is the control path. The other methods change what it does next, and hold the lock
    only while they swap something that was prepared outside it.
    """

    def __init__(self, arm: ArmModel, options: ControllerOptions) -> None:
        self.arm = arm
        self._lock = threading.Lock()
        self._bare_dynamics = self._dynamics = ArmDynamics(arm)
        self._workspace = WorkspaceInertia(self._dynamics)
        self._planning = ArmDynamics(arm)
        """For the thread that calls `follow`."""
        self._transition: PayloadTransition | None = None
        continuous = [name for name, kind in zip(arm.joint_names, arm.joint_kinds)
                      if kind == 'continuous']
        self._follower = ReferenceGenerator(arm.joint_names, continuous, None)
        self._stops_next = False
        self._is_stopped = False
        self.slowness = 1.0
        """Factor by which the last trajectory was slowed down."""
        self._quality = StateQuality(arm.joint_kinds)
        self._rated_period = 0.0
        self._mass = self._workspace.largest()
        self.rate_share = 1.0
        """Share of the natural frequency that the rate and the noise of the states allow."""
        self._state: tuple[int, FloatArray, FloatArray] | None = None
        self._tracking: TrackingLaw | None = None
        self._answered: _Answered | None = None
        """The last state, and what its command was made of."""
        self._zero = np.zeros(arm.joint_count)
        self._zero.setflags(write=False)
        self._no_joint = np.zeros(arm.joint_count, dtype=bool)
        self._no_joint.setflags(write=False)
        self._motion_limits: MotionLimits | None = None
        self._options = options
        self.set_options(options)

    def set_options(self, options: ControllerOptions) -> None:
        """Take over gains, mode and limits; another mode ends the reference."""
        feedback = ErrorFeedback(
            options.gains, self.arm.joint_kinds, self._largest_error(options.following_error))
        limit = self.arm.limits.effort.copy()  # infinite where there is none, at any scale
        limit[np.isfinite(limit)] *= options.effort_scale
        with self._lock:
            if options.command != self._options.command:
                self._follower.clear()
                self._stops_next = self._is_stopped = False
            self._options, self._feedback, self._effort_limit = options, feedback, limit
            self._full_feedback = feedback
            self._free_period = longest_period(options.gains)
            self._least_limit = float(limit.min(initial=np.inf))
            self._limit_motion()
            self._adapt_gains()

    def _largest_error(self, limit: FloatArray | None) -> FloatArray:
        if limit is not None:
            return np.where(limit > 0.0, limit, math.inf)
        v = self.arm.limits.velocity
        return np.where(np.isfinite(v), ERROR_TIME * v, DEFAULT_ERROR)

    def _limit_motion(self) -> None:
        """Derive from arm, load and options how fast references may be and gains can act."""
        options = self._options
        rate = np.broadcast_to(options.effort_rate, self._effort_limit.shape)
        self._motion_limits = self._workspace.motion_limits(
            self._effort_limit, rate) if options.conditions_references else None
        self._scale_motion()
        self._follower.stream_timeout = options.stream_timeout
        omega = crossover_frequency(options.gains)
        self._prompt_effort = rate / omega if omega > 0.0 and options.softens_gains else (
            np.full_like(rate, math.inf))
        self._mass = self._workspace.largest()
        inertia = np.maximum(self._workspace.row_sums(), 1e-12)
        self._prompt_feedback = float((self._prompt_effort / inertia).min(initial=math.inf))

    def follow(self, trajectory: JointTrajectory, stamp_ns: int) -> None:
        """
        Follow a trajectory from `stamp_ns`, 0 for now, where now is the newest state's stamp.

        Raises TrajectoryError where nothing can be followed, the trajectory has ended already,
        or the arm cannot follow it.
        """
        self._check_follows()
        slowness = 1.0
        if self._follower.limits is not None and not trajectory.is_set_point:
            self._follower.check_joints(trajectory)
            trajectory, slowness = feasible_trajectory(
                self._planning, trajectory, self._follower.limits, self._options.effort_scale,
                self._options.slows_down)
        with self._lock:
            self._follower.start(trajectory, *self._check_follows(), stamp_ns=stamp_ns)
            self._stops_next = self._is_stopped = False
            self.slowness = slowness

    def _check_follows(self) -> tuple[int, FloatArray, FloatArray]:
        """Return the last state; raise TrajectoryError where nothing can be followed from it."""
        if self._options.command != FOLLOWING:
            raise TrajectoryError(
                f'command is {self._options.command!r}, expected {FOLLOWING!r}: nothing is '
                'followed')
        if self._state is None:
            raise TrajectoryError(
                'no joint state with velocities has been received, so that there is no state to '
                'start from')
        return self._state

    def stop(self) -> str:
        """Stop along the path in force, or from the measured state, and hold; return a report."""
        with self._lock:
            if self._options.command == 'none' or self._state is None:
                return 'nothing to stop: the node does not command the arm'
            path = 'along the reference' if self._follower.active else 'from the measured state'
            self._follower.stop(*self._state)
            self._stops_next, self._is_stopped = False, True
            return f'stopping {path}, then holding the position'

    @property
    def loaded_arm(self) -> ArmModel:
        """The arm with the load that is in force."""
        return self._dynamics.arm

    @property
    def has_reference(self) -> bool:
        """Whether a reference is followed."""
        return self._follower.active is not None

    def forget_reference(self) -> None:
        """Follow nothing; without feedback, until the next trajectory or stop."""
        with self._lock:
            self._follower.clear()
            self._stops_next = self._is_stopped = False

    def restart_states(self) -> None:
        """Take the next state as a first one: it need not follow from the last."""
        with self._lock:
            self._state = None

    def stop_from_state(self) -> None:
        """Forget the reference; stop from the next measured state and hold, if so chosen."""
        with self._lock:
            self._follower.clear()
            self._stops_next = (
                self._options.stops_and_holds and self._options.command == FOLLOWING)

    def stop_on_path(self) -> None:
        """Stop along the reference and hold, if so chosen; otherwise forget the reference."""
        with self._lock:
            if self._options.stops_and_holds and self._state is not None:
                self._follower.stop(*self._state)
            else:
                self._follower.clear()

    def shift_time(self, shift_ns: int) -> None:
        """Follow on as before where the stamps of states go on lower by `shift_ns`."""
        with self._lock:
            self._follower.shift_time(shift_ns)

    def set_payload(
        self, payload: Payload | None, transition_time: float,
        when_done: Callable[[Payload | None], None],
    ) -> None:
        """
        Let `payload` (None for no load) take the place of the old one over transition_time [s].

        `when_done` is called with it when it is in force: at once for no transition.
        """
        planning = ArmDynamics(self.arm.with_payloads([payload] if payload else []))
        workspace = WorkspaceInertia(planning)
        if transition_time == 0.0:
            dynamics = ArmDynamics(planning.arm)
            with self._lock:
                self._dynamics, self._transition = dynamics, None
                self._planning, self._workspace = planning, workspace
                self._limit_motion()
            when_done(payload)
            return
        with self._lock:
            self._planning, self._workspace = planning, workspace.heavier(self._workspace)
            self._limit_motion()
            self._transition = PayloadTransition(
                self._dynamics.arm.payloads, payload, transition_time, when_done)

    def update(self, stamp_ns: int, q: FloatArray, v: FloatArray | None,
               with_terms: bool = False) -> ControlOutput:
        """
        Return the efforts for the state (q, v) measured at stamp_ns; v may be unknown (None).

        Without a velocity there is gravity compensation alone. Efforts that are not finite raise
        NonFiniteEffortError: such a state is outside anything the model can answer.
        """
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            output = self._update(stamp_ns, q, v)
            return output._replace(terms=self._terms()) if with_terms else output

    def answer(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> ControlOutput:
        """Do as `update` does without terms; numpy may warn of what is not finite."""
        with self._lock:
            return self._update(stamp_ns, q, v)

    def terms(self) -> EffortTerms | None:
        """Return the terms of the last command; None where there is none, or it is not finite."""
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            return self._terms()

    def _update(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> ControlOutput:
        if self._transition is not None:
            self._advance_payload(self._transition, stamp_ns)
        dynamics, zero = self._dynamics, self._zero
        gravity = dynamics.rigid_body.gravity(q)
        friction, a, computed_torque, sample = zero, zero, None, None
        wanted, share, is_far, q_model = None, self.rate_share, False, q
        if v is None:
            self._lose_velocity()
        else:
            v = self._take_state(stamp_ns, q, v)
            active = self._follower.active
            if active is not None:
                sample = partial(active.sample, stamp_ns)
                a, v_r, feedback, is_far = self._track(active, stamp_ns, q, v)
                if self.rate_share < 1.0:  # the effort acts when the arm has moved on
                    q_model = q + self._quality.lag * v
                computed_torque = wanted = dynamics.rigid_body.inverse_dynamics(q_model, v, a)
                if not dynamics.is_frictionless:
                    friction = self._friction(v_r, v, computed_torque)
                    computed_torque = wanted = computed_torque + friction
                if feedback > self._prompt_feedback:
                    a_soft, soft = self._softened(active.sample(stamp_ns), q, v, a)
                    if soft < 1.0:
                        a, share = a_soft, soft * share
                        wanted = dynamics.rigid_body.inverse_dynamics(q_model, v, a) + friction
        gravity_peak = largest(gravity)
        peak = 0.0 if computed_torque is None else largest(computed_torque)
        if not (gravity_peak < math.inf and peak < math.inf):
            raise _not_finite(q, gravity, computed_torque)
        follows = computed_torque is not None and (
            self._options.command == FOLLOWING or self._is_stopped)
        bare = dynamics is self._bare_dynamics
        robot_gravity = gravity if bare else self._bare_dynamics.rigid_body.gravity(q)
        robot = self._options.semantics
        own = _NOTHING
        if robot.robot_compensates:
            own = _Own(
                robot_gravity if robot.compensates_gravity else None,
                friction if robot.compensates_friction and follows else None)
        is_free = own is _NOTHING and gravity_peak <= self._least_limit
        hold, clamped = (gravity, self._no_joint) if is_free else (
            self._bounded(own.gravity_taken_off(gravity), own))
        command: FloatArray | None = hold
        if self._options.command == 'none':
            command, clamped = None, self._no_joint
        elif follows and wanted is not None:
            peak = peak if wanted is computed_torque else largest(wanted)
            is_free = own is _NOTHING and peak <= self._least_limit
            command, clamped = (wanted, self._no_joint) if is_free else (
                self._bounded(own.taken_off(wanted), own, hold))
        self._answered = (
            dynamics, q_model if follows else q, v, a,
            gravity if q_model is q or not follows else None, friction, follows, own)
        return ControlOutput(
            gravity, robot_gravity, computed_torque, command, hold, clamped,
            share if follows else 1.0, sample, v, is_far)

    def _terms(self) -> EffortTerms | None:
        if self._answered is None:
            return None
        dynamics, q, v, a, gravity, friction, follows, own = self._answered
        zero = self._zero
        if gravity is None:
            gravity = dynamics.rigid_body.gravity(q)
        v_terms = v if follows and v is not None else zero
        terms = dynamics.terms(
            q, v_terms, a if follows else zero, friction=friction if follows else zero)
        # The engine rounds g(q) differently in each algorithm; here it is that of the command.
        terms = own.taken_off_terms(terms._replace(
            gravity=gravity, effort=terms.effort + (gravity - terms.gravity)))
        if v is not None and not follows:
            terms = terms._replace(kinetic_energy=dynamics.rigid_body.kinetic_energy(q, v))
        # An energy beyond all numbers is no reason to withhold the effort.
        return terms if all(np.isfinite(part).all() for part in terms) else None

    def _bounded(
        self, command: FloatArray, own: '_Own', hold: FloatArray | None = None,
    ) -> tuple[FloatArray, BoolArray]:
        """
        Return the command within its limit, so that the effort at the joints is within theirs.

        The latter is the command and the gravity that the robot adds. (Friction that it adds is
        neglected.) Where gravity alone is beyond the limit, the command need not push against it:
        it may be 0, or take load off. A scale of the effort limits that is too low for `hold`,
        the command that holds the arm, extends to it; without `hold` the scale does not apply.
        """
        limit = self.arm.limits.effort
        low, high = -limit, limit
        if hold is not None:
            low = np.maximum(low, np.minimum(-self._effort_limit, hold))
            high = np.minimum(high, np.maximum(self._effort_limit, hold))
        if own.gravity is not None:
            low = np.maximum(low, np.minimum(-limit - own.gravity, 0.0))
            high = np.minimum(high, np.maximum(limit - own.gravity, 0.0))
        bounded = np.minimum(np.maximum(command, low), high)
        return bounded, bounded != command

    @property
    def quality(self) -> str:
        """A description of the joint states, from which `rate_share` follows."""
        return str(self._quality)

    @property
    def knows_quality(self) -> bool:
        """Whether enough joint states have been received for `rate_share` to be meaningful."""
        return self._quality.is_known

    @property
    def workspace(self) -> WorkspaceInertia:
        """M(q) and g(q) over the workspace, with the load."""
        return self._workspace

    def following_error(self, output: ControlOutput, q: FloatArray) -> str:
        """Return which joint exceeds its limit of the following error most, and by how much."""
        reference = output.reference
        if reference is None:
            return ''
        limit = self._feedback.largest_error
        e = self._feedback.position_error(reference.position, q)
        j = int(np.argmax(np.abs(e) / limit))
        return (f'position of {self.arm.joint_names[j]!r} is {abs(e[j]):.3g} from its reference, '
                f'expected at most {limit[j]:.3g} (following_error_limit)')

    def braked(self, q: FloatArray, v: FloatArray | None, hold: FloatArray) -> FloatArray:
        """Return `hold` (n,) with a damping torque −M(q) D v, within the effort limits."""
        if v is None:
            return hold
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            M, limit = self._dynamics.rigid_body.mass_matrix(q), self.arm.limits.effort
            damping = M @ (FAULT_DAMPING * self._feedback.gains.kd * v)
            braked = np.clip(hold - damping, np.minimum(-limit, hold), np.maximum(limit, hold))
            return braked if np.isfinite(braked).all() else hold

    def _track(
        self, active: ActiveTrajectory, now_ns: int, q: FloatArray, v: FloatArray,
    ) -> TrackingOutput:
        segment, feedback = active.segment(now_ns), self._feedback
        if segment is None or len(q) > FEW:
            reference = active.sample(now_ns)
            a = feedback.acceleration(reference, q, v)
            return TrackingOutput(
                a, feedback.reference_velocity(reference, q),
                float(np.abs(a - reference.acceleration).max(initial=0.0)),
                feedback.is_far(reference.position, q))
        tracking = self._tracking
        if tracking is None or tracking.segment is not segment or (
                tracking.feedback is not feedback):
            tracking = self._tracking = TrackingLaw(segment, feedback)
        return tracking.at(now_ns, q, v)

    def _softened(
        self, reference: Reference, q: FloatArray, v: FloatArray, a: FloatArray,
    ) -> tuple[FloatArray, float]:
        """Return the acceleration with gains that the effort can follow, and their share."""
        gains = self._feedback.gains
        proportional = gains.kp * self._feedback.position_error(reference.position, q)
        damping = gains.kd * (reference.velocity - v)
        M = self._dynamics.rigid_body.mass_matrix(q)
        s = gain_scale(M @ proportional, M @ damping, self._prompt_effort)
        return a - (1.0 - s * s) * proportional - (1.0 - s) * damping, s

    def _friction(self, v_r: FloatArray, v: FloatArray, load: FloatArray) -> FloatArray:
        dynamics, mode = self._dynamics, self._options.friction_compensation
        if mode == 'reference':
            return dynamics.friction_effort(v_r, load, smooth=True)
        return dynamics.friction_effort(v, load) if mode == 'measured' else self._zero

    def _take_state(self, stamp_ns: int, q: FloatArray, v: FloatArray) -> FloatArray:
        """Take over a state; start the stop that waits for it; return the velocity to use."""
        if self._options.softens_gains:
            dt = 0.0 if self._state is None else _NS * (stamp_ns - self._state[0])
            v = self._quality.velocity(dt, q, v)
            period = self._quality.period
            if self._quality.is_due or (
                    period > self._free_period and period > _STEP * self._rated_period):
                self._rated_period = period
                self._adapt_gains()
        self._state = stamp_ns, q, v
        if self._stops_next:
            self._stops_next = False
            self._follower.stop(stamp_ns, q, v)
        return v

    def _lose_velocity(self) -> None:
        """Without velocities nothing is followed, and no motion can start."""
        if self._follower.active is not None:
            self._stops_next = self._options.stops_and_holds
            self._follower.clear()
        self._state = None

    def _scale_motion(self) -> None:
        """Slow references down in proportion to the bandwidth of the feedback."""
        limits, share = self._motion_limits, self.rate_share
        if not self._quality.is_known:
            share = min(1.0, share / UNKNOWN)
        self._follower.limits = None if limits is None else limits.slower(share)

    def _adapt_gains(self) -> None:
        """Lower the gains to what period and noise of the states, and the rate limit, allow."""
        options, share = self._options, 1.0
        if options.softens_gains:
            share = self._quality.stable_share(
                options.gains, self._mass,
                np.broadcast_to(options.effort_rate, self._effort_limit.shape))
        is_scaled = self._feedback is not self._full_feedback
        if share < 1.0 and is_scaled and 1.0 / _STEP < share / self.rate_share < _STEP:
            return
        self.rate_share = share
        self._scale_motion()
        self._feedback = self._full_feedback.scaled(share) if share < 1.0 else (
            self._full_feedback)

    def _advance_payload(self, transition: PayloadTransition, stamp_ns: int) -> None:
        self._dynamics = ArmDynamics(self.arm.with_payloads(transition.payloads(stamp_ns)))
        if transition.done:
            self._transition = None
            transition.when_done(transition.target)


class _Own(NamedTuple):
    """What the robot adds by itself, each (n,) or None for nothing."""

    gravity: FloatArray | None
    friction: FloatArray | None

    def gravity_taken_off(self, effort: FloatArray) -> FloatArray:
        return effort if self.gravity is None else effort - self.gravity

    def taken_off(self, effort: FloatArray) -> FloatArray:
        effort = self.gravity_taken_off(effort)
        return effort if self.friction is None else effort - self.friction

    def taken_off_terms(self, terms: EffortTerms) -> EffortTerms:
        if self.gravity is None and self.friction is None:
            return terms
        gravity = terms.gravity if self.gravity is None else terms.gravity - self.gravity
        friction = terms.friction if self.friction is None else np.zeros_like(terms.friction)
        return terms._replace(
            gravity=gravity, friction=friction, effort=self.taken_off(terms.effort))


_NOTHING = _Own(None, None)


# dynamics, q, v, a, g(q) or None, friction, whether a reference is followed, the robot's own share
_Answered = tuple[
    ArmDynamics, FloatArray, FloatArray | None, FloatArray, FloatArray | None, FloatArray, bool,
    _Own]


def _not_finite(
    q: FloatArray, gravity: FloatArray, computed_torque: FloatArray | None,
) -> NonFiniteEffortError:
    return NonFiniteEffortError(
        f'the efforts at position {q.tolist()} are not finite: gravity {gravity.tolist()}, '
        f'computed torque {computed_torque}')
