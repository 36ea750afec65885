# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction at the joints, on the joint side of the gearbox: the sum of its terms (`friction_terms`).

    τ_f = F_v v + [F_c + (F_s − F_c) exp(−(v/v_s)²)] sgn v + F_o
        + (F_a + μ |τ_load|) tanh(v/v_a)

The first line is viscous and dry friction. At rest, dry friction has any value up to F_s that
holds the joint (`stiction`). The second line is the friction of gears and drives, as
identification determines it; τ_load = M a + C v + g − Jᵀ f.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple, TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction_terms import smooth_sign, TERMS, VISCOUS
from robot_dynamics.joints.parameter_field import ParameterField, per_joint_values
from robot_dynamics.validation import is_empty

SMOOTHING_VELOCITY = 0.01
"""Velocity [rad/s] or [m/s] over which the smooth sign of dry friction changes."""
PRESLIDINGS = 5.0
"""Width of the compensation of an error at rest, in presliding distances (`tracking_effort`)."""
UNKNOWN_WIDTH, LEAST_WIDTH = 0.025, 0.005
"""[rad] or [m] of this width, without a presliding distance and at least."""
FRICTION_FIELDS = tuple(field for term in TERMS for field in term.fields)
"""The parameters of all terms."""
LEAST_PRESLIDING = 1e-6
"""[rad] or [m]: no spring is stiffer than F_c by this distance."""
_SLOW = 1e-9
"""Velocity [rad/s] or [m/s] at which the slope of friction is that at rest."""


class FrictionAtRest(NamedTuple):
    """The friction (n,) that may hold a joint at rest in any direction."""

    static: FloatArray


