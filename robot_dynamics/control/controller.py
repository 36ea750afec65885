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
The whole control path from a measured state to its efforts, without ROS.

Time on this path is the stamp of the joint states. A lock-step simulation or a recording therefore
gives the same efforts at any playback speed.
"""

from collections.abc import Callable, Sequence
from functools import partial
import math
import threading

import numpy as np
from robot_dynamics.arrays import FloatArray, largest
from robot_dynamics.control.computed_torque import ComputedTorque
from robot_dynamics.control.control_law import ErrorFeedback
from robot_dynamics.control.control_output import ControlOutput, non_finite_effort
from robot_dynamics.control.effort_bounds import EffortBounds, NOTHING, robot_effort, RobotEffort
from robot_dynamics.control.followed_reference import FollowedReference
from robot_dynamics.control.gain_adaptation import GainAdaptation
from robot_dynamics.control.laws import ControlLaw, GravityCompensation, LawInput, LawOutput
from robot_dynamics.control.loaded_arm import LoadedArm
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, EffortTerms, UncheckedArmDynamics
from robot_dynamics.model.payload import Payload
from robot_dynamics.monitoring.velocity_estimate import VelocityEstimate
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.motion_limits import WorkspaceInertia

LAWS: dict[str, type[ControlLaw]] = {
    'computed_torque': ComputedTorque,
    'gravity_compensation': GravityCompensation,
}
"""The control laws, by the values of the parameter `command`."""
NO_COMMAND = 'none'
FAULT_DAMPING = 0.5
"""Fraction of K_d with which a joint is damped in a fault."""
_NS = 1e-9


def command_modes() -> tuple[str, ...]:
    """Return the values of the parameter `command`."""
    return (*LAWS, NO_COMMAND)


class Controller:
    """
    Computes efforts from measured states; safe to call from several threads.

    `update` is the control path. The other methods change its next results. They prepare their
    data outside the lock and hold the lock only while they exchange these data.
    """

    def __init__(self, arm: ArmModel, options: ControllerOptions) -> None:
        self.arm = arm
        self._lock = threading.Lock()
        self._exchange = threading.Lock()
        """Held while loads and gravity are prepared and exchanged."""
        self._load = LoadedArm(arm)
        self._reference = FollowedReference(arm)
        self._adaptation = GainAdaptation(arm.joint_kinds)
        self._velocity = VelocityEstimate(arm.is_continuous)
        self._state: tuple[int, FloatArray, FloatArray] | None = None
        self._last: tuple[LawOutput, RobotEffort] | None = None
        """The output for the last state, and the efforts that the robot adds on its own."""
        self._options = options
        self.set_options(options)

    def set_options(self, options: ControllerOptions) -> None:
        """Apply gains, law and limits; a change of the law ends the reference."""
        feedback = ErrorFeedback(
            options.gains, self.arm.joint_kinds, options.largest_error(self.arm.limits.velocity))
        gravity = GravityCompensation(feedback, options)
        law = gravity if options.command == NO_COMMAND else LAWS[options.command](
            feedback, options)
        bounds = EffortBounds(
            self.arm.limits.effort, options.effort_scale, self.arm.drive)
        robot = None if options.semantics.robot_gravity is None else (
            UncheckedArmDynamics(self.arm.with_gravity(options.semantics.robot_gravity)))
        with self._lock:
            if options.command != self._options.command:
                self._reference.clear()
            self._options, self._feedback, self._bounds = options, feedback, bounds
            self._robot = robot
            self._law_at_rest: ControlLaw = gravity if law.follows else law
            self._law_with_reference: ControlLaw = law if law.follows else ComputedTorque(
                feedback, options)
            self._follows = law.follows
            self._limit_motion()

    def _limit_motion(self) -> None:
        """Derive the limits of references and gains from the arm, the load and the options."""
        options, workspace, scaled = self._options, self._load.workspace, self._bounds.scaled
        rate = np.broadcast_to(options.effort_rate, scaled.shape)
        self._reference.limit(
            workspace.motion_limits(scaled, rate) if options.conditions_references else None,
            options.stream_timeout)
        if options.softens_gains:
            self._law_with_reference.limit_rate(rate, workspace.row_sums())
        self._adaptation.use(
            options.gains if options.softens_gains else None, workspace.largest(), rate)
        self._scale_motion()

    def _scale_motion(self) -> None:
        """Scale gains and references to the bandwidth that the joint states allow."""
        self._reference.scale(self._adaptation.reference_scale)
        self._law_with_reference.scale_gains(self._adaptation.scale)

    def follow(self, trajectory: JointTrajectory, stamp_ns: int) -> None:
        """
        Follow a trajectory from `stamp_ns`; 0 means now, which is the stamp of the newest state.

        Raises TrajectoryError if no reference can be followed, if the trajectory has already
        ended, or if the arm cannot follow it.
        """
        self._check_follows()
        trajectory, slowness = self._reference.feasible(
            trajectory, self._load.planning, self._options)
        with self._lock:
            self._reference.start(trajectory, slowness, self._check_follows(), stamp_ns)

    def _check_follows(self) -> tuple[int, FloatArray, FloatArray]:
        """Return the last state; raise TrajectoryError if no reference can start from it."""
        if not self._follows:
            names = ' or '.join(repr(name) for name, law in LAWS.items() if law.follows)
            raise TrajectoryError(
                f'command is {self._options.command!r}, expected {names} to follow a reference')
        if self._state is None:
            raise TrajectoryError(
                'no joint state with velocities has been received, so that there is no state to '
                'start from')
        return self._state

    def stop(self) -> str:
        """Stop along the active path, or from the measured state, and hold; return a report."""
        with self._lock:
            if self._options.command == NO_COMMAND or self._state is None:
                return 'nothing to stop: the node does not command the arm'
            path = 'along the reference' if self._reference.active else 'from the measured state'
            self._reference.stop(*self._state)
            return f'stopping {path}, then holding the position'

    @property
    def loaded_arm(self) -> ArmModel:
        """The arm with its active loads."""
        return self._load.dynamics.arm

    @property
    def estimates_velocity(self) -> bool:
        """Whether velocities that are not measured are estimated from the positions."""
        return self._options.estimates_velocity

    @property
    def planning_dynamics(self) -> ArmDynamics:
        """Dynamics of the arm with its loads, or those that a transition leads to."""
        return self._load.planning

    @property
    def compensates_friction_at_rest(self) -> bool:
        """Whether dry friction is compensated at joints that rest away from their goal."""
        friction = self.arm.friction
        return self._follows and self._options.friction_compensation == 'reference' and bool(
            (friction.at_rest.static + friction.load).any())

    @property
    def has_reference(self) -> bool:
        """Whether a reference is active."""
        return self._reference.active is not None

    @property
    def slowness(self) -> float:
        """Factor by which the last trajectory was slowed down."""
        return self._reference.slowness

    def forget_reference(self) -> None:
        """End the reference; there is no feedback until the next trajectory or stop."""
        with self._lock:
            self._reference.clear()

    def restart_states(self) -> None:
        """Treat the next state as a first one: it need not be consistent with the last state."""
        with self._lock:
            self._state = None
            self._velocity.restart()

    def stop_from_state(self) -> None:
        """End the reference; stop from the next measured state and hold if `stops_and_holds`."""
        with self._lock:
            self._reference.stop_from_next(self._options.stops_and_holds and self._follows)

    def stop_on_path(self) -> None:
        """Stop along the reference and hold if `stops_and_holds`; otherwise end the reference."""
        with self._lock:
            self._reference.stop_on_path(self._state if self._options.stops_and_holds else None)

    def shift_time(self, shift_ns: int) -> None:
        """Continue the reference unchanged when the stamps of the states decrease by shift_ns."""
        with self._lock:
            self._reference.shift_time(shift_ns)

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
            with self._lock:
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
            with self._lock:
                self._load.begin_gravity_change(load, rate)
                self._limit_motion()

    def __repr__(self) -> str:
        following = 'following a reference' if self.has_reference else 'no reference'
        return f'<Controller of {self.loaded_arm!r}, {self._options.command}, {following}>'

    def update(self, stamp_ns: int, q: FloatArray, v: FloatArray | None,
               with_terms: bool = False) -> ControlOutput:
        """
        Return the efforts for the state (q, v) measured at stamp_ns; v may be unknown (None).

        Without a velocity, measured or estimated, only gravity compensation is computed. Raises
        NonFiniteEffortError if an effort is not finite: the state is outside the range of the
        model.
        """
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            output = self._update(stamp_ns, q, v)
            return output._replace(terms=self._terms()) if with_terms else output

    def answer(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> ControlOutput:
        """Do the same as `update` without terms; numpy may warn about non-finite numbers."""
        with self._lock:
            return self._update(stamp_ns, q, v)

    def terms(self) -> EffortTerms | None:
        """Return the terms of the last command, or None if it is missing or not finite."""
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            return self._terms()

    def _update(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> ControlOutput:
        self._load.advance(stamp_ns)
        v = self._take_state(stamp_ns, q, v)
        reference, dynamics = self._reference.active, self._load.dynamics
        law, q_ahead = self._law_at_rest, q
        if reference is not None and v is not None:
            law = self._law_with_reference
            if self._adaptation.scale < 1.0:  # the arm moves before the effort acts
                q_ahead = q + self._adaptation.quality.lag * v
        state = LawInput(
            dynamics, stamp_ns, q, v, q_ahead, dynamics.rigid_body.gravity(q), reference)
        return self._limited(state, law(state))

    def _take_state(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> FloatArray | None:
        """Store a state, start a stop that waits for it, and return the velocity to use."""
        delay = 0.0
        if v is None and self._options.estimates_velocity:
            v, delay = self._velocity.update(stamp_ns, q), self._velocity.delay
        if v is None:
            self._lose_velocity()
            return None
        last = self._state
        v, has_changed = self._adaptation.take(
            _NS * (stamp_ns - last[0]) if last is not None else 0.0, q, v, delay)
        if has_changed:
            self._scale_motion()
        self._state = stamp_ns, q, v
        self._reference.take_state(stamp_ns, q, v)
        return v

    def _lose_velocity(self) -> None:
        """End the reference: without velocities, no motion can be followed or started."""
        if self._reference.active is not None:
            self._reference.stop_from_next(self._options.stops_and_holds)
        self._state = None

    def _limited(self, state: LawInput, answer: LawOutput) -> ControlOutput:
        """Return the answer of a law as a command within the effort limits."""
        q, gravity, reference = state.q, state.gravity, state.reference
        effort, nominal = answer.effort, answer.nominal
        is_gravity = effort is gravity
        gravity_peak = largest(gravity)
        peak = gravity_peak if is_gravity else largest(nominal)
        if not (gravity_peak < math.inf and peak < math.inf):
            raise non_finite_effort(q, gravity, nominal)
        own = self._robot if self._robot is not None else self._load.unloaded
        robot_gravity = gravity if state.dynamics is own else own.rigid_body.gravity(q)
        drive = self.arm.drive
        robot = robot_effort(
            self._options.semantics, robot_gravity, None if is_gravity else answer.friction, drive)
        bounds, is_free = self._bounds, robot is NOTHING
        hold, clamped = (gravity, bounds.no_joint) if (
            is_free and gravity_peak <= bounds.least) else (
            bounds.bounded(robot.without_gravity(gravity), robot))
        command: FloatArray | None = hold
        if self._options.command == NO_COMMAND:
            command, clamped = None, bounds.no_joint
        elif not is_gravity:
            peak = peak if effort is nominal else largest(effort)
            command, clamped = (effort, bounds.no_joint) if is_free and peak <= bounds.least else (
                bounds.bounded(robot.command(effort), robot, hold))
        self._last = answer, robot
        if drive is not None:
            hold = drive.command(hold)
            command = None if command is None else drive.command(command)
        if reference is None:
            return ControlOutput(
                gravity, robot_gravity, None, command, hold, clamped, 1.0, None, state.v)
        return ControlOutput(
            gravity, robot_gravity, nominal, command, hold, clamped,
            answer.gain_scale * self._adaptation.scale, partial(reference.sample, state.stamp_ns),
            state.v, answer.is_far)

    def _terms(self) -> EffortTerms | None:
        if self._last is None:
            return None
        answer, robot = self._last
        terms = robot.command_terms(answer.terms())
        # The effort is valid even if the energy overflows.
        return terms if all(np.isfinite(part).all() for part in terms) else None

    @property
    def quality(self) -> str:
        """A description of the joint states, from which `bandwidth_scale` follows."""
        return str(self._adaptation.quality)

    @property
    def knows_quality(self) -> bool:
        """Whether enough joint states have been received for a meaningful `bandwidth_scale`."""
        return self._adaptation.quality.is_known

    @property
    def bandwidth_scale(self) -> float:
        """Fraction of the natural frequency that the rate and the noise of the states allow."""
        return self._adaptation.scale

    @property
    def workspace(self) -> WorkspaceInertia:
        """M(q) and g(q) over the workspace, with the load."""
        return self._load.workspace

    def following_error(self, output: ControlOutput, q: FloatArray) -> str:
        """Return which joint exceeds its limit of the following error most, and by how much."""
        reference = output.reference
        return '' if reference is None else self._feedback.worst_error(
            reference.position, q, self.arm.joint_names)

    def braked(self, q: FloatArray, v: FloatArray | None, hold: FloatArray) -> FloatArray:
        """Return `hold` (n,) with a damping torque −M(q) D v, within the effort limits."""
        if v is None:
            return hold
        drive = self.arm.drive
        torque = hold if drive is None else drive.torque(hold)
        with self._lock, np.errstate(over='ignore', invalid='ignore'):
            M, limit = self._load.dynamics.rigid_body.mass_matrix(q), self.arm.limits.effort
            scale = FAULT_DAMPING * self._adaptation.scale
            damping = M @ (scale * self._feedback.gains.kd * v)
            braked = np.clip(
                torque - damping, np.minimum(-limit, torque), np.maximum(limit, torque))
            if not np.isfinite(braked).all():
                return hold
            return braked if drive is None else drive.command(braked)
