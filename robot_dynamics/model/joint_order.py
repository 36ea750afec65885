# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint name matching between the order of a request and the order of the arm.

A request names every actuated joint, in any order, or no joint, which means all joints in the
order of the arm. A request may also name mimic joints. The position, velocity and acceleration of
a mimic joint must be those that follow from its leader (within `MIMIC_TOLERANCE`); an effort at a
mimic joint, times its multiplier, is added to its leader; answers omit mimic joints. Locked joints
(see `load_arm`) cannot be named.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, MimicJoint
from robot_dynamics.validation import (
    check_samples,
    check_unique,
    check_vector,
    is_empty,
    LARGEST_VALUE,
)

MIMIC_TOLERANCE = 1e-3
"""Largest deviation of a named mimic joint from its leader [rad] or [m], and per second."""


class JointOrder:
    """The order of joints in one request; `names` are its actuated joints: those of an answer."""

    def __init__(self, arm: ArmModel, joint_names: Sequence[str] = ()) -> None:
        """Raise InvalidInputError on unknown, locked, duplicate or missing joints."""
        given = tuple(joint_names) or arm.joint_names
        self._given = given
        self._n = arm.joint_count
        mimics = {mimic.name: mimic for mimic in arm.mimic_joints}
        _check_names(arm, given, mimics)
        column = {name: i for i, name in enumerate(given)}
        self.names = tuple(name for name in given if name not in mimics)
        self._to_arm = np.array([column[name] for name in arm.joint_names])
        arm_index = {name: i for i, name in enumerate(arm.joint_names)}
        self._to_request = np.array([arm_index[name] for name in self.names])
        self._mimics = tuple(
            (column[name], arm_index[mimics[name].leader], mimics[name])
            for name in given if name in mimics)

    def position(self, value: npt.ArrayLike, field: str = 'position') -> FloatArray:
        """Return positions (n,) in the arm's order; raise InvalidInputError."""
        return self._motion(self._vector(field, value), field, True)

    def rate(self, value: npt.ArrayLike, field: str) -> FloatArray:
        """Return velocities or accelerations (n,) in the arm's order; empty means zero."""
        if is_empty(value):
            return np.zeros(self._n)
        return self._motion(self._vector(field, value), field, False)

    def effort(self, value: npt.ArrayLike, field: str = 'effort') -> FloatArray:
        """Return efforts (n,) in the arm's order, those at mimic joints added to their leaders."""
        given = self._vector(field, value)
        tau = given[self._to_arm]
        for column, leader, mimic in self._mimics:
            tau[leader] += mimic.multiplier * given[column]
        return np.asarray(tau)

    def positions(self, value: npt.ArrayLike, field: str = 'position') -> FloatArray:
        """Return many positions, (samples, n) in the arm's order, of a flat or 2-D array."""
        return self._motion(self._samples(field, value), field, True)

    def rates(self, value: npt.ArrayLike, samples: int, field: str) -> FloatArray:
        """Return many velocities or accelerations, (samples, n); empty means zero."""
        if is_empty(value):
            return np.zeros((samples, self._n))
        rates = self._samples(field, value)
        if len(rates) != samples:
            raise InvalidInputError(
                f'{field} has {len(rates)} samples, expected {samples} as position has, or none')
        return self._motion(rates, field, False)

    def answer(self, value: FloatArray) -> FloatArray:
        """Return values (..., n), given in the order of the arm, in the order of `names`."""
        return np.asarray(value[..., self._to_request])

    def answer_form(self, value: FloatArray) -> FloatArray:
        """Return an array (n, n) or (n, n, n) over joints with all axes in that order."""
        return np.asarray(value[np.ix_(*(self._to_request,) * value.ndim)])

    def _vector(self, field: str, value: npt.ArrayLike) -> FloatArray:
        return check_vector(field, value, len(self._given), self._given, LARGEST_VALUE)

    def _samples(self, field: str, value: npt.ArrayLike) -> FloatArray:
        return check_samples(field, value, len(self._given), self._given, LARGEST_VALUE)

    def _motion(self, given: FloatArray, field: str, with_offset: bool) -> FloatArray:
        arm_order = given[..., self._to_arm]
        for column, leader, mimic in self._mimics:
            follows = mimic.multiplier * arm_order[..., leader]
            if with_offset:
                follows = follows + mimic.offset
            off = np.abs(given[..., column] - follows)
            if np.max(off, initial=0.0) > MIMIC_TOLERANCE:
                worst = int(np.argmax(off))
                raise InvalidInputError(
                    f'{field} of mimic joint {mimic.name!r} is '
                    f'{np.ravel(given[..., column])[worst]:g}, but it follows {mimic.leader!r} '
                    f'({mimic.multiplier:g} × {mimic.leader}'
                    f'{f" + {mimic.offset:g}" if with_offset else ""} = '
                    f'{np.ravel(follows)[worst]:g}), expected that value, or the joint left out')
        return np.asarray(arm_order)


def _check_names(arm: ArmModel, given: Sequence[str], mimics: dict[str, MimicJoint]) -> None:
    check_unique('joint_names', given)
    for name in given:
        if name in arm.locked_joints:
            raise InvalidInputError(
                f'joint_names has {name!r}, which is locked at {arm.locked_joints[name]:g} '
                f'(parameter joints), expected {list(arm.joint_names)}')
        if name not in arm.joint_names and name not in mimics:
            also = f' and, if wanted, the mimic joints {list(mimics)}' if mimics else ''
            raise InvalidInputError(
                f'joint_names has {name!r}, expected {list(arm.joint_names)}{also}')
    missing = [name for name in arm.joint_names if name not in given]
    if missing:
        raise InvalidInputError(
            f'joint_names leaves out {missing}, expected every joint of {list(arm.joint_names)} '
            'in any order, or no names at all for this order')
