# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control laws of a controller, at the bandwidth that the states allow."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import loop_gains, StableGains
from robot_dynamics.control.gains.oscillation import Oscillation
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import ControlLaw, GravityCompensation
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.law_table import make_law, NO_COMMAND
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.references.motion_limits import WorkspaceInertia


class ScaledLaws:
    """
    The laws for one set of options: with a reference, and without one.

    `Controller` calls the methods with its lock held.
    """

    def __init__(
        self, arm: ArmModel, options: ControllerOptions, gains: StableGains,
        given: ControlLaw | None,
    ) -> None:
        """
        Make the law that `options.command` names, or use the `given` one; then call `limit`.

        Raises InvalidInputError for an unknown law.
        """
        self._scales, self._gains = options.scales_gains, gains
        self.oscillation = Oscillation(arm.joint_names, gains)
        self.feedback = ErrorFeedback(
            options.gains, arm.joint_kinds, options.largest_error(arm.limits.velocity))
        gravity = GravityCompensation(self.feedback, options)
        self.law = gravity if options.command == NO_COMMAND else (
            given or make_law(arm, self.feedback, options))
        """The law that `options.command` names."""
        self.follows = self.law.follows
        """Whether the law follows references."""
        self.holds = self.follows and options.stops_and_holds
        """Whether the arm stops and is held although there is no reference."""
        self.at_rest: ControlLaw = gravity if self.follows else self.law
        """The law without a reference."""
        self.with_reference = self.law if self.follows else (
            ComputedTorque(self.feedback, options))
        """The law that follows the reference."""

    def limit(self, workspace: WorkspaceInertia, rate: FloatArray) -> None:
        """Derive the gains of the loop from M(q), and limit the efforts to a rate (n,) [N·m/s]."""
        law = self.with_reference
        if self._scales:
            law.limit_rate(rate, workspace.mass.sum(axis=2).max(axis=0))
            self._gains.set_loop_gains(loop_gains(law.closed_loop, workspace.matrices), rate)
        self.scale()

    def scale(self) -> None:
        """Scale the gains to the bandwidth that states and oscillations allow."""
        self._scale = self.oscillation.factor * self._gains.scale
        for law in (self.with_reference, self.at_rest):
            law.scale_gains(self._scale)

    @property
    def feedback_gains(self) -> tuple[FloatArray, FloatArray]:
        """K_p [1/s²] and K_d [1/s] (n,) of the feedback in use, scaled."""
        s, gains = self._scale, self.feedback.gains
        return np.asarray(s * s * gains.kp), np.asarray(s * gains.kd)
