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

"""What the controller inside a simulated robot does: adds to efforts by itself, and measures."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.effort_convention import EffortConvention, measured_from_joint
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics


class InnerController:
    """
    The inner controller of a robot that knows its arm, but no load on it.

    All arrays are (n,) in the order of `arm.joint_names`.
    """

    def __init__(self, arm: ArmModel, semantics: EffortConvention) -> None:
        self.semantics = semantics
        self._dynamics = UncheckedArmDynamics(arm)

    def with_own_compensation(
        self, effort: FloatArray, q: FloatArray, v: FloatArray,
    ) -> FloatArray:
        """Return the effort at the joints of one that was commanded, at the state (q, v)."""
        if self.semantics.compensates_gravity:
            effort = effort + self._dynamics.rigid_body.gravity(q)
        if self.semantics.compensates_friction:
            # smooth around rest, as the sign of a measured velocity would chatter there
            effort = effort + self._dynamics.friction_effort(v, effort, smooth=True)
        return effort

    def measured(
        self, effort: FloatArray, q: FloatArray, v: FloatArray, braked: bool,
    ) -> FloatArray:
        """
        Return what the robot reports while `effort` acts at its joints; empty for none.

        While brakes carry the arm it reports zeros, whatever it measures.
        """
        lacks_gravity = self.semantics.lacks_gravity and not braked
        gravity = self._dynamics.rigid_body.gravity(q) if lacks_gravity else np.zeros_like(q)
        return measured_from_joint(
            self.semantics.measured_effort, effort, v, gravity, self._dynamics.arm.actuators)
