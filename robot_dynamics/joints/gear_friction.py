# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
What gears and drives add to friction, as identification finds it on real arms.

On top of `friction`, per joint, on the joint side of the gearbox:

    τ_g = (F_a + μ |τ_load|) tanh(v / v_a) + F_b

a sigmoid of width v_a in place of a sharp sign; a share μ of the load τ_load, what the joint bears
of rigid bodies, as teeth press harder on each other under load; and the constant F_b that measured
effort has, be it the sensor's offset or a difference between the directions, which no recording
can tell apart. Source: P. Hamon, M. Gautier, P. Garrec, "Dynamic identification of robots with a
dry friction model depending on load and velocity", IEEE/RSJ Int. Conf. Intelligent Robots and
Systems, 2010.

Coulomb friction does not change its sign at once either: where a motion turns round, the teeth and
bearings first yield over the presliding distance d (`presliding`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.parameter_field import ParameterField, per_joint_values
from robot_dynamics.validation import SMALLEST_DIVISOR

DEFAULT_SIGMOID_VELOCITY = 0.03
"""[rad/s] or [m/s]"""
LARGEST_LOAD_FRACTION = 0.95

GEAR_FRICTION_FIELDS = (
    ParameterField(
        'sigmoid', '[N m] or [N]', 0.0, 0.0, 1e6,
        'Friction F_a {unit} with a smooth sign, F_a tanh(v / v_a), likewise. Empty: {default:g}.',
        'sigmoid'),
    ParameterField(
        'sigmoid_velocity', '[rad/s] or [m/s]', DEFAULT_SIGMOID_VELOCITY, 1e-6, 1e3,
        'Velocity v_a {unit} over which that changes its sign. Empty: {default:g}.',
        'its velocity', ('sigmoid', 'load')),
    ParameterField(
        'load', '', 0.0, 0.0, LARGEST_LOAD_FRACTION,
        'Share of the load that friction takes, with the same smooth sign. Empty: {default:g}.',
        'load'),
    ParameterField(
        'effort_offset', '[N m] or [N]', 0.0, -1e6, 1e6,
        'What measured effort has at any velocity {unit}, of any size: an offset of sensor '
        'or drive. Empty: {default:g}.', 'offset'),
    ParameterField(
        'presliding_distance', '[rad] or [m]', 0.0, 0.0, 10.0,
        'Distance {unit} after a turn of the motion over which Coulomb friction changes its '
        'sign, if a whole motion is known; not in simulated_arm. Empty: {default:g}.',
        'presliding', ('coulomb',)),
)
"""The parameters of `GearFriction`, in its order."""


@dataclass(frozen=True, eq=False)
class GearFriction:
    """
    Friction of n gears and drives, each parameter (n,).

    `sigmoid` F_a [N·m] or [N], `sigmoid_velocity` v_a [rad/s] or [m/s], `load` μ in [0, 1),
    `effort_offset` F_b [N·m] or [N], `presliding_distance` d [rad] or [m] of Coulomb friction.
    """

    sigmoid: FloatArray
    sigmoid_velocity: FloatArray
    load: FloatArray
    effort_offset: FloatArray
    presliding_distance: FloatArray

    @property
    def is_zero(self) -> bool:
        """Tell whether it adds nothing, along any motion."""
        return not (self.sigmoid.any() or self.load.any() or self.effort_offset.any()
                    or self.presliding_distance.any())

    def effort(self, v: FloatArray, load: FloatArray) -> FloatArray:
        """
        Return what actuators must add at the velocity v, shape (..., n).

        `load` (..., n) is what the joints bear of rigid bodies: M a + C v + g − Jᵀ f.
        """
        direction = np.tanh(v / self.sigmoid_velocity)
        return np.asarray(
            (self.sigmoid + self.load * np.abs(load)) * direction + self.effort_offset)

    def damping(self, v: FloatArray, load: FloatArray) -> FloatArray:
        """
        Return the viscous friction (..., n) that is as large at the velocity v, but for F_b.

        It is (F_a + μ |load|) tanh(v / v_a) / v; at rest it is largest, the slope there.
        """
        ratio = v / self.sigmoid_velocity
        with np.errstate(invalid='ignore', divide='ignore'):
            mean_slope = np.where(np.abs(ratio) < 1e-4, 1.0, np.tanh(ratio) / ratio)
        return np.asarray(
            (self.sigmoid + self.load * np.abs(load)) * mean_slope / self.sigmoid_velocity)

    def load_of(self, v: FloatArray, effort: FloatArray) -> FloatArray:
        """Return the load (..., n) that a joint effort leaves after friction: the way back."""
        direction = np.tanh(v / self.sigmoid_velocity)
        passed = effort - self.sigmoid * direction - self.effort_offset
        return np.asarray(passed / (1.0 + self.load * direction * np.sign(passed)))


def make_gear_friction(
    joint_names: Sequence[str],
    sigmoid: Any = (),
    sigmoid_velocity: Any = (),
    load: Any = (),
    effort_offset: Any = (),
    presliding_distance: Any = (),
) -> GearFriction:
    """
    Return checked gear friction; each parameter is (n,), one value for all joints, or empty.

    Empty means none, and 0.03 for `sigmoid_velocity`. Raises InvalidInputError, naming field,
    joint and value, on another number of values, a negative one where there can be none, or μ
    beyond 0.95.
    """
    given = sigmoid, sigmoid_velocity, load, effort_offset, presliding_distance
    friction = GearFriction(*(
        per_joint_values(
            f'friction.{field.name}', value, joint_names, np.full(len(joint_names), field.default))
        for field, value in zip(GEAR_FRICTION_FIELDS, given, strict=True)))
    bad = {
        'sigmoid': (friction.sigmoid < 0.0, 'a number >= 0'),
        'sigmoid_velocity': (
            friction.sigmoid_velocity < SMALLEST_DIVISOR,
            f'a number > 0, at least {SMALLEST_DIVISOR:g}'),
        'load': (
            (friction.load < 0.0) | (friction.load > LARGEST_LOAD_FRACTION),
            f'a number in [0, {LARGEST_LOAD_FRACTION:g}]'),
        'presliding_distance': (friction.presliding_distance < 0.0, 'a number >= 0'),
    }
    for field, (wrong, expected) in bad.items():
        if wrong.any():
            joint = int(np.argmax(wrong))
            raise InvalidInputError(
                f'friction.{field} of {joint_names[joint]!r} is '
                f'{getattr(friction, field)[joint]:g}, expected {expected}')
    return friction
