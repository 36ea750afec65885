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
The effort that the environment exerts on an arm, estimated from its measured motion and effort.

`momentum_observer` filters; here is the model that it needs: p = M(q) q̇ and τ + Cᵀ q̇ − g − τ_f at
each measured state. Between two states the latter is taken as a straight line, but τ is the effort
measured at the later one throughout, as drives hold it between two commands.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.monitoring.momentum_observer import MomentumObserver


class _Known(NamedTuple):
    """A state (q, v) with p and Cᵀ q̇ − g there, each (n,)."""

    q: FloatArray
    v: FloatArray
    momentum: FloatArray
    drift: FloatArray


class ExternalEffort:
    """
    Estimates Jᵀ f, what all wrenches f of the environment together exert on the joints, (n,).

    Its sign is that of an effort of the actuators: what lifts a joint is what lifts it. A load
    that the model does not have, and friction that it lacks, are environment too.
    """

    def __init__(self, dynamics: ArmDynamics, bandwidth: float) -> None:
        """Follow with a bandwidth of K / 2π [Hz] > 0; raise InvalidInputError."""
        self._observer = MomentumObserver(dynamics.arm.joint_count, bandwidth)
        self._dynamics = dynamics.unchecked
        self._before: _Known | None = None

    def set_bandwidth(self, bandwidth: float) -> None:
        """Go on with another bandwidth [Hz]."""
        self._observer.set_bandwidth(bandwidth)

    def restart(self) -> None:
        """Begin anew, at 0, with the next state."""
        self._observer.restart()
        self._before = None

    def use(self, dynamics: ArmDynamics) -> None:
        """
        Go on with another model of the same joints, as with a load that was put on.

        The momentum of the state before is that of the new model from now on, so that the
        estimate does not step because the model did.
        """
        self._dynamics = dynamics.unchecked
        if self._before is not None:
            self._before = self._at(self._before.q, self._before.v)

    def update(
        self, dt: float, q: FloatArray, v: FloatArray, effort: FloatArray,
    ) -> FloatArray | None:
        """
        Return the estimate (n,) at a state dt [s] after the one before; None at the first one.

        `effort` (n,) [N·m] or [N] is measured, on the joint side of the gearbox.
        """
        before, now = self._before, self._at(q, v)
        self._before = now
        if before is None:
            return None
        passed = self._dynamics.load_behind(np.array((before.v, v)), effort).mean(axis=0)
        return self._observer.update(
            now.momentum - before.momentum,
            dt * (passed + 0.5 * (before.drift + now.drift)), dt)

    def _at(self, q: FloatArray, v: FloatArray) -> _Known:
        body = self._dynamics.rigid_body
        C = body.coriolis_matrix(q, v)
        return _Known(q, v, body.mass_matrix(q) @ v, v @ C - body.gravity(q))
