# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A supervisor of two joints for its tests, with given states and times."""

from collections.abc import Sequence
from itertools import count
from typing import Any

import numpy as np
from robot_dynamics.control.safety.effort_limiter import EffortLimits
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import CommandSupervisor

NAMES = ('shoulder', 'elbow')
HOLD, OTHER_HOLD = np.array([-50.0, 11.0]), np.array([-40.0, -6.0])
PUSH = HOLD + [150.0, -80.0]
RATE = 1000.0
HOLD_TIME, RAMP_TIME = 1.0, 0.5
PERIOD = 0.002
START = 100.0

SILENT = [None, None]
TROUBLE = Fault('trouble', 'something went wrong')
LATCHED = Fault('broken', 'something is wrong', latched=True)
RELEASE, RELEASE_NOW = Ending(Kind.RELEASE, 'words'), Ending(Kind.RELEASE_NOW, 'words')


def limits(rate: float = RATE, reach: float = np.inf, velocity: float = np.inf) -> EffortLimits:
    return EffortLimits(np.full(2, -reach), np.full(2, reach), np.full(2, velocity), rate)


def make(
    reach: float = np.inf, rate: float = RATE, velocity: float = np.inf, **options: Any,
) -> CommandSupervisor:
    return CommandSupervisor(NAMES, limits(rate, reach, velocity), SafetyOptions(**options))


def answer(
    one: CommandSupervisor, now: float, command: np.ndarray = HOLD, hold: np.ndarray = HOLD,
    q: Sequence[float] = (0.0, 0.0), dt: float | None = None, v: Sequence[float] = (0.0, 0.0),
) -> list[float] | None:
    """Pass a valid state; return the command as a list, None without a command."""
    effort = one.answer(now, np.array(q), np.array(v), command, lambda: hold, dt)
    return None if effort is None else list(effort)


def running(command: np.ndarray = HOLD, reach: float = 1.0, **options: Any) -> CommandSupervisor:
    """Return a supervisor that has returned `command` at the time START."""
    one = make(reach, **options)
    one.activate()
    for k in range(1001):
        effort = answer(one, START + (k - 1000) * PERIOD, command)
    assert effort == command.tolist()
    return one


def course(one: CommandSupervisor, begin: float = START) -> tuple[np.ndarray, np.ndarray]:
    """Tick until the commands end; return the times since `begin` (k,) and the efforts (k, n)."""
    times, efforts = [], []
    for k in count():
        assert k * PERIOD < 10.0, 'the commands do not end'
        effort = one.tick(begin + k * PERIOD)
        if effort is None:
            break
        times.append(k * PERIOD)
        efforts.append(effort)
    return np.array(times), np.array(efforts).reshape(-1, len(NAMES))
