# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control laws of a controller, at the bandwidth that the states allow."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import loop_gains, LoopGains, StableGains
from robot_dynamics.control.gains.oscillation import Oscillation
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import ControlLaw, GravityCompensation
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.law_table import all_laws, law_named, law_options, NO_COMMAND
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.references.motion_limits import WorkspaceInertia


class ScaledLaws:
    """
    The laws for one set of options: with a reference, without one, and for a stop.

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
        self._arm, self._options, self._gains = arm, options, gains
        self.oscillation = Oscillation(arm.joint_names, lambda: gains.noise)
        self.feedback = ErrorFeedback(
            options.gains, arm.joint_kinds, options.largest_error(arm.limits.velocity))
        gravity = GravityCompensation(self.feedback, options)
        if options.command == NO_COMMAND:
            law: ControlLaw = gravity
        elif given is not None:
            law = given
        else:
            factory = law_named(options.command)
            law = factory(self.feedback, law_options(factory, arm, options))
        self.law = law
        """The law that `options.command` names."""
        self.follows = law.follows
        """Whether the law follows references."""
        self.holds = law.follows and options.stops_and_holds
        """Whether the arm stops and is held although there is no reference."""
        self.at_rest: ControlLaw = gravity if law.follows else law
        """The law without a reference."""
        self._stop: ControlLaw = law if isinstance(law, ComputedTorque) else (
            ComputedTorque(self.feedback, options))
        self._own = law if law.follows else self._stop
        self.with_reference = self._own
        """The law that follows the reference."""
        friction = arm.friction
        self.compensates_at_rest = law.follows and (
            options.friction_compensation == 'reference') and bool(
            (friction.at_rest.static + friction.load_coefficient).any())
        """Whether dry friction is compensated at joints that rest away from their goal."""

    def check_follows(self) -> None:
        """Raise TrajectoryError if the law does not follow references."""
        if not self.follows:
            names = [name for name, law in all_laws().items() if getattr(law, 'follows', True)]
            raise TrajectoryError(
                f'command is {self._options.command!r}, expected '
                f'{" or ".join(map(repr, names))} to follow a reference')

    def limit(self, workspace: WorkspaceInertia, rate: FloatArray) -> None:
        """Derive the gains of the loop from M(q), and limit the efforts to a rate (n,) [N·m/s]."""
        self._rate = rate
        self._gains_of_laws: dict[int, LoopGains] = {}
        for law in {id(law): law for law in (self._own, self._stop)}.values():
            self._gains_of_laws[id(law)] = loop_gains(law.closed_loop, workspace.matrices)
            if self._options.scales_gains:
                law.limit_rate(rate, workspace.row_sums())
        self._use(self.with_reference)

    def _use(self, law: ControlLaw) -> None:
        self.with_reference, self.loop_gains = law, self._gains_of_laws[id(law)]
        self._gains.set_loop_gains(
            self.loop_gains if self._options.scales_gains else None, self._rate)
        self.scale()

    def scale(self) -> None:
        """Scale the gains to the bandwidth that states and oscillations allow."""
        for law in (self.with_reference, self.at_rest):
            law.scale_gains(self._scale)

    def calm(self, stamp_ns: int, error: FloatArray, velocity_error: FloatArray) -> bool:
        """Take the errors of a state; return whether an oscillation changes the gains."""
        return self._options.scales_gains and not self.with_reference.bounces and (
            self.oscillation.take(1e-9 * stamp_ns, error, velocity_error))

    @property
    def _scale(self) -> FloatArray:
        return self.oscillation.factor * self._gains.scale

    @property
    def feedback_gains(self) -> tuple[FloatArray, FloatArray]:
        """K_p [1/s²] and K_d [1/s] (n,) of the feedback in use, scaled."""
        s, gains = self._scale, self.feedback.gains
        return np.asarray(s * s * gains.kp), np.asarray(s * gains.kd)