class JointFriction:
    """The friction of n joints; the parameters (n,) of all terms are attributes by their names."""

    def __init__(self, values: Mapping[str, FloatArray]) -> None:
        vars(self).update(values)
        self._values, self._rest = values, np.zeros_like(self.viscous)
        self._dry = [term.dry for term in TERMS if term.dry and term.dry(self, self._rest).any()]
        smooth = [(term.shape, values[term.size], values.get(term.per_load, self._rest))
                  for term in TERMS if term.shape]
        self._smooth = [(shape, size, per_load if per_load.any() else None)
                        for shape, size, per_load in smooth if size.any() or per_load.any()]
        self._has_offset = bool(self.offset.any())
        self.is_dry = bool(self._dry)
        """Whether any joint has dry friction."""
        self.is_linear = all(shape is VISCOUS.shape for shape, _, _ in self._smooth)
        """Whether smooth friction is viscous friction."""
        self.is_viscous = self.is_linear and not (self.is_dry or self._has_offset)
        """Whether there is only viscous friction, or no friction."""
        self.is_zero = self.is_viscous and not self._smooth
        """Whether there is no friction."""
        self.at_rest = FrictionAtRest(
            sum((size * shape(self, self._rest + np.inf) for shape, size, _ in self._smooth
                 if shape is not VISCOUS.shape), start=self.dry(self._rest)))

    if TYPE_CHECKING:
        def __getattr__(self, name: str) -> FloatArray: ...

    def __reduce__(self) -> tuple[object, ...]:
        """Return what other processes make this friction from."""
        return JointFriction, (self._values,)

    def replaced(self, **values: FloatArray) -> 'JointFriction':
        """Return this friction with other values (n,) of these parameters."""
        return JointFriction({**self._values, **values})

    def unit(self, name: str) -> 'JointFriction':
        """Return friction with one magnitude of 1 instead of all others, with the same widths."""
        one = self._rest + 1.0
        return self.replaced(**{
            field.name: one if name in (field.name, field.follows) else self._rest
            for field in FRICTION_FIELDS if not field.needs})

    @cached_property
    def has_gear_terms(self) -> bool:
        """Whether any joint has friction of gears and drives."""
        return bool(self.sigmoid.any() or self.load_coefficient.any())

    @cached_property
    def breakaway(self) -> FloatArray:
        """Dry friction (n,) up to which a joint sticks, F_s."""
        return self.dry(self._rest)

    @cached_property
    def steep_below(self) -> FloatArray:
        """The speeds (2, n) below which dry and other friction change fast with the speed."""
        speeds = np.zeros((2, len(self._rest)))
        for term in TERMS:
            for width in (field for field in term.fields if field.range):
                acts = [self.acts(field) for field in term.fields if field.name in width.needs]
                speed = np.any(acts, axis=0) * width.range * getattr(self, width.name)
                i = int(term.dry is None)
                speeds[i] = np.maximum(speeds[i], speed)
        return speeds

    def acts(self, field: ParameterField) -> BoolArray:
        """Return at which joints (n,) a parameter differs from that without effect."""
        neutral = getattr(self, field.follows) if field.follows else 0.0
        return np.asarray(getattr(self, field.name) != neutral)

    def counterpart(self, attribute: str) -> FloatArray:
        """Return the parameters (n,) for an attribute of `<dynamics>`: damping or friction."""
        return sum((getattr(self, field.name) for field in FRICTION_FIELDS
                    if field.counterpart == attribute), start=self._rest)

    @property
    def omitted(self) -> list[str]:
        """What MJCF has no counterpart of."""
        return [field.omitted or f'friction.{field.name}' for field in FRICTION_FIELDS
                if (field.omitted or not (field.counterpart or field.needs))
                and self.acts(field).any()]

    def dry(self, v: FloatArray) -> FloatArray:
        """Return the magnitude of dry friction of a joint that slides at v, (..., n) or (n,)."""
        total = None
        for magnitude in self._dry:
            total = magnitude(self, v) if total is None else total + magnitude(self, v)
        return np.zeros_like(v) if total is None else total

    def smooth(self, v: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """Return smooth friction (..., n), and that per unit of |load|, None without it."""
        effort, by_load = None, None
        for part, size, per_load in self._smooth:
            shape = part(self, v)
            effort = size * shape if effort is None else effort + size * shape
            if per_load is not None:
                by_load = per_load * shape if by_load is None else by_load + per_load * shape
        return np.zeros_like(v) if effort is None else effort, by_load

    def effort(
        self, v: FloatArray, load: FloatArray | float = 0.0, sign: FloatArray | None = None,
    ) -> FloatArray:
        """
        Return what actuators must add to overcome friction at the velocity v, shape (..., n).

        `load` (..., n) is the effort of the rigid bodies, M a + C v + g − Jᵀ f. Dry friction has
        the sign of v, 0 at rest, or `sign` (..., n) if it is given.
        """
        effort, per_load = self.smooth(v)
        if self._dry:
            effort = effort + self.dry(v) * (np.sign(v) if sign is None else sign)
        if self._has_offset:
            effort = effort + self.offset
        return effort if per_load is None else effort + per_load * np.abs(load)

    def smooth_effort(self, v: FloatArray, load: FloatArray | float = 0.0) -> FloatArray:
        """
        Return the effort with tanh(v / SMOOTHING_VELOCITY) instead of the sign, (..., n).

        It is used by control laws, whose effort must not chatter around rest, and by the
        identification, in which the sign of a noisy velocity has no meaning.
        """
        return self.effort(v, load, smooth_sign(v, SMOOTHING_VELOCITY))

    def tracking_effort(
        self, v: FloatArray, error: FloatArray, rate: FloatArray | float = 0.0,
        load: FloatArray | float = 0.0,
    ) -> FloatArray:
        """
        Return the compensation (n,) along a reference with the velocity v, at a position error.

        Viscous friction is that at v + rate · error, so that it does not hold an error; `rate` is
        in 1/s (J.-J. E. Slotine, W. Li, Int. J. Robotics Research 6(3), 1987). The sign of dry
        friction is that of the reference in a motion; it fades if the joint is ahead of its
        reference, so that friction that is given too large does not drive the joint away. At rest
        the compensation is a spring of F_s / w up to the error w, in parallel to that of the
        gearbox, F_c over its presliding distance d. It acts late: if w is below about twice d, the
        loop gain of both exceeds 1, and the joint vibrates (small-gain theorem). With w = 5 d the
        gain is below 1 for a resonance of 3.5 and friction that is given 1.4 times too large.
        """
        pull = self.viscous * rate * error
        if self.is_viscous:
            return np.asarray(self.viscous * v + pull)
        offset = error / self.tracking_width
        direction = gear = _tracking_sign(v / SMOOTHING_VELOCITY, offset)
        if self.has_gear_terms:
            gear = _tracking_sign(v / self.sigmoid_velocity, offset)
        return pull + self.directed_effort(v, direction, gear, load)

    def directed_effort(
        self, v: FloatArray, direction: FloatArray, gear_direction: FloatArray,
        load: FloatArray | float = 0.0,
    ) -> FloatArray:
        """
        Return the friction (n,) at a velocity v whose dry parts have these directions.

        `direction` (n,) in [-1, 1] is that of dry friction, `gear_direction` that of friction of
        gears and drives.
        """
        effort = self._at_joint.effort(v, 0.0, direction)
        if not self.has_gear_terms:
            return effort
        size = self.sigmoid + self.load_coefficient * np.abs(load)
        return effort + size * gear_direction

    @cached_property
    def tracking_width(self) -> FloatArray:
        """The width w (n,) [rad] or [m] of `tracking_effort` in position."""
        d = self.presliding_distance
        return np.where(d > 0.0, np.maximum(PRESLIDINGS * d, LEAST_WIDTH), UNKNOWN_WIDTH)

    def load_behind(
        self, v: FloatArray, effort: FloatArray, sign: FloatArray | None = None,
    ) -> FloatArray:
        """Return the load (..., n) of a joint effort minus friction, the inverse of `effort`."""
        left = effort - self.offset
        if self._dry:
            left = left - self.dry(v) * (np.sign(v) if sign is None else sign)
        smooth, per_load = self.smooth(v)
        left = left - smooth
        return left if per_load is None else left / (1.0 + per_load * np.sign(left))

    def without_dry(
        self, v: FloatArray, effort: FloatArray, direction: FloatArray | None = None,
    ) -> FloatArray:
        """
        Return the part of an effort (n,) for rigid bodies and dry friction at the velocity v.

        Dry friction of sliding joints counts as part of the effort that the gears transmit;
        `direction` (n,) is that of sliding, the sign of v if it is not given.
        """
        load = self.load_behind(v, effort, direction)
        sign = np.sign(v) if direction is None else direction
        return load + self.dry(v) * sign if self._dry else load

    def damping(self, v: FloatArray, load: FloatArray) -> FloatArray:
        """
        Return the viscous friction (..., n) that equals all smooth friction.

        It is F_v + (F_a + μ |load|) tanh(v / v_a) / v; at rest tanh(v / v_a) / v is 1 / v_a.
        """
        if self.is_linear:
            return self.viscous
        v = np.where(np.abs(v) < _SLOW, _SLOW, v)
        effort, per_load = self.smooth(v)
        return np.asarray((effort if per_load is None else effort + per_load * np.abs(load)) / v)

    @cached_property
    def _at_joint(self) -> 'JointFriction':
        """This friction without that of gears and drives."""
        return self.replaced(sigmoid=self._rest, load_coefficient=self._rest)


def _tracking_sign(ratio: FloatArray, offset: FloatArray) -> FloatArray:
    """Return the sign of a velocity, smooth around 0, plus an offset, within ±1."""
    return np.asarray(np.minimum(np.maximum(np.tanh(ratio) + offset, -1.0), 1.0))


def make_friction(
    joint_names: Sequence[str], viscous: npt.ArrayLike = (), coulomb: npt.ArrayLike = (),
    static: npt.ArrayLike = (), stribeck_velocity: npt.ArrayLike = (), offset: npt.ArrayLike = (),
    default: JointFriction | None = None, **further: npt.ArrayLike,
) -> JointFriction:
    """
    Return checked friction; each parameter is (n,), one number for all joints, or empty.

    `further` are other parameters, by their names in `FRICTION_FIELDS`. An empty parameter is that
    of `default`, or the default of the field, or 0; an empty `static` is `coulomb`. Raises
    InvalidInputError that names field, joint and value: for another number of values, a value
    outside its bounds, F_s < F_c, or |F_o| > F_c, which would create energy.
    """
    given = {'viscous': viscous, 'coulomb': coulomb, 'static': static,
             'stribeck_velocity': stribeck_velocity, 'offset': offset, **further}
    names = [field.name for field in FRICTION_FIELDS]
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise InvalidInputError(f'friction.{unknown[0]} is unknown, expected one of {names}')
    values: dict[str, FloatArray] = {}
    for field in FRICTION_FIELDS:
        otherwise = np.full(len(joint_names), field.default or 0.0)
        if field.follows and (default is None or not is_empty(given[field.follows])):
            otherwise = values[field.follows]
        elif default is not None:
            otherwise = getattr(default, field.name)
        values[field.name] = per_joint_values(
            f'friction.{field.name}', given.get(field.name, ()), joint_names, otherwise)
    for field in FRICTION_FIELDS:
        field.check(values, joint_names)
    for name, d in zip(joint_names, values['presliding_distance'].tolist()):
        if 0.0 < d < LEAST_PRESLIDING:
            raise InvalidInputError(
                f'friction.presliding_distance of {name!r} is {d:g}, expected 0 or at least '
                f'{LEAST_PRESLIDING:g}')
    return JointFriction(values)
