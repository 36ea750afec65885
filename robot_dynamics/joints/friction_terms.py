# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The terms of friction: everything that the package knows about each of them.

    τ_f = D(v) sgn v + S(v) + c + L(v) |τ_load|

A term has some of these parts: the magnitude D of dry friction, which also holds a joint at rest;
smooth friction S, an odd function of the velocity; a constant c; and friction L per load. The sums
of the parts are the friction of a joint (`friction`). Model, simulation, identification, deviation
of the effort, MJCF and parameters of the nodes iterate over `TERMS`: a new term is a class here.

Sources: B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7), 1994, sections 2
and 3 (Stribeck's curve in the Gaussian form); B. Siciliano et al., *Robotics*, Springer 2009,
section 7.3; P. Hamon, M. Gautier, P. Garrec, "Dynamic identification of robots with a dry friction
model depending on load and velocity", IEEE/RSJ IROS 2010.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.parameter_field import ParameterField
from robot_dynamics.validation import SMALLEST_DIVISOR

VISCOUS_FRICTION, DRY_FRICTION, OFFSET_EFFORT = 'viscous friction', 'dry friction', 'offset'
"""Kinds of terms, which a recording may be unable to separate."""
LARGEST_LOAD_FRACTION = 0.95
_EFFORT, _VELOCITY = '[N m] or [N]', '[rad/s] or [m/s]'
_STRIBECK_RANGE = 4.0
"""Multiple of v_s beyond which friction no longer falls: exp(−4²) is 1e-7."""
_SIGMOID_RANGE = 9.0
"""Multiple of v_a beyond which friction of gears no longer rises: 1 − tanh 9 is 3e-8."""


@dataclass(frozen=True, eq=False)
class FrictionTerm:
    """A term of the friction of n joints; its parameters are (n,), its parts (..., n) or (n,)."""

    FIELDS: ClassVar[tuple[ParameterField, ...]]
    KIND: ClassVar[str]

    def dry(self, v: FloatArray) -> FloatArray:
        """Return the magnitude of dry friction of a joint that slides at v."""
        return np.zeros_like(v)

    def smooth(self, v: FloatArray) -> FloatArray:
        """Return the friction that is a smooth and odd function of v."""
        return np.zeros_like(v)

    def per_load(self, v: FloatArray) -> FloatArray:
        """Return the friction per unit of |load|, smooth and odd like `smooth`."""
        return np.zeros_like(v)

    @property
    def constant(self) -> FloatArray:
        """The part that does not depend on the velocity."""
        return np.zeros(1)

    @property
    def at_rest(self) -> FloatArray:
        """The magnitude of the effort that can hold a joint at rest."""
        return self.dry(np.zeros(1))

    @property
    def steep_below(self) -> FloatArray:
        """The speed [rad/s] or [m/s] below which the term changes fast with the speed."""
        return np.zeros(1)

    def defects(self) -> Iterator[tuple[str, BoolArray, str]]:
        """Yield parameters with the validity (n,) of their values, and what is expected."""
        for field in self.FIELDS:
            value, low, high = getattr(self, field.name), 0.0, np.inf
            expected = 'a number >= 0'
            if field.minimum < 0.0:
                low = -np.inf
            elif field.minimum > 0.0:
                low = SMALLEST_DIVISOR
                expected = f'a number > 0, at least {low:g}'
            elif field.maximum < 1.0:
                high = field.maximum
                expected = f'a number in [0, {high:g}]'
            yield field.name, (value >= low) & (value <= high), expected


@dataclass(frozen=True, eq=False)
class Viscous(FrictionTerm):
    """Viscous friction F_v v."""

    viscous: FloatArray

    KIND = VISCOUS_FRICTION
    FIELDS = (
        ParameterField(
            'viscous', '[N m s/rad] or [N s/m]', None, 0.0, 1e6, 'Viscous friction F_v {unit}',
            'viscous', otherwise='the damping in the URDF', counterpart='damping'),
    )

    def smooth(self, v: FloatArray) -> FloatArray:
        """Return F_v v."""
        return self.viscous * v


@dataclass(frozen=True, eq=False)
class Dry(FrictionTerm):
    """
    Coulomb friction with the Stribeck effect: [F_c + (F_s − F_c) exp(−(v/v_s)²)] sgn v + F_o.

    F_o is the difference between the two directions. At rest, friction has any value up to F_s
    that holds the joint (`stiction`). After a reversal it changes its sign over the distance d
    (`presliding`).
    """

    coulomb: FloatArray
    static: FloatArray
    stribeck_velocity: FloatArray
    offset: FloatArray
    presliding_distance: FloatArray

    KIND = DRY_FRICTION
    FIELDS = (
        ParameterField(
            'coulomb', _EFFORT, None, 0.0, 1e6, 'Coulomb friction F_c {unit}', 'Coulomb',
            otherwise='the friction in the URDF', counterpart='friction'),
        ParameterField(
            'static', _EFFORT, None, 0.0, 1e6,
            'Static friction F_s {unit}, up to which a joint sticks, at least F_c',
            otherwise='F_c', follows='coulomb', omitted='the static friction F_s'),
        ParameterField(
            'stribeck_velocity', _VELOCITY, 0.05, 1e-6, 1e3,
            'Stribeck velocity v_s {unit}, over which friction decreases from F_s to F_c',
            needs=('static',)),
        ParameterField(
            'offset', _EFFORT, 0.0, -1e6, 1e6,
            'Direction-dependent part F_o {unit} of the Coulomb friction, at most F_c in size',
            omitted='the offset F_o'),
        ParameterField(
            'presliding_distance', '[rad] or [m]', 0.0, 0.0, 10.0,
            'Distance {unit} over which dry friction yields like a spring before it slides: after '
            'a velocity reversal it changes its sign over twice this distance. It acts in '
            'simulated_arm and where the whole motion is known, and sets the width of friction '
            'compensation', 'presliding', ('coulomb',),
            # without presliding the sign of a measured velocity would be meaningless around rest:
            # 0 is no candidate, but the column for single states
            candidates=(0.0, 0.001, 0.003, 0.01, 0.03), omitted='the presliding distance'),
    )

    @cached_property
    def _has_stribeck_effect(self) -> bool:
        return bool((self.static > self.coulomb).any())

    def dry(self, v: FloatArray) -> FloatArray:
        """Return F_c + (F_s − F_c) exp(−(v/v_s)²)."""
        if not self._has_stribeck_effect:
            return self.coulomb
        ratio = v / self.stribeck_velocity
        return np.asarray(self.coulomb + (self.static - self.coulomb) * np.exp(-ratio * ratio))

    @property
    def constant(self) -> FloatArray:
        """F_o."""
        return self.offset

    @property
    def at_rest(self) -> FloatArray:
        """F_s."""
        return self.static

    @property
    def steep_below(self) -> FloatArray:
        """The speed up to which the Stribeck effect matters."""
        return np.where(self.static > self.coulomb, _STRIBECK_RANGE * self.stribeck_velocity, 0.0)

    def defects(self) -> Iterator[tuple[str, BoolArray, str]]:
        """Yield also F_s < F_c, and |F_o| > F_c, which would create energy."""
        yield from super().defects()
        yield 'static', self.static >= self.coulomb, 'at least friction.coulomb of that joint'
        yield ('offset', np.abs(self.offset) <= self.coulomb, 'at most friction.coulomb of that '
               'joint in size, or friction would create energy')


@dataclass(frozen=True, eq=False)
class Gears(FrictionTerm):
    """
    Friction of gears, (F_a + μ |τ_load|) tanh(v/v_a).

    The load, M a + C v + g − Jᵀ f, increases the contact forces of the teeth.
    """

    sigmoid: FloatArray
    sigmoid_velocity: FloatArray
    load: FloatArray

    KIND = DRY_FRICTION
    FIELDS = (
        ParameterField(
            'sigmoid', _EFFORT, 0.0, 0.0, 1e6,
            'Friction F_a {unit} with a smooth sign, F_a tanh(v / v_a)', 'sigmoid',
            counterpart='friction', omitted='the width of the sigmoid F_a'),
        ParameterField(
            'sigmoid_velocity', _VELOCITY, 0.03, 1e-6, 1e3,
            'Velocity v_a {unit} over which the friction F_a changes its sign',
            'sigmoid velocity', ('sigmoid', 'load'), candidates=(0.01, 0.03, 0.1, 0.3)),
        ParameterField(
            'load', '', 0.0, 0.0, LARGEST_LOAD_FRACTION,
            'Load-dependent friction coefficient: friction effort per unit of load effort, with '
            'the same smooth sign', 'load', omitted='the load-dependent friction'),
    )

    def smooth(self, v: FloatArray) -> FloatArray:
        """Return F_a tanh(v/v_a)."""
        return self.sigmoid * smooth_sign(v, self.sigmoid_velocity)

    def per_load(self, v: FloatArray) -> FloatArray:
        """Return μ tanh(v/v_a)."""
        return self.load * smooth_sign(v, self.sigmoid_velocity)

    @property
    def at_rest(self) -> FloatArray:
        """F_a, under which a joint creeps."""
        return self.sigmoid

    @property
    def steep_below(self) -> FloatArray:
        """The speed up to which the sigmoid rises."""
        return np.where(
            (self.sigmoid > 0.0) | (self.load > 0.0), _SIGMOID_RANGE * self.sigmoid_velocity, 0.0)


@dataclass(frozen=True, eq=False)
class EffortOffset(FrictionTerm):
    """The constant F_b of a sensor or drive."""

    effort_offset: FloatArray

    KIND = OFFSET_EFFORT
    FIELDS = (
        ParameterField(
            'effort_offset', _EFFORT, 0.0, -1e6, 1e6,
            'Constant offset {unit} of the measured effort (sensor or drive bias)', 'offset',
            omitted='the effort offset F_b'),
    )

    @property
    def constant(self) -> FloatArray:
        """F_b."""
        return self.effort_offset


TERMS: tuple[type[FrictionTerm], ...] = (Viscous, Dry, Gears, EffortOffset)


def smooth_sign(v: FloatArray, smoothing_velocity: FloatArray | float) -> FloatArray:
    """Return 2 / (1 + exp(−2 v / v_0)) − 1 = tanh(v / v_0): the sign of v, smooth around 0."""
    return np.asarray(np.tanh(v / smoothing_velocity))
