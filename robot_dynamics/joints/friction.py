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
Friction at the joints, on the joint side of the gearbox.

τ_f(v) = F_v v + [F_c + (F_s − F_c) exp(−(v/v_s)²)] sgn v + F_o: viscous friction, Coulomb friction
with the Stribeck effect, and an offset that makes it differ between the two directions. At rest,
dry friction takes whatever value up to F_s holds the joint (`stiction`). Sources: B. Armstrong-
Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7), 1994, sections 2 and 3 (Stribeck's curve
in the Gaussian form); B. Siciliano et al., *Robotics*, Springer 2009, section 7.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.parameter_field import ParameterField, per_joint_values
from robot_dynamics.validation import SMALLEST_DIVISOR

SMOOTHING_VELOCITY = 0.01
"""[rad/s] or [m/s] over which `smooth_effort` changes its sign."""
DEFAULT_STRIBECK_VELOCITY = 0.05
"""[rad/s] or [m/s]"""

FRICTION_FIELDS = (
    ParameterField(
        'viscous', '[N m s/rad] or [N s/m]', None, 0.0, 1e6,
        'Viscous friction F_v {unit}, one a joint or one for all. Empty: the '
        'damping of the URDF.', 'viscous'),
    ParameterField(
        'coulomb', '[N m] or [N]', None, 0.0, 1e6,
        'Coulomb friction F_c {unit}, likewise. Empty: the friction of the URDF.',
        'Coulomb'),
    ParameterField(
        'static', '[N m] or [N]', None, 0.0, 1e6,
        'Static friction F_s {unit}, up to which a joint sticks; at least F_c. Empty: F_c.'),
    ParameterField(
        'stribeck_velocity', '[rad/s] or [m/s]', DEFAULT_STRIBECK_VELOCITY, 1e-6, 1e3,
        'Velocity v_s {unit} over which friction falls from F_s to F_c. Empty: {default:g}.'),
    ParameterField(
        'offset', '[N m] or [N]', 0.0, -1e6, 1e6,
        'Offset F_o {unit} by which friction differs between the directions; at most F_c '
        'in size. Empty: {default:g}.'),
)
"""The parameters of `JointFriction`, in its order."""


@dataclass(frozen=True, eq=False)
class JointFriction:
    """
    Friction of n joints, each parameter (n,).

    `viscous` F_v [N·m·s/rad] or [N·s/m]; `coulomb` F_c, `static` F_s ≥ F_c and `offset` F_o with
    |F_o| ≤ F_c, all [N·m] or [N]; `stribeck_velocity` v_s [rad/s] or [m/s].
    """

    viscous: FloatArray
    coulomb: FloatArray
    static: FloatArray
    stribeck_velocity: FloatArray
    offset: FloatArray

    @cached_property
    def has_stribeck_effect(self) -> bool:
        """Tell whether any joint needs more effort to break away than to slide on."""
        return bool((self.static > self.coulomb).any())

    @cached_property
    def is_viscous(self) -> bool:
        """Tell whether there is viscous friction alone, or none."""
        return not (self.coulomb.any() or self.static.any() or self.offset.any())

    @cached_property
    def is_zero(self) -> bool:
        """Tell whether there is no friction."""
        return self.is_viscous and not self.viscous.any()

    def dry(self, v: FloatArray) -> FloatArray:
        """Return the size of dry friction while a joint slides at v, shape (..., n) or (n,)."""
        if not self.has_stribeck_effect:
            return self.coulomb
        ratio = v / self.stribeck_velocity
        return np.asarray(self.coulomb + (self.static - self.coulomb) * np.exp(-ratio * ratio))

    def effort(self, v: FloatArray, sign: FloatArray | None = None) -> FloatArray:
        """
        Return what actuators must add to overcome friction at the velocity v, shape (..., n).

        Dry friction has the sign of v, 0 at rest, or `sign` (..., n) if it is given.
        """
        if self.is_viscous:
            return np.asarray(self.viscous * v)
        direction = np.sign(v) if sign is None else sign
        return np.asarray(self.viscous * v + self.dry(v) * direction + self.offset)

    def smooth_effort(
        self, v: FloatArray, smoothing_velocity: float = SMOOTHING_VELOCITY,
    ) -> FloatArray:
        """
        Return the same with the sigmoid tanh(v / smoothing_velocity) for the sign, (..., n).

        For a control law, whose effort must not chatter between two signs around rest, and for
        identification, where the sign of a noisy velocity says nothing.
        """
        return self.effort(v, sigmoid(v, smoothing_velocity))


def sigmoid(v: FloatArray, smoothing_velocity: float) -> FloatArray:
    """Return 2 / (1 + exp(−2 v / v_0)) − 1 = tanh(v / v_0): the sign of v, smooth around 0."""
    return np.asarray(np.tanh(v / smoothing_velocity))


def make_friction(
    joint_names: Sequence[str],
    viscous: Any = (),
    coulomb: Any = (),
    static: Any = (),
    stribeck_velocity: Any = (),
    offset: Any = (),
    default: JointFriction | None = None,
) -> JointFriction:
    """
    Return checked friction; each parameter is (n,), one value for all joints, or empty.

    Empty means: as in `default`, or none. A static friction left out is the Coulomb friction.
    Raises InvalidInputError, naming field, joint and value, on another number of values, a
    negative one, F_s < F_c, v_s = 0, or |F_o| > F_c: such friction would create energy.
    """
    n = len(joint_names)

    def values(label: str, value: Any, otherwise: FloatArray) -> FloatArray:
        return per_joint_values(label, value, joint_names, otherwise)

    nothing = np.zeros(n)
    F_v = values('friction.viscous', viscous, nothing if default is None else default.viscous)
    F_c = values('friction.coulomb', coulomb, nothing if default is None else default.coulomb)
    keeps_static = default is not None and len(coulomb) == 0
    F_s = values(
        'friction.static', static, default.static if default is not None and keeps_static else F_c)
    v_s = values(
        'friction.stribeck_velocity', stribeck_velocity,
        np.full(n, DEFAULT_STRIBECK_VELOCITY) if default is None else default.stribeck_velocity)
    F_o = values('friction.offset', offset, nothing if default is None else default.offset)
    _refuse(joint_names, 'friction.viscous', F_v, F_v < 0.0, 'a number >= 0')
    _refuse(joint_names, 'friction.coulomb', F_c, F_c < 0.0, 'a number >= 0')
    _refuse(joint_names, 'friction.static', F_s, F_s < F_c,
            'at least friction.coulomb of that joint')
    _refuse(joint_names, 'friction.stribeck_velocity', v_s, v_s < SMALLEST_DIVISOR,
            f'a number > 0, at least {SMALLEST_DIVISOR:g}')
    _refuse(joint_names, 'friction.offset', F_o, np.abs(F_o) > F_c,
            'at most friction.coulomb of that joint in size, or friction would create energy')
    return JointFriction(F_v, F_c, F_s, v_s, F_o)


def _refuse(
    names: Sequence[str], field: str, values: FloatArray, bad: Any, expected: str,
) -> None:
    if np.any(bad):
        joint = int(np.argmax(bad))
        raise InvalidInputError(
            f'{field} of {names[joint]!r} is {values[joint]:g}, expected {expected}')
