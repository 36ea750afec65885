# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The memory limit of a node, and the passes of its garbage collector.

The middleware allocates memory for the counts in a service request before it reads the data: an
invalid request of 16 bytes can therefore allocate all the memory of the computer, which then kills
the node. With a memory limit, such a request fails instead.
"""

import gc
from pathlib import Path
import re
import resource

MEMORY_LIMIT = 2**30
"""Memory [bytes] that a node may allocate in addition to that at its start."""
FULL_PASSES_APART = 1000
"""Passes of Python's garbage collector over young objects before a pass over all."""


def limit_memory(beyond: int = MEMORY_LIMIT) -> None:
    """
    Limit the memory of this process to `beyond` bytes more than it has, on Linux.

    A stricter limit stays active.
    """
    status = Path('/proc/self/status')
    has = re.search(r'^VmData:\s*(\d+) kB', status.read_text(), re.MULTILINE) if (
        status.exists()) else None
    if has is None:
        return
    wanted = 1024 * int(has[1]) + beyond
    limit, most = resource.getrlimit(resource.RLIMIT_DATA)
    if limit == resource.RLIM_INFINITY or wanted < limit:
        resource.setrlimit(resource.RLIMIT_DATA, (wanted, most))


def expect_no_garbage() -> None:
    """
    Exclude the present objects from garbage collection, and collect all others rarely.

    A pass over all objects stops all threads for 10 ms at first, and for 0.1 s if a request has
    many objects. A pass over the young objects finds nearly all unused objects.
    """
    gc.collect()
    gc.freeze()
    young, middle, _ = gc.get_threshold()
    gc.set_threshold(young, middle, FULL_PASSES_APART)
