# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A fault of the command, and faults of the motion that recur."""

from collections import deque
from dataclasses import dataclass, replace

STATE_TIMEOUT = 0.05
"""Default of `state_timeout` [s]: the time for which an arm without states, and a joint without
samples, is assumed to move on, and for which one effort may change since the last one."""
FOLLOWING_ERROR, OVERSPEED, POSITION_LIMIT = 'following_error', 'overspeed', 'position_limit'
"""Faults: the arm is too far from its reference, a joint is too fast, or beyond its range."""
FROZEN_JOINT = 'frozen_joint'
"""Fault: the position of a joint repeats."""
RECURRENCES, RECURRENCE_TIME = 3, 10.0
"""Number of these faults, within this time [s], after which references wait for a reset."""


@dataclass(frozen=True)
class Fault:
    """
    A fault: its name for programs, a message for the operator, and whether it needs a reset.

    If it needs no reset, it ends after `recovery` consecutive good states. Until then, the joints
    of `shares`, by number, get only a share of their efforts; those with 0 are released.
    """

    name: str
    message: str
    latched: bool = False
    recovery: int = 1
    shares: tuple[tuple[int, float], ...] = ()

    def replaces(self, other: 'Fault') -> bool:
        """Return whether it is harder to leave than another fault, or another one to reset."""
        return (self.latched, self.recovery) > (other.latched, other.recovery) or (
            self.latched and self.name != other.name)

    def __str__(self) -> str:
        waits = '; waits for ~/reset_fault' if self.latched else ''
        return f'fault {self.name}: {self.message}{waits}'


class RecurringFaults:
    """
    Lets references wait for a reset after many faults of the motion; the arm is held.

    If as many follow although the arm is only held, the law drives it: then it is damped until
    the reset.
    """

    def __init__(self) -> None:
        self.fault: Fault | None = None
        """The fault that has recurred, until `reset`."""
        self.is_driven = False
        """Whether as many faults followed while the arm was only held."""
        self._times = deque[float](maxlen=RECURRENCES)

    def count(self, fault: Fault, now: float) -> Fault:
        """Return a fault that has ended a reference, or the one that has recurred with it."""
        if fault.name not in (FOLLOWING_ERROR, OVERSPEED):
            return fault
        self._times.append(now)
        if len(self._times) == RECURRENCES and now - self._times[0] <= RECURRENCE_TIME:
            self._times.clear()
            self.is_driven = self.fault is not None
            self.fault = replace(fault, latched=True, message=(
                f'{fault.message}; {RECURRENCES} faults of the motion within '
                f'{RECURRENCE_TIME:g} s' + ', again while the arm is only held: it is damped'
                * self.is_driven))
        return self.fault or fault

    def reset(self) -> None:
        """Let references be followed again."""
        self.fault, self.is_driven = None, False
        self._times.clear()
