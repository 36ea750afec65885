# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Gaps in which the computer does not run a process that never waits.

On a shared machine another process may occupy the core for milliseconds. This program only reads
the clock, on each core at the same time. Therefore no program misses fewer cycles.
"""

import json
import os
import subprocess
import sys
import time
from typing import NamedTuple

from benchmarks.processes import module

SHORTEST = 2e-4
"""[s] of a gap that is noted."""


class Gaps(NamedTuple):
    """Gaps [s] of all cores, and the observed time [s], summed over the cores."""

    gaps: list[float]
    watched: float

    def missed(self, period: float) -> float:
        """Return the fraction of periods [s] that were in gaps."""
        return sum(gap // period for gap in self.gaps) / (self.watched / period)

    @property
    def longest(self) -> float:
        """Return the longest gap [s]."""
        return max(self.gaps, default=0.0)


def watch(seconds: float) -> Gaps:
    """Keep all cores of this process busy for `seconds`, and return their gaps."""
    cores = sorted(os.sched_getaffinity(0))
    witnesses = [
        subprocess.Popen(module('benchmarks.witness', str(core), str(seconds)),
                         stdout=subprocess.PIPE, text=True) for core in cores]
    gaps = [gap for witness in witnesses for gap in json.loads(witness.communicate()[0])]
    return Gaps(gaps, seconds * len(cores))


def main(core: int, seconds: float) -> None:
    """Read the clock on one core for `seconds`; print the gaps."""
    os.sched_setaffinity(0, {core})
    gaps = []
    before = time.perf_counter()
    end = before + seconds
    while before < end:
        now = time.perf_counter()
        if now - before > SHORTEST:
            gaps.append(now - before)
        before = now
    print(json.dumps(gaps))


if __name__ == '__main__':
    main(int(sys.argv[1]), float(sys.argv[2]))
