# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Simulation of the motion of an arm under given efforts: integrated forward dynamics.

Over each step of integration, the effort of a motor is constant: the mean of the effort that its
electrical side delivers (`current_loop`). `integrator` computes the motion of the arm.
"""

from collections.abc import Sequence
import reprlib
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.payload_transition import PayloadTransition
from robot_dynamics.simulation.backlash import Backlash
from robot_dynamics.simulation.bristles import Bristles
from robot_dynamics.simulation.current_loop import CurrentLoop
from robot_dynamics.simulation.integrator import MotionIntegrator
from robot_dynamics.simulation.joint_forces import JointForces, MotionState
from robot_dynamics.validation import check_scalar, check_vector, LARGEST_VALUE

DEFAULT_MAX_STEP = 2e-3
"""[s]"""


class ArmState(NamedTuple):
    """Position (n,) [rad] or [m], and velocity (n,)."""

    position: FloatArray
    velocity: FloatArray


class Energy(NamedTuple):
    """Kinetic and potential energy [J]."""

    kinetic: float
    potential: float


class ArmSimulation:
    """
    An arm in motion. Its brakes hold it until `release` is called, and again after `brake`.

    All arrays are (n,) in the order of `arm.joint_names`.
    """

    def __init__(
        self, arm: ArmModel, position: npt.ArrayLike | None = None,
        velocity: npt.ArrayLike | None = None, max_step: float = DEFAULT_MAX_STEP,
    ) -> None:
        """
        Start at `position`, by default 0 or the limit nearest to it, and `velocity`, default 0.

        `max_step` [s] bounds the step of integration. Raises InvalidInputError.
        """
        n, names = arm.joint_count, arm.joint_names
        home = np.clip(0.0, arm.limits.lower, arm.limits.upper)
        self._initial = ArmState(
            home if position is None else check_vector('initial_position', position, n, names),
            np.zeros(n) if velocity is None else (
                check_vector('initial_velocity', velocity, n, names)))
        self._max_step = check_scalar('max_step', max_step, 0.0, exclusive_minimum=True)
        self._bare_arm = arm
        self._transition: PayloadTransition | None = None
        self._transition_ns = 0
        """Since the transition began."""
        self._use(arm)
        self.reset()

    def __repr__(self) -> str:
        brakes = 'brakes on' if self.braked else 'brakes off'
        position = reprlib.repr([float(f'{x:.4g}') for x in self.q])
        return f'<ArmSimulation of {self.arm!r}, {brakes}, position {position}>'

    def check_inertia(self) -> None:
        """Raise ModelError if a joint moves no mass: its acceleration would be infinite."""
        inertia = np.diag(self._dynamics.rigid_body.mass_matrix(self._initial.position))
        massless = [
            name for name, value in zip(self.arm.joint_names, inertia) if value == 0.0]
        if massless:
            raise ModelError(
                f'joints {massless} of robot {self.arm.name!r} move no mass or inertia, so that '
                'it cannot be simulated, expected an <inertial> on the links that they move, or '
                'these joints left out of the parameter joints')

    @property
    def arm(self) -> ArmModel:
        return self._dynamics.arm

    def reset(self) -> None:
        """Return to the initial state with engaged brakes."""
        self.place(*self._initial)
        self._hold()
        self.work = 0.0
        """Work [J] of the efforts, and energy of changes of load or gravity, since the start."""
        self.heat = 0.0
        """Heat [J] from friction, impacts of teeth and brakes since the start."""

    def _hold(self) -> None:
        """Hold the arm with the brakes, with its motors off."""
        self.braked = True
        self.effort = np.zeros_like(self._now.q)
        """The last effort (n,) [N·m] or [N] of the actuators."""
        self._drive = None if self.arm.actuators is None else CurrentLoop(self.arm.actuators)
        self._motor_acceleration = np.zeros_like(self._now.q)

    def place(self, position: FloatArray, velocity: FloatArray) -> None:
        """
        Set position and velocity, (n,) each; gears with backlash are in contact under load.

        Joints that move slide. The bristles of dry friction of joints at rest are relaxed, so that
        under the effort of gravity the arm stays at rest; without an effort it first moves by up
        to the presliding distance.
        """
        q, v = position.copy(), velocity.copy()
        theta, backlash = q, Backlash.of(self.arm.actuators)
        if backlash is not None:  # in contact in the direction of the effort
            theta = q + np.sign(self._dynamics.rigid_body.gravity(q)) * backlash.half_gap
        bristles = Bristles.of(self._dynamics.friction)
        z = np.zeros_like(q) if bristles is None else bristles.initial(v)
        self._now = MotionState(q, v, theta, v, z)

    def release(self) -> None:
        """Release the brakes."""
        self.braked = False

    def brake(self) -> None:
        """Engage the brakes: joints and motors stop at once; their kinetic energy becomes heat."""
        if self.braked:
            return
        self.heat += self._forces.kinetic_energy(self._now)
        self._now = self._now._replace(
            v=np.zeros_like(self._now.v), omega=np.zeros_like(self._now.omega))
        self._hold()

    @property
    def payloads(self) -> tuple[Payload, ...]:
        """The payloads after the transition, if there is one."""
        return self.arm.payloads if self._transition is None else self._transition.target

    def set_payloads(self, payloads: Sequence[Payload], transition_time: float = 0.0) -> None:
        """
        Replace the payloads over transition_time [s] of motion; raise InvalidInputError.

        They take on the velocity of their links. The change of energy counts as work. An arm that
        the brakes hold takes them at once.
        """
        arm = self._bare_arm.with_payloads(payloads)
        if transition_time > 0.0 and not self.braked:
            self._transition = PayloadTransition(self.arm.payloads, payloads, transition_time)
            self._transition.payloads(0)
            self._transition_ns = 0
        else:
            self._transition = None
            self._change(arm)

    def _continue(self, transition: PayloadTransition, duration: float) -> None:
        self._transition_ns += round(duration * NANOSECONDS_PER_SECOND)
        self._change(self._bare_arm.with_payloads(transition.payloads(self._transition_ns)))
        if transition.done:
            self._transition = None

    def set_gravity(self, gravity: FloatArray) -> None:
        """Change gravity (3,) [m/s²] at once; the change of energy counts as work."""
        payloads = self.arm.payloads
        self._bare_arm = self._bare_arm.with_gravity(gravity)
        self._change(self._bare_arm.with_payloads(payloads))

    def _change(self, arm: ArmModel) -> None:
        before = sum(self.energy)
        self._use(arm)
        self.work += sum(self.energy) - before

    def _use(self, arm: ArmModel) -> None:
        self._dynamics = UncheckedArmDynamics(arm)
        self._forces = JointForces(self._dynamics)
        self._integrator = MotionIntegrator(self._forces)

    @property
    def q(self) -> FloatArray:
        """The joints' position (n,) [rad] or [m]; not a copy."""
        return self._now.q

    @property
    def v(self) -> FloatArray:
        """The joints' velocity (n,) [rad/s] or [m/s]; not a copy."""
        return self._now.v

    @property
    def state(self) -> ArmState:
        return ArmState(self._now.q.copy(), self._now.v.copy())

    @property
    def motor_state(self) -> ArmState:
        """Motor-side state divided by the gear ratio; differs from the joints by the backlash."""
        return ArmState(self._now.theta.copy(), self._now.omega.copy())

    @property
    def presliding_state(self) -> FloatArray:
        """The deflection z (n,) in [−1, 1] of dry friction; 0 for joints that stick rigidly."""
        return self._now.z.copy()

    @property
    def energy(self) -> Energy:
        """The energy of links and rotors, and of the springs of presliding."""
        now = self._now
        return Energy(
            self._forces.kinetic_energy(now), self._forces.potential_energy(now))

    def step(
        self, tau: FloatArray, duration: float, wrenches: Sequence[ExternalWrench] = (),
    ) -> ArmState:
        """
        Return the state after `duration` [s] under the constant effort tau.

        Raises InvalidInputError if the brakes are engaged, and if the state is not finite or
        beyond LARGEST_VALUE, because a joint moves no mass or an effort is too large; the previous
        state is then kept.
        """
        check_released(self.braked)
        if self._transition is not None:
            self._continue(self._transition, duration)
        try:
            with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
                return self._step(tau, duration, wrenches)
        except np.linalg.LinAlgError as error:
            raise self._not_finite(str(error)) from None

    def wait(self, duration: float, wrenches: Sequence[ExternalWrench] = ()) -> None:
        """Let `duration` [s] pass with engaged brakes, which hold the arm against everything."""

    def _step(
        self, tau: FloatArray, duration: float, wrenches: Sequence[ExternalWrench],
    ) -> ArmState:
        steps = max(1, int(np.ceil(duration / self._max_step - 1e-9)))
        h = duration / steps
        acceleration = self._motor_acceleration
        effort = self.effort if self._drive is not None else tau
        now, heat, work = self._now, 0.0, 0.0
        for _ in range(steps):
            before = now
            if self._drive is not None:
                effort = self._driven(tau, effort, before, acceleration, h)
            self._forces.drive(effort, wrenches)
            result = self._integrator.step(before, h)
            now, heat = result.state, heat + result.heat
            work += float(effort @ (now.theta - before.theta))
            if self._drive is None and now is before:
                break  # all joints stick, and the state remains constant
            acceleration = np.zeros_like(effort) if result.had_impact else (
                (now.omega - before.omega) / h)
        if not (np.abs(now) <= LARGEST_VALUE).all():  # also True for NaN
            raise self._not_finite('the state overflows')
        self.heat, self.work = self.heat + heat, self.work + work
        self._now, self._motor_acceleration, self.effort = now, acceleration, effort
        return self.state

    def _driven(
        self, tau: FloatArray, effort: FloatArray, now: MotionState, acceleration: FloatArray,
        h: float,
    ) -> FloatArray:
        """Return the effort of the motors over h [s], after `effort` and its `acceleration`."""
        assert self._drive is not None
        # The predicted velocity in the middle of the step.
        step = self._drive.effort_over_step(tau, now.omega + 0.5 * h * acceleration, h)
        # The effort of a sticking joint has no effect on its velocity.
        moves = (now.omega != 0.0) | (self._dynamics.friction.breakaway == 0.0)
        if not (step.damping * moves).any():
            return step.effort
        step = step._replace(damping=step.damping * moves)
        return step.implicit(effort, self._forces.motor_inertia(now), h)

    def _not_finite(self, reason: str) -> InvalidInputError:
        return InvalidInputError(
            f'the motion from position {self._now.q.tolist()} has no finite solution ({reason}), '
            'expected every joint to move some mass or inertia, and efforts that it can bear')


def check_released(braked: bool) -> None:
    """Raise InvalidInputError if the brakes of a simulated arm are engaged."""
    if braked:
        raise InvalidInputError(
            'the brakes hold the simulated arm, as they do at the start: expected release() '
            'before step()')
