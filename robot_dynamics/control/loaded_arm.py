# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""An arm with its loads and gravity: the dynamics for the control path and for planning."""

from collections.abc import Callable, Sequence
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.payload_transition import PayloadTransition
from robot_dynamics.references.motion_limits import WorkspaceInertia

LONGEST_STEP = 0.1
"""[s] between two states that counts for a change of gravity; a longer pause counts as this."""


class LoadedArm:
    """
    An arm with its active loads and the active gravity.

    `dynamics` is for the control path, `planning` for the thread that plans motions; `workspace`
    is M(q) and g(q) over the workspace. `Controller` calls `prepare` without its lock, and all
    other methods with it.
    """

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        """The arm without loads, with the active gravity."""
        self.unloaded = self.dynamics = UncheckedArmDynamics(arm)
        self.planning = ArmDynamics(arm)
        self.workspace = self._planned = WorkspaceInertia(self.planning)
        self._transition: PayloadTransition | None = None
        self._when_done: Callable[[tuple[Payload, ...]], None] = lambda _: None
        self._stamp_ns: int | None = None
        self.changes = False
        """Whether loads or gravity are in a transition, so that `advance` is needed."""
        self._gravity_rate: float | None = None
        """Largest rate of change of gravity [m/s³] until that of `planning`; None: reached."""

    def prepare(
        self, payloads: Sequence[Payload] | None = None, gravity: FloatArray | None = None,
    ) -> WorkspaceInertia:
        """
        Return the data of loads and gravity (3,) [m/s²], whose computation takes long.

        None stands for the loads or the gravity of the last exchange.
        """
        last = self.planning.arm
        return WorkspaceInertia(ArmDynamics(
            self.arm.with_gravity(last.gravity if gravity is None else gravity).with_payloads(
                last.payloads if payloads is None else payloads)))

    def begin_transition(
        self, load: WorkspaceInertia, transition_time: float,
        when_done: Callable[[tuple[Payload, ...]], None],
    ) -> None:
        """
        Let loads replace the active ones over transition_time [s], 0 replaces them at once.

        During a transition, `workspace` is that of the heavier loads, until the next exchange.
        """
        self._plan(load)
        payloads, self._when_done, self._transition = self.planning.arm.payloads, when_done, None
        if transition_time > 0.0:
            self._transition = PayloadTransition(
                self.dynamics.arm.payloads, payloads, transition_time)
        else:
            self._set_dynamics(payloads)
            self.workspace = load
        self.changes = self._transition is not None or self._gravity_rate is not None

    def begin_gravity_change(self, load: WorkspaceInertia, rate: float) -> None:
        """Let gravity change to that of `load`, at most by `rate` [m/s³]; ∞ changes it at once."""
        self._plan(load)
        self._gravity_rate = rate
        if rate == math.inf:
            self._change_gravity(math.inf)
            self._set_dynamics(self.dynamics.arm.payloads)
        self.changes = self._transition is not None or self._gravity_rate is not None

    def _plan(self, load: WorkspaceInertia) -> None:
        self.workspace = load.heavier(self.workspace if self.changes else self._planned)
        self._planned, self.planning = load, load.dynamics

    def advance(self, stamp_ns: int) -> None:
        """Activate the loads and the gravity of this stamp during a transition."""
        last_ns, self._stamp_ns = self._stamp_ns, stamp_ns
        transition, payloads = self._transition, self.planning.arm.payloads
        if self._gravity_rate is not None and last_ns is not None:
            dt = min(max(1e-9 * (stamp_ns - last_ns), 0.0), LONGEST_STEP)
            self._change_gravity(self._gravity_rate * dt)
        self._set_dynamics(payloads if transition is None else transition.payloads(stamp_ns))
        if transition is not None and transition.done:
            self._transition = None
            self._when_done(payloads)
        self.changes = self._transition is not None or self._gravity_rate is not None
        if not self.changes:
            self._stamp_ns = None

    def _change_gravity(self, most: float) -> None:
        """Bring the active gravity nearer to that of `planning`, at most by `most` [m/s²]."""
        present, target = self.arm.gravity, self.planning.arm.gravity
        distance = float(np.linalg.norm(target - present))
        if distance <= most:
            self._gravity_rate = None
        else:
            target = present + most / distance * (target - present)
        self.arm = self.arm.with_gravity(target)
        self.unloaded = UncheckedArmDynamics(self.arm)

    def _set_dynamics(self, payloads: Sequence[Payload]) -> None:
        self.dynamics = UncheckedArmDynamics(
            self.arm.with_payloads(payloads)) if payloads else self.unloaded
