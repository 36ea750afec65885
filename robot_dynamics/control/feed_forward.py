# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Feed-forward for drives that close the loop themselves: τ = k_p e + k_d ė + τ_ff.

τ_ff = M(q_r) q̈_r + C(q_r, q̇_r) q̇_r + g(q_r) + τ_f(q̇_r) depends on the reference only. It adds
no feedback, so that its delay cannot make the loop of the drive unstable. The reference is that of
the control loop: within the limits of the arm, with its stops and holds. During a fault without a
reference it is the position at which the fault began, at rest. With a law that does not follow
references it is the measured position, at rest: the drives then only damp the arm.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.control.safety.effort_bounds import robot_effort
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.trajectories.interpolation import Reference


class DriveCommand(NamedTuple):
    """Position [rad] or [m], velocity, and feed-forward effort [N·m] or [N], each (n,)."""

    position: FloatArray
    velocity: FloatArray
    effort: FloatArray

    def position_offset(
        self, stiffness: FloatArray, lower: FloatArray, upper: FloatArray,
    ) -> FloatArray:
        """
        Return the position (n,) whose error of a drive with this stiffness is the effort.

        `stiffness` k_p (n,) is in N·m/rad or N/m; 0 for a joint without an offset. The result is
        within the position limits `lower` and `upper` (n,), as far as the reference is.
        """
        with np.errstate(over='ignore'):
            offset = np.divide(
                self.effort, stiffness, out=np.zeros_like(self.effort), where=stiffness > 0.0)
        return np.clip(
            self.position + offset, np.minimum(lower, self.position),
            np.maximum(upper, self.position))


class FeedForward:
    """The commands to the drives of an arm that one control loop moves; not for two threads."""

    def __init__(self, loop: ControlLoop) -> None:
        self._loop = loop
        self._held: Reference | None = None

    def command(self, answer: LoopAnswer) -> DriveCommand | None:
        """Return the command for an answer of the loop, None while the arm is not commanded."""
        loop, output = self._loop, answer.output
        is_off = loop.supervisor.mode in (Mode.INACTIVE, Mode.WAITING)
        if is_off or output.command is None:
            self._held = None
            return None
        q = output.state.q
        reference = output.reference or self._held or Reference(q.copy(), 0.0 * q, 0.0 * q)
        holds = output.reference is None and loop.controller.laws.follows
        self._held = reference if holds else None
        return DriveCommand(
            reference.position, reference.velocity, self._effort(output, reference))

    def _effort(self, output: ControlOutput, reference: Reference) -> FloatArray:
        """Return the effort of the drives (n,), without what the robot adds on its own."""
        q, v, a = reference
        options, dynamics = self._loop.controller.options, output.state.dynamics
        convention = options.effort_convention
        with output.lock:
            tau = dynamics.rigid_body.inverse_dynamics(q, v, a)
            if not convention.compensates_friction and options.friction_compensation != 'none':
                tau = tau + dynamics.friction.tracking_effort(v, np.zeros_like(v), 0.0, tau)
            tau = np.clip(tau, -output.bounds.scaled, output.bounds.scaled)
            tau = robot_effort(
                convention, output.unloaded.rigid_body.gravity(q), 0.0, output.drive).command(tau)
        return tau if output.drive is None else output.drive.command(tau)
