# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Arms with wrong torque constants, offsets and dry friction, and their static holds."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from recordings import encoded, START_NS, write_topics
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model import ArmModel, make_payload, RigidBody
from robot_dynamics_tools.gravity_calibration import Hold, select_poses
from robots import effort_limit

TOOL_LINKS = {'default': 'tool0', 'ur10': 'tool0', 'panda': 'panda_link8', 'xarm7': 'link7'}
"""The arms of the tests, and the links of their tools."""


@dataclass(frozen=True, eq=False)
class HiddenDrives:
    """
    Effort scale and offset (n,) that a calibration has to find, and dry friction (n,) [N·m].

    At a hold, friction has a random part of `remainder` (0 to 1) less than its largest value;
    `noise` (n,) [N·m] is the standard deviation of the mean effort, of a sample in a recording.
    """

    arm: ArmModel
    scale: FloatArray
    offset: FloatArray
    friction: FloatArray
    noise: FloatArray
    remainder: float = 0.0

    @property
    def limit(self) -> FloatArray:
        return effort_limit(self.arm)

    def holds(
        self, positions: FloatArray, arm: ArmModel | None = None,
        rng: np.random.Generator | None = None,
    ) -> list[Hold]:
        """Return two holds of each position (m, n), of `arm` instead of the own arm if given."""
        rng = np.random.default_rng(0) if rng is None else rng
        found = []
        gravity = RigidBody(arm or self.arm).gravity_batch(positions)
        for q, g in zip(positions, gravity):
            for side in (1, -1):
                dry = self.friction * (1.0 - self.remainder * rng.uniform(size=len(q)))
                effort = (g + side * dry) / self.scale + self.offset
                start = 4.0 * len(found)
                found.append(Hold(
                    start, start + 2.0, q, effort + self.noise * rng.normal(size=len(q)),
                    np.full(len(q), side)))
        return found


def exact_drives(arm: ArmModel, seed: int = 0) -> HiddenDrives:
    """Return torque constants that are wrong by up to 30 %, and friction that cancels exactly."""
    rng = np.random.default_rng(seed)
    n, limit = arm.joint_count, effort_limit(arm)
    return HiddenDrives(
        arm, rng.uniform(0.7, 1.3, n), rng.uniform(-0.05, 0.05, n) * limit,
        rng.uniform(0.01, 0.02, n) * limit, np.zeros(n))


def noisy_drives(arm: ArmModel, seed: int) -> HiddenDrives:
    """Return `exact_drives` with noise, and friction that does not cancel exactly."""
    drives = exact_drives(arm, seed)
    return replace(drives, noise=2e-4 * drives.limit, remainder=0.1)


def poses_of(arm: ArmModel, count: int = 12) -> FloatArray:
    """Return the positions (count, n) of the selected poses."""
    return select_poses(arm, count).positions


def load_on(name: str, mass: float, com=(0.03, 0.02, 0.1)):
    """Return a load on the tool link of an arm."""
    return make_payload(TOOL_LINKS[name], mass, com)


def record_holds(
    path: Path, drives: HiddenDrives, positions: FloatArray, arm: ArmModel | None = None,
    command_scale: FloatArray | None = None,
) -> Path:
    """
    Write the joint states, at 50 Hz, of a driver that rests for 2 s in each position.

    With `command_scale` (n,), the torque per unit of command, write its commands too.
    It approaches each position from both sides, linearly from position ± 0.1. Dry friction has
    the sign of the last motion.
    """
    rng = np.random.default_rng(0)
    at, dry = [], []
    for q in positions:
        for direction in (1, -1):
            way = np.linspace(q - 0.1 * direction, q, 50)
            at.append(np.concatenate([way, np.tile(q, (100, 1))]))
            dry.append(np.tile(direction * drives.friction, (len(at[-1]), 1)))
    q = np.concatenate(at)
    torque = RigidBody(arm or drives.arm).gravity_batch(q) + np.concatenate(dry)
    effort = torque / drives.scale + drives.offset + drives.noise * rng.normal(size=q.shape)
    stamps_ns = START_NS + 20_000_000 * np.arange(len(q))
    names = drives.arm.joint_names
    topics = {'/joint_states': encoded(stamps_ns, names, q, None, effort)}
    if command_scale is not None:
        topics['/arm/effort_command'] = encoded(stamps_ns, names, effort=torque / command_scale)
    return write_topics(path, topics)
