# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
How much memory a node may take, and when it looks for what it no longer needs.

The middleware believes the counts that stand in a service request before it has seen the data: 16
bytes that are no request can make it take all the memory of the computer, which then ends the
node. With a limit such a request fails instead.
"""

import gc
from pathlib import Path
import re
import resource

MEMORY_LIMIT = 2**30
"""[bytes] that a node may take beyond what it has at its start."""
FULL_PASSES_APART = 1000
"""Passes of Python's garbage collector over young objects before one over all."""


def limit_memory(beyond: int = MEMORY_LIMIT) -> None:
    """
    Let this process take so many bytes more than it has, where Linux tells how many it has.

    A stricter limit stays.
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
    Leave what there is now alone, and look at all the rest seldom.

    A pass over all objects lets no thread run, for 10 ms at first, and for 0.1 s where a request
    is made of many; what is no longer needed is nearly always found by a pass over the young.
    """
    gc.collect()
    gc.freeze()
    young, middle, _ = gc.get_threshold()
    gc.set_threshold(young, middle, FULL_PASSES_APART)
