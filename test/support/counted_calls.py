# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Calls that work needs, counted instead of timed."""

from collections import Counter
from collections.abc import Callable
import sys
from typing import Any


def calls_of(work: Callable[[], object]) -> Counter[str]:
    """Return how often each function was called, without the calls of the counting itself."""
    counts: Counter[str] = Counter()

    def count(frame: Any, event: str, argument: Any) -> None:
        if event == 'call':
            counts[frame.f_code.co_name] += 1
        elif event == 'c_call':
            counts[argument.__name__] += 1

    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
    del counts['setprofile']
    return counts
