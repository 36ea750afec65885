# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction at the joints, on the joint side of the gearbox.

    τ_f = F_v v + [F_c + (F_s − F_c) exp(−(v/v_s)²)] sgn v + F_o
        + (F_a + μ |τ_load|) tanh(v/v_a) + F_b

The first line is viscous friction, Coulomb friction with the Stribeck effect, and an offset by
which friction differs between the two directions. At rest, dry friction has any value up to F_s
that holds the joint (`stiction`). The second line is the friction of gears and drives, as
identification determines it: a sigmoid of width v_a; a fraction μ of the load
τ_load = M a + C v + g − Jᵀ f, because the load increases the contact forces of the teeth; and the
constant F_b of a sensor or drive. After a velocity reversal, Coulomb friction changes its sign
over the presliding distance d
(`presliding`). Sources: B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7),
1994, sections 2 and 3 (Stribeck's curve in the Gaussian form); B. Siciliano et al., *Robotics*,
Springer 2009, section 7.3; P. Hamon, M. Gautier, P. Garrec, "Dynamic identification of robots with
a dry friction model depending on load and velocity", IEEE/RSJ IROS 2010.

A new friction parameter is a field of `JointFriction`, an entry of `FRICTION_FIELDS` and a term of
`effort`, `load_behind`, `sliding` and `damping`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.parameter_field import ParameterField, per_joint_values
from robot_dynamics.validation import SMALLEST_DIVISOR

SMOOTHING_VELOCITY = 0.01
"""Velocity [rad/s] or [m/s] over which the smooth sign of dry friction changes."""
PRESLIDINGS = 5.0
"""Width of the compensation of an error at rest, in presliding distances (`tracking_effort`)."""
UNKNOWN_WIDTH, LEAST_WIDTH = 0.025, 0.005
"""[rad] or [m] of this width, without a presliding distance and at least."""
DEFAULT_STRIBECK_VELOCITY = 0.05
"""[rad/s] or [m/s]"""
DEFAULT_SIGMOID_VELOCITY = 0.03
"""[rad/s] or [m/s]"""
LARGEST_LOAD_FRACTION = 0.95

FRICTION_FIELDS = (
    ParameterField(
        'viscous', '[N m s/rad] or [N s/m]', None, 0.0, 1e6,
        'Viscous friction F_v {unit}; one value for all joints or one per joint. If empty, the '
        'damping in the URDF.', 'viscous'),
    ParameterField(
        'coulomb', '[N m] or [N]', None, 0.0, 1e6,
        'Coulomb friction F_c {unit}; one value for all joints or one per joint. If empty, the '
        'friction in the URDF.', 'Coulomb'),
    ParameterField(
        'static', '[N m] or [N]', None, 0.0, 1e6,
        'Static friction F_s {unit}, up to which a joint sticks; at least F_c. One value for all '
        'joints or one per joint. If empty, F_c.'),
    ParameterField(
        'stribeck_velocity', '[rad/s] or [m/s]', DEFAULT_STRIBECK_VELOCITY, 1e-6, 1e3,
        'Stribeck velocity v_s {unit}, over which friction decreases from F_s to F_c; one value '
        'for all joints or one per joint. If empty, {default:g}.'),
    ParameterField(
        'offset', '[N m] or [N]', 0.0, -1e6, 1e6,
        'Direction-dependent part F_o {unit} of the Coulomb friction; its absolute value is at '
        'most F_c. One value for all joints or one per joint. If empty, {default:g}.'),
    ParameterField(
        'sigmoid', '[N m] or [N]', 0.0, 0.0, 1e6,
        'Friction F_a {unit} with a smooth sign, F_a tanh(v / v_a); one value for all joints or '
        'one per joint. If empty, {default:g}.',
        'sigmoid'),
    ParameterField(
        'sigmoid_velocity', '[rad/s] or [m/s]', DEFAULT_SIGMOID_VELOCITY, 1e-6, 1e3,
        'Velocity v_a {unit} over which the friction F_a changes its sign; one value for all '
        'joints or one per joint. If empty, {default:g}.',
        'sigmoid velocity', ('sigmoid', 'load')),
    ParameterField(
        'load', '', 0.0, 0.0, LARGEST_LOAD_FRACTION,
        'Load-dependent friction coefficient: friction effort per unit of load effort, with the '
        'same smooth sign. One value for all joints or one per joint. If empty, {default:g}.',
        'load'),
    ParameterField(
        'effort_offset', '[N m] or [N]', 0.0, -1e6, 1e6,
        'Constant offset {unit} of the measured effort (sensor or drive bias); one value for all '
        'joints or one per joint. If empty, {default:g}.', 'offset'),
    ParameterField(
        'presliding_distance', '[rad] or [m]', 0.0, 0.0, 10.0,
        'Distance {unit} over which dry friction yields like a spring before it slides: after a '
        'velocity reversal it changes its sign over twice this distance. It acts in simulated_arm '
        'and where the whole motion is known, and sets the width of friction compensation. One '
        'value for all joints or one per joint. If empty, {default:g}.',
        'presliding', ('coulomb',)),
)
"""The parameters of `JointFriction`, in its order."""


@dataclass(frozen=True, eq=False)
class JointFriction:
    """
    Friction of n joints, each parameter (n,).

    `viscous` F_v [N·m·s/rad] or [N·s/m]; `coulomb` F_c, `static` F_s ≥ F_c and `offset` F_o with
    |F_o| ≤ F_c, all [N·m] or [N]; `stribeck_velocity` v_s [rad/s] or [m/s]. Of gears and drives:
    `sigmoid` F_a [N·m] or [N], `sigmoid_velocity` v_a [rad/s] or [m/s], `load` μ in [0, 1),
    `effort_offset` F_b [N·m] or [N], `presliding_distance` d [rad] or [m].
    """

    viscous: FloatArray
    coulomb: FloatArray
    static: FloatArray
    stribeck_velocity: FloatArray
    offset: FloatArray
    sigmoid: FloatArray
    sigmoid_velocity: FloatArray
    load: FloatArray
    effort_offset: FloatArray
    presliding_distance: FloatArray

    @cached_property
    def has_stribeck_effect(self) -> bool:
        """Whether any joint needs more effort to break away than to continue sliding."""
        return bool((self.static > self.coulomb).any())

    @cached_property
    def is_viscous(self) -> bool:
        """Whether there is only viscous friction, or no friction."""
        return not (self.is_dry or self.coulomb.any() or self.offset.any() or self.has_gear_terms)

    @cached_property
    def is_dry(self) -> bool:
        """Whether any joint has dry friction."""
        return bool(self.static.any())

    @cached_property
    def has_gear_terms(self) -> bool:
        """Whether any joint has friction of gears and drives."""
        return bool(self.sigmoid.any() or self.load.any() or self.effort_offset.any())

    @cached_property
    def is_zero(self) -> bool:
        """Whether there is no friction."""
        return self.is_viscous and not self.viscous.any()

    @property
    def at_rest(self) -> 'JointFriction':
        """The friction with all terms that may hold a joint at rest as static and offset."""
        nothing = np.zeros_like(self.static)
        return JointFriction(
            self.viscous, self.coulomb, self.static + self.sigmoid, self.stribeck_velocity,
            np.abs(self.offset) + np.abs(self.effort_offset), nothing, self.sigmoid_velocity,
            nothing, nothing, nothing)

    def dry(self, v: FloatArray) -> FloatArray:
        """Return the magnitude of dry friction of a joint that slides at v, (..., n) or (n,)."""
        if not self.has_stribeck_effect:
            return self.coulomb
        ratio = v / self.stribeck_velocity
        return np.asarray(self.coulomb + (self.static - self.coulomb) * np.exp(-ratio * ratio))

    def effort(
        self, v: FloatArray, load: FloatArray | float = 0.0, sign: FloatArray | None = None,
    ) -> FloatArray:
        """
        Return what actuators must add to overcome friction at the velocity v, shape (..., n).

        `load` (..., n) is the effort of the rigid bodies, M a + C v + g − Jᵀ f. Dry friction has
        the sign of v, 0 at rest, or `sign` (..., n) if it is given.
        """
        effort = self._joint_effort(v, sign)
        if not self.has_gear_terms:
            return effort
        return effort + (self._gear_size(load) * smooth_sign(v, self.sigmoid_velocity)
                         + self.effort_offset)

    def smooth_effort(
        self, v: FloatArray, load: FloatArray | float = 0.0,
        smoothing_velocity: float = SMOOTHING_VELOCITY,
    ) -> FloatArray:
        """
        Return the effort with tanh(v / smoothing_velocity) instead of the sign, (..., n).

        It is used by control laws, whose effort must not chatter around rest, and by the
        identification, in which the sign of a noisy velocity has no meaning.
        """
        return self.effort(v, load, smooth_sign(v, smoothing_velocity))

    def tracking_effort(
        self, v: FloatArray, error: FloatArray, rate: FloatArray | float = 0.0,
        load: FloatArray | float = 0.0,
        bounds: tuple[FloatArray | float, FloatArray | float] = (-1.0, 1.0),
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

        `bounds` are the smallest and largest sign of dry friction, within ±1 (`FrictionOnset`).
        """
        pull = self.viscous * rate * error
        if self.is_viscous:
            return np.asarray(self.viscous * v + pull)
        offset = error / self.tracking_width
        effort = pull + self._joint_effort(
            v, _tracking_sign(v / SMOOTHING_VELOCITY, offset, bounds))
        if not self.has_gear_terms:
            return effort
        sign = _tracking_sign(v / self.sigmoid_velocity, offset, bounds)
        return effort + (self._gear_size(load) * sign + self.effort_offset)

    @cached_property
    def tracking_width(self) -> FloatArray:
        """The width w (n,) [rad] or [m] of `tracking_effort` in position."""
        d = self.presliding_distance
        return np.where(d > 0.0, np.maximum(PRESLIDINGS * d, LEAST_WIDTH), UNKNOWN_WIDTH)

    def load_behind(
        self, v: FloatArray, effort: FloatArray, sign: FloatArray | None = None,
    ) -> FloatArray:
        """Return the load (..., n) of a joint effort minus friction, the inverse of `effort`."""
        return self._load_behind_gears(v, effort - self._joint_effort(v, sign))

    def without_dry(
        self, v: FloatArray, effort: FloatArray, direction: FloatArray | None = None,
    ) -> FloatArray:
        """
        Return the part of an effort (n,) for rigid bodies and dry friction at the velocity v.

        Dry friction of sliding joints counts as part of the effort that the gears transmit;
        `direction` (n,) is that of sliding, the sign of v if it is not given.
        """
        left = effort - self.viscous * v - self.offset
        if not self.has_gear_terms:
            return left
        transmitted = left - self.dry(v) * (np.sign(v) if direction is None else direction)
        return left - transmitted + self._load_behind_gears(v, transmitted)

    def sliding(
        self, effort: FloatArray, direction: FloatArray, is_stribeck_active: bool,
    ) -> Callable[[FloatArray], FloatArray]:
        """
        Return the load behind a constant effort (n,), as a function of the velocity (..., n).

        Dry friction has the `direction` (n,) of sliding, 0 for joints that do not slide,
        independent of the sign of the velocity. Without `is_stribeck_active` it is F_c.
        """
        base, F_v = effort - self.offset, self.viscous
        if not (self.is_dry or F_v.any()):
            return lambda v: self._load_behind_gears(v, base)
        base = base - direction * self.coulomb
        rise, rate = direction * (self.static - self.coulomb), 1.0 / self.stribeck_velocity

        def load(v: FloatArray) -> FloatArray:
            left = base - F_v * v
            if is_stribeck_active:
                ratio = v * rate
                left = left - rise * np.exp(-ratio * ratio)
            return self._load_behind_gears(v, left)

        return load

    def damping(self, v: FloatArray, load: FloatArray) -> FloatArray:
        """
        Return the viscous friction (..., n) that equals all smooth friction except F_b.

        It is F_v + (F_a + μ |load|) tanh(v / v_a) / v; at rest tanh(v / v_a) / v is 1 / v_a.
        """
        if not self.has_gear_terms:
            return self.viscous
        ratio = v / self.sigmoid_velocity
        with np.errstate(invalid='ignore', divide='ignore'):
            mean_slope = np.where(np.abs(ratio) < 1e-4, 1.0, np.tanh(ratio) / ratio)
        return np.asarray(
            self.viscous + self._gear_size(load) * mean_slope / self.sigmoid_velocity)

    def _joint_effort(self, v: FloatArray, sign: FloatArray | None) -> FloatArray:
        """Return the first line of the law."""
        if not (self.is_dry or self.offset.any()):
            return np.asarray(self.viscous * v)
        direction = np.sign(v) if sign is None else sign
        return np.asarray(self.viscous * v + self.dry(v) * direction + self.offset)

    def _gear_size(self, load: FloatArray | float) -> FloatArray:
        return np.asarray(self.sigmoid + self.load * np.abs(load))

    def _load_behind_gears(self, v: FloatArray, effort: FloatArray) -> FloatArray:
        """Return the load that an effort leaves after the second line of the law."""
        if not self.has_gear_terms:
            return effort
        direction = smooth_sign(v, self.sigmoid_velocity)
        left = effort - self.sigmoid * direction - self.effort_offset
        return np.asarray(left / (1.0 + self.load * direction * np.sign(left)))


def smooth_sign(v: FloatArray, smoothing_velocity: FloatArray | float) -> FloatArray:
    """Return 2 / (1 + exp(−2 v / v_0)) − 1 = tanh(v / v_0): the sign of v, smooth around 0."""
    return np.asarray(np.tanh(v / smoothing_velocity))


def _tracking_sign(
    ratio: FloatArray, offset: FloatArray,
    bounds: tuple[FloatArray | float, FloatArray | float],
) -> FloatArray:
    """Return the sign of a velocity, smooth around 0, plus an offset, within bounds."""
    return np.asarray(np.minimum(np.maximum(np.tanh(ratio) + offset, bounds[0]), bounds[1]))


def make_friction(
    joint_names: Sequence[str],
    viscous: Any = (),
    coulomb: Any = (),
    static: Any = (),
    stribeck_velocity: Any = (),
    offset: Any = (),
    default: JointFriction | None = None,
    **gears: Any,
) -> JointFriction:
    """
    Return checked friction; each parameter is (n,), one value for all joints, or empty.

    `gears` are the parameters of gears and drives, by their names in `FRICTION_FIELDS`. An empty
    parameter is that of `default`, or the default of the field, or 0; an empty `static` is
    `coulomb`. Raises InvalidInputError that names field, joint and value: for another number of
    values, a value outside its bounds, F_s < F_c, or |F_o| > F_c, which would create energy.
    """
    given = {'viscous': viscous, 'coulomb': coulomb, 'static': static,
             'stribeck_velocity': stribeck_velocity, 'offset': offset, **gears}
    names = [field.name for field in FRICTION_FIELDS]
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise InvalidInputError(f'friction.{unknown[0]} is unknown, expected one of {names}')
    values: dict[str, FloatArray] = {}
    for field in FRICTION_FIELDS:
        otherwise = np.full(len(joint_names), field.default or 0.0)
        if default is not None:
            otherwise = getattr(default, field.name)
        if field.name == 'static' and (default is None or len(coulomb)):
            otherwise = values['coulomb']
        values[field.name] = per_joint_values(
            f'friction.{field.name}', given.get(field.name, ()), joint_names, otherwise)
    friction = JointFriction(**values)
    _check(joint_names, friction)
    return friction


def _check(joint_names: Sequence[str], friction: JointFriction) -> None:
    """Raise InvalidInputError for a value outside its bounds."""
    F_c = friction.coulomb
    expected = {
        'viscous': (friction.viscous >= 0.0, 'a number >= 0'),
        'coulomb': (F_c >= 0.0, 'a number >= 0'),
        'static': (friction.static >= F_c, 'at least friction.coulomb of that joint'),
        'stribeck_velocity': (
            friction.stribeck_velocity >= SMALLEST_DIVISOR,
            f'a number > 0, at least {SMALLEST_DIVISOR:g}'),
        'offset': (
            np.abs(friction.offset) <= F_c,
            'at most friction.coulomb of that joint in size, or friction would create energy'),
        'sigmoid': (friction.sigmoid >= 0.0, 'a number >= 0'),
        'sigmoid_velocity': (
            friction.sigmoid_velocity >= SMALLEST_DIVISOR,
            f'a number > 0, at least {SMALLEST_DIVISOR:g}'),
        'load': (
            (friction.load >= 0.0) & (friction.load <= LARGEST_LOAD_FRACTION),
            f'a number in [0, {LARGEST_LOAD_FRACTION:g}]'),
        'presliding_distance': (friction.presliding_distance >= 0.0, 'a number >= 0'),
    }
    for field, (is_valid, words) in expected.items():
        if not is_valid.all():
            joint = int(np.argmin(is_valid))
            raise InvalidInputError(
                f'friction.{field} of {joint_names[joint]!r} is '
                f'{getattr(friction, field)[joint]:g}, expected {words}')
