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

"""An arm with its loads: the dynamics for the control path and for planning, and its exchange."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from robot_dynamics.control.payload_transition import PayloadTransition
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.model.payload import Payload
from robot_dynamics.trajectories.motion_limits import WorkspaceInertia


class PreparedLoad(NamedTuple):
    """The data that are computed for loads before the loads replace the active ones."""

    payloads: tuple[Payload, ...]
    planning: ArmDynamics
    workspace: WorkspaceInertia


class LoadedArm:
    """
    An arm with its active loads.

    `dynamics` is for the control path, `planning` for the thread that plans motions; `workspace`
    is M(q) and g(q) over the workspace. `Controller` calls `prepare` without its lock, and all
    other methods with it.
    """

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self.unloaded = self.dynamics = UncheckedArmDynamics(arm)
        self.planning = ArmDynamics(arm)
        self.workspace = WorkspaceInertia(self.planning)
        self._transition: PayloadTransition | None = None

    def prepare(self, payloads: Sequence[Payload]) -> PreparedLoad:
        """Return the data of loads whose computation takes long."""
        planning = ArmDynamics(self.arm.with_payloads(payloads))
        return PreparedLoad(tuple(payloads), planning, WorkspaceInertia(planning))

    def replace(self, load: PreparedLoad, dynamics: UncheckedArmDynamics) -> None:
        """Activate loads at once; `dynamics` are those of the arm with them."""
        self.dynamics, self._transition = dynamics, None
        self.planning, self.workspace = load.planning, load.workspace

    def begin_transition(
        self, load: PreparedLoad, transition_time: float,
        when_done: Callable[[tuple[Payload, ...]], None],
    ) -> None:
        """
        Let loads replace the active ones over transition_time [s].

        Until the next exchange, `workspace` is that of the heavier loads.
        """
        self.planning, self.workspace = load.planning, load.workspace.heavier(self.workspace)
        self._transition = PayloadTransition(
            self.dynamics.arm.payloads, load.payloads, transition_time, when_done)

    def advance(self, stamp_ns: int) -> None:
        """Activate the loads of this stamp during a transition."""
        transition = self._transition
        if transition is None:
            return
        payloads = transition.payloads(stamp_ns)
        self.dynamics = UncheckedArmDynamics(
            self.arm.with_payloads(payloads)) if payloads else self.unloaded
        if transition.done:
            self._transition = None
            transition.when_done(transition.target)
