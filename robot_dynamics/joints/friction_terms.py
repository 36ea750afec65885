# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The terms of friction: everything that the package knows about each of them.

    τ_f = D(v) sgn v + (F + μ |τ_load|) s(v) + F_o

A term has some of these parts: the magnitude D of dry friction, which also holds a joint at rest,
and smooth friction of the shape s, an odd function of the velocity. F_o is the offset of dry
friction. `friction` adds up the terms. Model, simulation, identification, deviation of the effort,
export and parameters of the nodes iterate over `TERMS`: a new term is an object here.

Sources: B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7), 1994, sections 2
and 3 (Stribeck's curve in the Gaussian form); B. Siciliano et al., *Robotics*, Springer 2009,
section 7.3; P. Hamon, M. Gautier, P. Garrec, "Dynamic identification of robots with a dry friction
model depending on load and velocity", IEEE/RSJ IROS 2010.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.parameter_field import ParameterField

VISCOUS_FRICTION, DRY_FRICTION = 'viscous friction', 'dry friction'
"""Kinds of terms, which a recording may be unable to separate."""
LARGEST_LOAD_FRACTION = 0.95
_EFFORT, _VELOCITY = '[N·m] or [N]', '[rad/s] or [m/s]'

Part = Callable[[Any, FloatArray], FloatArray]
"""A part of the parameters, which are attributes (n,), and the velocity (..., n)."""


class FrictionTerm(NamedTuple):
    """
    A term of friction: its kind, its parameters, and its parts.

    `dry` is D and `shape` is s. `size` and `per_load` name the parameters F and μ.
    """

    kind: str
    fields: tuple[ParameterField, ...]
    dry: Part | None = None
    shape: Part | None = None
    size: str = ''
    per_load: str = ''


def smooth_sign(v: FloatArray, smoothing_velocity: FloatArray | float) -> FloatArray:
    """Return 2 / (1 + exp(−2 v / v_0)) − 1 = tanh(v / v_0): the sign of v, smooth around 0."""
    return np.asarray(np.tanh(v / smoothing_velocity))


def stribeck_curve(v: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return exp(−(v/v_s)²), which decreases from 1 to 0."""
    return np.asarray(np.exp(-np.square(v / velocity)))


VISCOUS = FrictionTerm(VISCOUS_FRICTION, (
    ParameterField(
        'viscous', '[N·m·s/rad] or [N·s/m]', None, 0.0, 1e6, 'Viscous friction F_v {unit}',
        'viscous', otherwise='the damping in the URDF', counterpart='damping'),
), shape=lambda f, v: v, size='viscous')

DRY = FrictionTerm(DRY_FRICTION, (
    ParameterField(
        'coulomb', _EFFORT, None, 0.0, 1e6, 'Coulomb friction F_c {unit}', 'Coulomb',
        otherwise='the friction in the URDF', counterpart='friction'),
    ParameterField(
        'static', _EFFORT, None, 0.0, 1e6,
        'Static friction F_s {unit}, up to which a joint sticks, at least F_c',
        otherwise='F_c', follows='coulomb', omitted='the static friction F_s'),
    ParameterField(  # 4 v_s: exp(−4²) is 1e-7
        'stribeck_velocity', _VELOCITY, 0.05, 1e-6, 1e3,
        'Stribeck velocity v_s {unit}, over which friction decreases from F_s to F_c',
        needs=('static',), range=4.0),
    ParameterField(
        'offset', _EFFORT, 0.0, -1e6, 1e6,
        'Direction-dependent part F_o {unit} of the Coulomb friction, at most F_c in size',
        within='coulomb', omitted='the offset F_o'),
    ParameterField(  # 0 is no candidate: a measured velocity has no meaningful sign around rest
        'presliding_distance', '[rad] or [m]', 0.0, 0.0, 10.0,
        'Distance {unit} over which dry friction yields like a spring before it slides: after a '
        'velocity reversal it changes its sign over twice this distance. It acts in '
        'simulated_arm and where the whole motion is known, and sets the width of friction '
        'compensation', 'presliding', ('coulomb',),
        candidates=(0.0, 0.001, 0.003, 0.01, 0.03), omitted='the presliding distance'),
), dry=lambda f, v: f.coulomb if f.static is f.coulomb else (
    f.coulomb + (f.static - f.coulomb) * stribeck_curve(v, f.stribeck_velocity)))

GEARS = FrictionTerm(DRY_FRICTION, (
    ParameterField(
        'sigmoid', _EFFORT, 0.0, 0.0, 1e6,
        'Friction F_a {unit} with a smooth sign, F_a tanh(v / v_a)', 'sigmoid',
        counterpart='friction', omitted='the width of the sigmoid F_a'),
    ParameterField(  # 9 v_a: 1 − tanh 9 is 3e-8
        'sigmoid_velocity', _VELOCITY, 0.03, 1e-6, 1e3,
        'Velocity v_a {unit} over which the friction F_a changes its sign',
        'sigmoid velocity', ('sigmoid', 'load_coefficient'), range=9.0,
        candidates=(0.01, 0.03, 0.1, 0.3)),
    ParameterField(
        'load_coefficient', '', 0.0, 0.0, LARGEST_LOAD_FRACTION,
        'Load-dependent friction coefficient: friction effort per unit of load effort, with the '
        'same smooth sign', 'load', omitted='the load-dependent friction'),
), shape=lambda f, v: smooth_sign(v, f.sigmoid_velocity), size='sigmoid',
    per_load='load_coefficient')

TERMS = (VISCOUS, DRY, GEARS)
