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

Source: B. Siciliano et al., *Robotics*, Springer 2009, section 7.3:
viscous friction F_v v and Coulomb friction F_s sgn(v).
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.validation import FloatArray

SMOOTHING_VELOCITY = 0.01
"""[rad/s] or [m/s] over which `smooth_effort` changes its sign."""


@dataclass(frozen=True, eq=False)
class JointFriction:
    """
    Viscous and Coulomb friction of n joints.

    `viscous` (n,) [N·m·s/rad] or [N·s/m]; `coulomb` (n,) [N·m] or [N].
    """

    viscous: FloatArray
    coulomb: FloatArray

    def effort(self, v: FloatArray) -> FloatArray:
        """
        Return what actuators must add to overcome friction at the velocity v, shape (..., n).

        It has the sign of v; at rest it is 0.
        """
        return np.asarray(self.viscous * v + self.coulomb * np.sign(v))

    def smooth_effort(self, v: FloatArray) -> FloatArray:
        """
        Return the same with tanh(v / SMOOTHING_VELOCITY) for the sign, shape (..., n).

        For a control law, whose effort must not chatter between two signs around rest.
        """
        return np.asarray(self.viscous * v + self.coulomb * np.tanh(v / SMOOTHING_VELOCITY))
