# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Options of the controller."""

from collections.abc import Mapping
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import Gains, make_gains
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.references.motion_limits import DEFAULT_VELOCITY

ERROR_TIME = 0.3
"""[s]: the limit of the following error is the distance at the velocity limit in this time."""
FULL_EFFORT_TIME = 0.1
"""Default time [s] in which the command may change by the effort limit of a joint."""
DEFAULT_EFFORT_RATE = 1000.0
"""Default rate of change [N·m/s] or [N/s] for a joint without an effort limit."""
DEFAULT_STATE_MAX_AGE = 0.2
"""Default of the largest age of a state [s]."""


@dataclass(frozen=True)
class ControllerOptions:
    """Options that may change while the controller runs."""

    gains: Gains
    command: str = 'computed_torque'
    """The name of a law, or `none`; see `law_table`."""
    effort_limit_fraction: float = 1.0
    """The command is clamped to this fraction of the effort limits of the URDF."""
    friction_compensation: str = 'reference'
    """The velocity at which computed torque compensates friction; see `computed_torque`."""
    effort_rate: FloatArray | float = math.inf
    """Largest rate of change of the torque [N·m/s] or [N/s], (n,) or one for all joints."""
    effort_convention: EffortConvention = EffortConvention()
    """States which efforts the robot adds to the command on its own; the command omits them."""
    scales_gains: bool = False
    """Scale the feedback down to what rate and noise of the states allow (`gain_scaling`)."""
    conditions_references: bool = False
    """Follow references within the limits of the arm; see `reference_generator`."""
    slows_down: bool = False
    """Slow down an infeasible trajectory or set-point instead of rejecting it."""
    stops_and_holds: bool = False
    """Without a reference, stop from the measured state and hold, not only compensate gravity."""
    following_error: npt.ArrayLike | None = None
    """Limit of the following error [rad] or [m], (n,) or one for all joints; 0: no limit."""
    stream_timeout: float = 0.1
    """[s] for which a set-point with a velocity is followed."""
    checks_goals: bool = False
    """Reject points beyond the position and velocity limits of the arm; see `goal_limits`."""
    clips_positions: bool = False
    """Clip positions beyond the limits instead of rejecting them."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Values of parameters that laws declare (`LawParameter`), by name; else their defaults."""
    drive_stiffness: FloatArray | None = None
    """k_p (n,) [N·m/rad] or [N/m] of drives that move the arm with `FeedForward`."""

    def largest_error(self, velocity_limit: FloatArray) -> FloatArray:
        """Return the limit of the following error (n,) [rad] or [m], ∞ for no limit."""
        if self.following_error is not None:
            limit = np.full_like(velocity_limit, self.following_error)
            return np.where(limit > 0.0, limit, math.inf)
        return ERROR_TIME * np.where(
            np.isfinite(velocity_limit), velocity_limit, DEFAULT_VELOCITY)


@dataclass(frozen=True, kw_only=True)
class LawOptions(ControllerOptions):
    """The options that a law is made with; `parameters` has the checked values of its own."""

    arm: ArmModel


def default_effort_rates(arm: ArmModel) -> FloatArray:
    """Return the default rates of change of the command, (n,) [N·m/s] or [N/s]."""
    limit = arm.given_drive.limit
    return np.where(np.isfinite(limit), limit / FULL_EFFORT_TIME, DEFAULT_EFFORT_RATE)


def default_options(arm: ArmModel, **options: Any) -> ControllerOptions:
    """Return the defaults of the node `dynamics`, replaced by `options`, such as `gains`."""
    rates = default_effort_rates(arm)
    defaults: dict[str, Any] = {
        'gains': make_gains(arm.joint_names),
        'effort_rate': rates if arm.drive is None else np.abs(arm.drive.scale) * rates,
        'scales_gains': True, 'conditions_references': True, 'stops_and_holds': True,
        'checks_goals': True}
    return ControllerOptions(**{**defaults, **options})


def default_limits(arm: ArmModel) -> EffortLimits:
    """Return the limits of the command by the defaults of the node `dynamics`."""
    limits = arm.limits
    return EffortLimits(
        limits.lower, limits.upper, limits.velocity, default_effort_rates(arm),
        arm.given_drive.limit, np.sign(arm.given_drive.scale))
