# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""
Times of short calls, measured in interleaved rounds, so that a slow moment affects all.

The times are processor times of the calling thread, which other work on the machine increases only
through its caches and clock rate.
"""

from collections.abc import Callable, Mapping, Sequence
import statistics
import time
from typing import Any

ROUND = 4e-3
"""[s] that one round of one call takes, or one pass over the states where that is longer."""


def seconds_per_call(
    call: Callable[..., object], states: Sequence[tuple[Any, ...]], passes: int,
) -> float:
    """Return the mean processor time [s] of a call over all states and repetitions."""
    start = time.thread_time()
    for _ in range(passes):
        for state in states:
            call(*state)
    return (time.thread_time() - start) / (passes * len(states))


def medians(
    calls: Mapping[str, tuple[Callable[..., object], Sequence[tuple[Any, ...]]]], rounds: int,
) -> dict[str, float]:
    """Return the median processor time [s] of each call; each round makes all calls."""
    passes = {}
    for name, (call, states) in calls.items():
        seconds_per_call(call, states, 1)  # warms up
        once = seconds_per_call(call, states, 1) * len(states)
        passes[name] = max(1, round(ROUND / once))
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, (call, states) in calls.items():
            times[name].append(seconds_per_call(call, states, passes[name]))
    return {name: statistics.median(values) for name, values in times.items()}
