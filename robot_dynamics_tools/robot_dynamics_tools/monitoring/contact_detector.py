# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Contacts: external efforts above a level per joint that grows with the speed.

This detects contacts and is no safety function.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.monitoring.contact_levels import ContactLevels, OTHER_CAUSES

SEPARATION = 0.5
"""[s] below all levels that ends a contact."""


class Contact(NamedTuple):
    """The joint whose effort exceeds its level most, with both [N·m] or [N]."""

    joint: str
    effort: float
    level: float

    def __str__(self) -> str:
        return (f'external effort at {self.joint!r} is {self.effort:.3g}, level {self.level:.3g}: '
                f'a contact, or {OTHER_CAUSES}')


class ContactDetector:
    """Finds the beginnings of contacts, in states in the order of time."""

    def __init__(self, levels: ContactLevels, joint_names: Sequence[str]) -> None:
        self.levels, self._names = levels, joint_names
        self._left = 0.0

    def update(self, dt: float, v: FloatArray, effort: FloatArray) -> Contact | None:
        """
        Return the contact that begins at a state dt [s] after the previous one, or None.

        `v` and the external `effort` are (n,). A contact lasts until no joint has exceeded its
        level for 0.5 s.
        """
        level = self.levels.at(v)
        j = int(np.argmax(np.abs(effort) / level))
        self._left -= dt
        if abs(effort[j]) <= level[j]:
            return None
        was_on, self._left = self._left > 0.0, SEPARATION
        return None if was_on else Contact(self._names[j], float(effort[j]), float(level[j]))
