# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control laws of a controller, at the bandwidth that the states allow."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import loop_gains, LoopGains, StableGains
from robot_dynamics.control.gains.oscillation import Oscillation
from robot_dynamics.control.laws.cartesian_impedance import CartesianImpedance
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import (
    ControlLaw,
    further_laws,
    GravityCompensation,
    LawFactory,
    load_law,
)
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.hand_guiding import HandGuiding
from robot_dynamics.control.laws.joint_impedance import JointImpedance
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.references.motion_limits import WorkspaceInertia

LAWS: dict[str, LawFactory] = {
    'cartesian_impedance': CartesianImpedance,
    'computed_torque': ComputedTorque,
    'gravity_compensation': GravityCompensation,
    'hand_guiding': HandGuiding,
    'joint_impedance': JointImpedance,
}
"""The control laws of this package, by the values of the parameter `command`."""
NO_COMMAND = 'none'


def command_modes() -> tuple[str, ...]:
    """Return the values of the parameter `command`: all laws, and `none`."""
    return (*LAWS, *sorted(further_laws().keys() - LAWS.keys()), NO_COMMAND)


def _make_law(feedback: ErrorFeedback, options: ControllerOptions) -> ControlLaw:
    if options.command in LAWS:
        return LAWS[options.command](feedback, options)
    if options.command not in further_laws():
        raise InvalidInputError(
            f'command is {options.command!r}, expected one of {list(command_modes())}')
    return load_law(options.command)(feedback, options)


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
        law = gravity if options.command == NO_COMMAND else (
            _make_law(self.feedback, options) if given is None else given)
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
            names = [name for name in command_modes()
                     if name not in ('gravity_compensation', 'hand_guiding', NO_COMMAND)]
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
