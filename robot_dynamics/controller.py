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
from robot_dynamics.arm_dynamics import ArmDynamics, EffortTerms
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.control import ErrorFeedback, Gains
from robot_dynamics.effort_semantics import EffortSemantics
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.payload import Payload
from robot_dynamics.payload_transition import PayloadTransition
from robot_dynamics.regressor import random_states
from robot_dynamics.soft_gains import crossover, share_of_gains
from robot_dynamics.tracking import FEW, SegmentTracking, Tracked
from robot_dynamics.trajectory import (
    ActiveTrajectory,
    JointTrajectory,
    Reference,
    TrajectoryFollower,
)
from robot_dynamics.validation import FloatArray, largest

BoolArray = npt.NDArray[np.bool_]
COMMAND_MODES = ('computed_torque', 'gravity_compensation', 'none')
_POSES = 30
FRICTION_MODES = ('reference', 'measured', 'none')


class NonFiniteEffortError(InvalidInputError):
    """A state for which the model has no finite effort."""


class ControlOutput(NamedTuple):
    """
    The efforts for one state, each (n,) [N·m] or [N], or None where there is none.

    `gravity_compensation` and `computed_torque` are whole efforts at the joints; `command` and
    `terms` are without what the robot adds by itself, of which `robot_gravity` is g(q) without a
    load. `hold` is the command that holds the arm still, and what a command starts from.
    `clamped` tells which joints of `command` met their effort limit. `share_of_gains` is s where
    the command has softer gains than `computed_torque` (`soft_gains`). All numbers are finite.
    """

    gravity_compensation: FloatArray
    robot_gravity: FloatArray
    computed_torque: FloatArray | None
    command: FloatArray | None
    hold: FloatArray
    clamped: BoolArray
    share_of_gains: float = 1.0
    sample: Callable[[], Reference] | None = None
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
    effort_rate: float = math.inf
    """How fast [N·m/s] or [N/s] the command may change on its way out."""
    semantics: EffortSemantics = EffortSemantics()
    """What the robot adds to the command by itself is left out of it."""


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
        self._inertia = _largest_inertia(self._dynamics)
        self._transition: PayloadTransition | None = None
        continuous = [name for name, kind in zip(arm.joint_names, arm.joint_kinds)
                      if kind == 'continuous']
        self._follower = TrajectoryFollower(arm.joint_names, continuous)
        self._waiting: tuple[JointTrajectory, int] | None = None
        self._state: tuple[int, FloatArray, FloatArray] | None = None
        self._tracking: SegmentTracking | None = None
        self._answered: _Answered | None = None
        """The last state, and what its command was made of."""
        self._zero = np.zeros(arm.joint_count)
        self._zero.setflags(write=False)
        self._no_joint = np.zeros(arm.joint_count, dtype=bool)
        self._no_joint.setflags(write=False)
        self.expired = 0
        """Trajectories that waited for the first state and were over when it came."""
        self.set_options(options)

    def set_options(self, options: ControllerOptions) -> None:
        """Take over gains, mode and limits."""
        feedback = ErrorFeedback(options.gains, self.arm.joint_kinds)
        limit = self.arm.limits.effort.copy()  # infinite where there is none, at any scale
        limit[np.isfinite(limit)] *= options.effort_scale
        with self._lock:
            self._options, self._feedback, self._effort_limit = options, feedback, limit
            self._least_limit = float(limit.min(initial=np.inf))
            omega = crossover(options.gains)
            self._prompt_effort = options.effort_rate / omega if omega > 0.0 else math.inf

    def follow(self, trajectory: JointTrajectory, stamp_ns: int) -> None:
        """
        Follow a trajectory from `stamp_ns`, 0 for now, where now is the newest state's stamp.

        Before the first state it waits for that. Raises TrajectoryError where it ended already.
        """
        with self._lock:
            if self._state is None:
                self._waiting = (trajectory, stamp_ns)
            else:
                self._follower.start(trajectory, *self._state, stamp_ns=stamp_ns)

    @property
    def loaded_arm(self) -> ArmModel:
        """The arm with the load that is in force."""
        return self._dynamics.arm

    @property
    def has_reference(self) -> bool:
        """Tell whether there is one to follow, now or from the first state on."""
        return self._waiting is not None or self._follower.active is not None

    def forget_reference(self) -> None:
        """Follow nothing from now on."""
        with self._lock:
            self._waiting = None
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
        if transition_time == 0.0:
            dynamics = ArmDynamics(self.arm.with_payloads([payload] if payload else []))
            inertia = _largest_inertia(dynamics)
            with self._lock:
                self._dynamics, self._transition = dynamics, None
                self._inertia = inertia
            when_done(payload)
            return
        inertia = _largest_inertia(
            ArmDynamics(self.arm.with_payloads([payload] if payload else [])))
        with self._lock:
            self._inertia = max(self._inertia, inertia)
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
        wanted, share = None, 1.0
        if v is not None:
            self._state = (stamp_ns, q, v)
            if self._waiting is not None:
                self._start_waiting()
            active = self._follower.active
            if active is not None:
                sample = partial(active.sample, stamp_ns)
                a, v_r, feedback = self._track(active, stamp_ns, q, v)
                computed_torque = wanted = dynamics.rigid_body.inverse_dynamics(q, v, a)
                if not dynamics.is_frictionless:
                    friction = self._friction(v_r, v, computed_torque)
                    computed_torque = wanted = computed_torque + friction
                if feedback * self._inertia > self._prompt_effort:
                    a_soft, share = self._softened(active.sample(stamp_ns), q, v, a)
                    if share < 1.0:
                        a = a_soft
                        wanted = dynamics.rigid_body.inverse_dynamics(q, v, a) + friction
        gravity_peak = largest(gravity)
        peak = 0.0 if computed_torque is None else largest(computed_torque)
        if not (gravity_peak < math.inf and peak < math.inf):
            raise _not_finite(q, gravity, computed_torque)
        follows = computed_torque is not None and self._options.command == 'computed_torque'
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
            peak = largest(wanted) if share < 1.0 else peak
            is_free = own is _NOTHING and peak <= self._least_limit
            command, clamped = (wanted, self._no_joint) if is_free else (
                self._bounded(own.taken_off(wanted), own))
        self._answered = dynamics, q, v, a, gravity, friction, follows, own
        return ControlOutput(
            gravity, robot_gravity, computed_torque, command, hold, clamped,
            share if follows else 1.0, sample)

    def _terms(self) -> EffortTerms | None:
        if self._answered is None:
            return None
        dynamics, q, v, a, gravity, friction, follows, own = self._answered
        zero = self._zero
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

    def _bounded(self, command: FloatArray, own: '_Own') -> tuple[FloatArray, BoolArray]:
        """
        Return the command within its limit, so that the effort at the joints is within theirs.

        The latter is the command and the gravity that the robot adds. (Friction that it adds is
        lost on the way.) Where gravity alone is beyond the limit, the command need not push
        against it: it may be 0, or take load off.
        """
        low, high = -self._effort_limit, self._effort_limit
        if own.gravity is not None:
            limit = self.arm.limits.effort
            low = np.maximum(low, np.minimum(-limit - own.gravity, 0.0))
            high = np.minimum(high, np.maximum(limit - own.gravity, 0.0))
        bounded = np.minimum(np.maximum(command, low), high)
        return bounded, bounded != command

    def _track(
        self, active: ActiveTrajectory, now_ns: int, q: FloatArray, v: FloatArray,
    ) -> Tracked:
        segment, feedback = active.segment(now_ns), self._feedback
        if segment is None or len(q) > FEW:
            reference = active.sample(now_ns)
            a = feedback.acceleration(reference, q, v)
            return Tracked(
                a, feedback.reference_velocity(reference, q),
                float(np.abs(a - reference.acceleration).max(initial=0.0)))
        tracking = self._tracking
        if tracking is None or tracking.segment is not segment or (
                tracking.feedback is not feedback):
            tracking = self._tracking = SegmentTracking(segment, feedback)
        return tracking.at(now_ns, q, v)

    def _softened(
        self, reference: Reference, q: FloatArray, v: FloatArray, a: FloatArray,
    ) -> tuple[FloatArray, float]:
        """Return the acceleration with gains that the effort can follow, and their share."""
        gains = self._feedback.gains
        proportional = gains.kp * self._feedback.position_error(reference.position, q)
        damping = gains.kd * (reference.velocity - v)
        M = self._dynamics.rigid_body.mass_matrix(q)
        s = share_of_gains(M @ proportional, M @ damping, self._prompt_effort)
        return a - (1.0 - s * s) * proportional - (1.0 - s) * damping, s

    def _friction(self, v_r: FloatArray, v: FloatArray, load: FloatArray) -> FloatArray:
        dynamics, mode = self._dynamics, self._options.friction_compensation
        if mode == 'reference':
            return dynamics.friction_effort(v_r, load, smooth=True)
        return dynamics.friction_effort(v, load) if mode == 'measured' else self._zero

    def _start_waiting(self) -> None:
        if self._waiting is None or self._state is None:
            return
        (trajectory, start_ns), self._waiting = self._waiting, None
        try:
            self._follower.start(trajectory, *self._state, stamp_ns=start_ns)
        except TrajectoryError:  # over before the first state came: nothing to follow
            self.expired += 1

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


# dynamics, q, v, a, gravity, friction, whether it follows the reference, the robot's own share
_Answered = tuple[
    ArmDynamics, FloatArray, FloatArray | None, FloatArray, FloatArray, FloatArray, bool, _Own]


def _largest_inertia(dynamics: ArmDynamics) -> float:
    """Return what |M(q) a| is at most for accelerations up to 1, at poses here and there."""
    poses = random_states(dynamics.arm, _POSES)[0]
    return max((float(np.abs(dynamics.rigid_body.mass_matrix(q)).sum(axis=1).max(initial=0.0))
                for q in poses), default=0.0)


def _not_finite(
    q: FloatArray, gravity: FloatArray, computed_torque: FloatArray | None,
) -> NonFiniteEffortError:
    return NonFiniteEffortError(
        f'the efforts at position {q.tolist()} are not finite: gravity {gravity.tolist()}, '
        f'computed torque {computed_torque}')
