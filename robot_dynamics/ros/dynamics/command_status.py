# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The status and the counters of the command in the diagnostics."""

from collections import Counter
from dataclasses import dataclass, field
import math
import time

from robot_dynamics.control.laws.law_table import NO_COMMAND
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.middleware.diagnostics import ERROR, OK, WARN

TELL_FOR = 1.0
"""[s] for which the diagnostics report an effort that a limit has changed."""


@dataclass
class CommandCounters:
    """Counters of the command since the start."""

    published: int = 0
    others: Counter[str] = field(default_factory=Counter)
    """By their keys in the diagnostics."""
    limited_at: float = -math.inf
    incompatible: str = ''
    """The last subscriber that requested an incompatible QoS."""

    def count_limits(self, names: tuple[str, ...]) -> None:
        """Count the limits that have changed the effort of a state."""
        if names:
            self.others.update(f'held back by {name}' for name in names)
            self.limited_at = time.monotonic()

    @property
    def figures(self) -> dict[str, int]:
        """The counters by their keys in the diagnostics."""
        return {'published': self.published, **dict(sorted(self.others.items()))}


def active_words(command: str, states: str, node: str) -> str:
    """Return the line for the log when the node becomes active; `states` is a topic."""
    if command == 'none':
        return (f'Active with command: none. Nothing is commanded; the results for the states '
                f'on {states} are published on {node}/gravity_compensation and '
                f'{node}/computed_torque.')
    return (f'Active with command: {command}. The command starts with the first valid joint state '
            f'on {states}.')


def command_obstacle(arm: ArmModel, command: str) -> str:
    """Return why an arm is not commanded although `command` is not none, empty if it is."""
    unlimited = [
        name for name, limit in zip(arm.joint_names, arm.limits.effort) if math.isinf(limit)]
    if command == NO_COMMAND or not unlimited:
        return ''
    return (f'nothing is commanded: {unlimited} have no effort limit, or 0, in robot_description, '
            'expected one there or in the parameter effort.limit')


def command_verdict(
    counters: CommandCounters, mode: Mode | None, fault: Fault | None, is_off: bool,
    obstacle: str = '', silence: str = '',
) -> tuple[bytes, str]:
    """
    Return level and message of the command for the diagnostics.

    `mode` and `fault` are the mode and the standing fault of the supervisor; without a model,
    `mode` is None and `fault` the latched one. `is_off` is whether the node is active and its
    parameter command is 'none', `obstacle` why nothing is commanded although it is not, `silence`
    why nothing receives the command.
    """
    if obstacle:
        return ERROR, obstacle
    if fault is not None:
        return ERROR, str(fault)
    if mode is None:
        return WARN, 'no model yet'
    if mode is Mode.INACTIVE and is_off:
        return OK, "none (the parameter command is 'none')"
    if mode is not Mode.RUNNING:
        return WARN, mode.value
    if time.monotonic() - counters.limited_at < TELL_FOR:
        return WARN, 'held back by a limit'
    if counters.incompatible or silence:
        return WARN, silence or counters.incompatible
    return OK, mode.value
