# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the controller returns for one state: the efforts, or an error if they are not finite."""

from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.laws.control_law import LawInput, LawOutput
from robot_dynamics.control.safety.effort_bounds import EffortBounds, RobotEffort
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_calibration import EffortCalibration
from robot_dynamics.model.arm_dynamics import EffortTerms, UncheckedArmDynamics
from robot_dynamics.trajectories.interpolation import Reference


class NonFiniteEffortError(InvalidInputError):
    """A state for which the model has no finite effort."""


@dataclass(eq=False)
class ControlOutput:
    """
    The efforts for one state, each (n,) [N·m] or [N].

    Efforts that are not part of the command are computed when they are read.
    """

    state: LawInput
    """The input of the law."""
    law: LawOutput
    """The efforts of the law, before any limit."""
    scale: float
    """The smallest fraction of the bandwidth to which the gains were scaled down."""
    robot: RobotEffort
    """The efforts that the robot adds on its own."""
    unloaded: UncheckedArmDynamics
    """The dynamics without loads, with the gravity of `robot`."""
    bounds: EffortBounds
    drive: EffortCalibration | None
    lock: AbstractContextManager[object]
    command: FloatArray | None = None
    """
    The effort to command, None for none.

    It is within the effort limits, an effort of the drives (`EffortCalibration`), and excludes the
    efforts that the robot adds on its own.
    """
    clamped: BoolArray | None = None
    """Marks the joints of `command` that met their effort limit; None if none did."""
    limits: tuple[str, ...] = ()
    """The names of the limits that have changed the command."""

    @property
    def gravity_compensation(self) -> FloatArray:
        """The gravity-compensation torque g(q) with the load."""
        if self.law.gravity is not None:
            return self.law.gravity
        with self.lock:
            return self.state.gravity

    @property
    def robot_gravity(self) -> FloatArray:
        """The gravity-compensation torque without a load."""
        if self.unloaded is self.state.dynamics:
            return self.gravity_compensation
        with self.lock:
            return self.unloaded.rigid_body.gravity(self.state.q)

    @property
    def computed_torque(self) -> FloatArray | None:
        """The effort of the law that follows the reference, None without a reference."""
        return None if self.state.trajectory is None else self.law.effort

    @property
    def reference(self) -> Reference | None:
        """The reference that is followed, or None."""
        return None if self.state.trajectory is None else self.state.reference

    def holding_effort(self) -> FloatArray:
        """Return the command that holds the arm still; a command starts from it."""
        effort = self.holding_torque()
        return effort if self.drive is None else self.drive.command(effort)

    def holding_torque(self) -> FloatArray:
        """Return the same as torques at the joints."""
        gravity = self.gravity_compensation - self.robot.gravity
        return self.bounds.bounded(gravity, self.robot)[0]

    def motion_equation(
        self, q: FloatArray, v: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return M(q) (n, n), and C(q, v) v + friction (n,), as command efforts."""
        with self.lock:
            body, drive = self.state.dynamics.rigid_body, self.drive
            M, passive = body.mass_matrix(q), self.law.friction - self.robot.friction
            passive = passive + body.nonlinear(q, v) - body.gravity(q)
            return (M, passive) if drive is None else (
                M / drive.scale[:, np.newaxis], passive / drive.scale)

    @property
    def terms(self) -> EffortTerms | None:
        """
        The terms of the command, or None if they are not finite.

        `inertial` is what remains of the effort, so that it contains the feedback. A law without
        a reference compensates no C(q, v) v.
        """
        state, effort, friction = self.state, self.law.effort, self.law.friction
        q, zero, body = state.q_ahead, np.zeros_like(effort), state.dynamics.rigid_body
        v = zero if state.trajectory is None else state.v
        with self.lock, np.errstate(over='ignore', invalid='ignore'):
            gravity = body.gravity(q)
            terms = state.dynamics.terms(q, v, zero, friction=friction)
            terms = self.robot.command_terms(terms._replace(
                inertial=effort - terms.coriolis - gravity - friction, gravity=gravity,
                effort=effort, kinetic_energy=body.kinetic_energy(q, state.v)))
            # The effort is valid even if the energy overflows.
            return terms if all(np.isfinite(part).all() for part in terms) else None
