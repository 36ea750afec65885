# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""How a motion or a command ends: raised from wherever, executed by the supervisor alone."""

from enum import Enum
from typing import NamedTuple

from robot_dynamics.control.safety.faults import Fault


class Kind(Enum):
    """What the arm does when something ends."""

    HOLD = 'stop and hold'
    """The reference ends; the arm stops and is held."""
    RELEASE = 'stop and release'
    """The same; then the command ends by `end_action`."""
    RELEASE_NOW = 'release now'
    """The command ends by `end_action`, or by the fault action, although the arm moves."""


class Ending(NamedTuple):
    """An ending, its reason, and the fault that is its cause, or None."""

    kind: Kind
    reason: str
    fault: Fault | None = None

    @classmethod
    def by(cls, fault: Fault, kind: Kind = Kind.HOLD) -> 'Ending':
        """Return the ending by a fault, by default one that holds the arm with damping."""
        return cls(kind, str(fault), fault)
