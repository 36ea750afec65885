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
The interface of control laws, and the simplest law: gravity compensation.

A law returns an effort together with its terms. Everything else is common to all laws and is done
by the controller: effort limits, efforts that the robot adds on its own, references, stops,
faults.
"""

from collections.abc import Callable
from functools import partial
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import ErrorFeedback
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm_dynamics import EffortTerms, UncheckedArmDynamics
from robot_dynamics.trajectories.follower import ActiveTrajectory


class LawInput(NamedTuple):
    """
    The input of a law; arrays are (n,), in the order of the joints.

    `q` [rad] or [m] is measured at `stamp_ns`; `v` [rad/s] or [m/s] is None if it is unknown.
    `q_ahead` is the position half a period of the states later, when the effort acts; it is `q`
    itself if the difference does not matter. `gravity` [N·m] or [N] is g(q). `reference` is the
    reference to follow, or None; if there is a reference, `v` is known.
    """

    dynamics: UncheckedArmDynamics
    stamp_ns: int
    q: FloatArray
    v: FloatArray | None
    q_ahead: FloatArray
    gravity: FloatArray
    reference: ActiveTrajectory | None


class LawOutput(NamedTuple):
    """
    An effort (n,) [N·m] or [N] before any limit, and its parts.

    `terms()` returns the terms, which sum to `effort`. `friction` (n,) is the part of `effort`
    that compensates friction. `nominal` (n,) is the effort with unscaled gains; `gain_scale` is
    the factor s by which the bandwidth of `effort` is scaled down (`gain_softening`). `is_far` is
    true if the following error of a joint exceeds its limit.
    """

    effort: FloatArray
    terms: Callable[[], EffortTerms]
    friction: FloatArray
    nominal: FloatArray
    gain_scale: float = 1.0
    is_far: bool = False


class ControlLaw(Protocol):
    """
    A law τ(q, q̇, reference).

    A law that follows references is used while a reference is active; otherwise the controller
    uses gravity compensation. A law that does not follow references is used without a reference,
    also for states without a velocity; for the reference of `~/stop` the controller uses computed
    torque.
    """

    follows: ClassVar[bool]
    """Whether the law follows references."""

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        """Take the feedback of position and velocity errors, with the gains of the options."""

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort for a state."""

    def scale_gains(self, scale: float) -> None:
        """Scale the bandwidth of the gains by this factor in (0, 1], used if states are late."""
        return

    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """
        Set the rate limit of the effort.

        `effort_rate` (n,) [N·m/s] or [N/s] is the rate limit, infinite if there is no limit;
        `inertia` (n,) are the largest sums of the rows of |M(q)|.
        """
        return


class GravityCompensation(ControlLaw):
    """The law τ = g(q)."""

    follows = False

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self._zero = np.zeros(len(feedback.gains.kp))
        self._zero.setflags(write=False)

    def __call__(self, state: LawInput) -> LawOutput:
        """Return g(q)."""
        gravity = state.gravity
        return LawOutput(gravity, partial(self._terms, state), self._zero, gravity)

    def _terms(self, state: LawInput) -> EffortTerms:
        terms = equation_terms(
            state.dynamics, state.q, self._zero, self._zero, self._zero, state.gravity)
        if state.v is None:
            return terms
        return terms._replace(
            kinetic_energy=state.dynamics.rigid_body.kinetic_energy(state.q, state.v))


def equation_terms(
    dynamics: UncheckedArmDynamics, q: FloatArray, v: FloatArray, a: FloatArray,
    friction: FloatArray, gravity: FloatArray,
) -> EffortTerms:
    """
    Return the terms of M(q) a + C(q, v) v + g(q) + friction, all arrays (n,).

    `a` is the commanded acceleration, which contains the feedback of position and velocity
    errors. The feedback is therefore part of the term `inertial`, M(q) a.

    `gravity` replaces g(q) of the same position, because each algorithm of Pinocchio rounds g(q)
    differently. The terms therefore sum to the effort exactly, to the last bit.
    """
    terms = dynamics.terms(q, v, a, friction=friction)
    return terms._replace(gravity=gravity, effort=terms.effort + (gravity - terms.gravity))
