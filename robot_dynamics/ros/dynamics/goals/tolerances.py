# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The tolerances of a goal of `FollowJointTrajectory`: 0 keeps the default, −1 means none."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math
from typing import Any

from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.trajectory_goal import Tolerances
from robot_dynamics.exceptions import InvalidInputError, JointNamesError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.parameters import goal_tolerances
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics.ros.parameters.declared_parameters import Values

DEFAULT, ERASED = 0.0, -1.0
"""Values of a tolerance: use the default, and use no tolerance."""


def tolerances_of(request: Any, arm: ArmModel, values: Values) -> Tolerances:
    """Return the tolerances of a goal, by default those of the parameters; raise as with_given."""
    names = arm.joint_names
    defaults = goal_tolerances(values, arm)
    for field in ('path_tolerance', 'goal_tolerance'):
        for one in getattr(request, field):
            if one.acceleration not in (0.0, ERASED):
                raise InvalidInputError(
                    f'{field} of {one.name!r} has the acceleration {one.acceleration:g}, '
                    'expected 0 or -1: accelerations are not measured')
    goal_time = stamp_from_ros(request.goal_time_tolerance)

    def given(field: str, quantity: str, default: FloatArray) -> FloatArray:
        return with_given(f'{field}.{quantity}', {
            one.name: getattr(one, quantity) for one in getattr(request, field)}, default, names)

    return replace(
        defaults,
        path=given('path_tolerance', 'position', defaults.path),
        path_velocity=given('path_tolerance', 'velocity', defaults.path_velocity),
        goal=given('goal_tolerance', 'position', defaults.goal),
        goal_velocity=given('goal_tolerance', 'velocity', defaults.goal_velocity),
        goal_time=_goal_time(1e-9 * goal_time, defaults.goal_time))


def _goal_time(given: float, default: float) -> float:
    if given == ERASED:
        return math.inf
    if given < 0.0:
        raise InvalidInputError(
            f'goal_time_tolerance is {given:g} s, expected a time above 0, 0 for the default, or '
            '-1 for any time')
    return given or default


def with_given(
    field: str, given: Mapping[str, float], defaults: FloatArray, joint_names: Sequence[str],
) -> FloatArray:
    """
    Return tolerances (n,): those that are `given` by joint name, and the defaults.

    0 keeps the default, −1 means none. Raises JointNamesError for an unknown joint, and
    InvalidInputError for another negative value or one that is not finite.
    """
    values = defaults.copy()
    for name, value in given.items():
        if name not in joint_names:
            raise JointNamesError(
                f'{field} has a tolerance for {name!r}, expected joints of this arm: '
                f'{list(joint_names)}')
        if not (0.0 <= value < math.inf or value == ERASED):
            raise InvalidInputError(
                f'{field} of {name!r} is {value:g}, expected a tolerance above 0, 0 for the '
                'default, or -1 for none')
        if value != DEFAULT:
            values[list(joint_names).index(name)] = math.inf if value == ERASED else value
    return values
