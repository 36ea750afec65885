# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Removal of the Fast DDS shared memory that killed processes leave behind.

Fast DDS 2.14 makes files in /dev/shm for each segment, `fastrtps_<id>`, and for each port,
`fastrtps_port<number>`. A process that is killed does not delete them. The identifiers of segments
are random, so that no other process opens one later. The numbers of ports are shared by all
processes of the machine: a node that starts uses the port of a killed one. If its files are
deleted in that moment, nodes do not receive messages of each other. The ports therefore stay,
with 52 kB each.
"""

from collections import defaultdict
from collections.abc import Iterator
import os
from pathlib import Path
import re

DIRECTORY = Path('/dev/shm')
SEGMENT = re.compile(r'(fastrtps_[0-9a-z]{16})(?:_el|_sl)?')
_MAPPED = re.compile(rf'{DIRECTORY}/(\S+)')


def remove_orphans() -> list[str]:
    """Delete the segments of which no process uses any file; return the names of their files."""
    groups: defaultdict[str, list[Path]] = defaultdict(list)
    for path in DIRECTORY.glob('fastrtps_*'):
        match = SEGMENT.fullmatch(path.name)
        if match:
            groups[match[1]].append(path)
    used = {name for process in Path('/proc').glob('[0-9]*') for name in files_in_use(process)}
    removed = [path for group in groups.values()
               if used.isdisjoint(path.name for path in group) for path in group]
    for path in removed:
        path.unlink(missing_ok=True)
    return [path.name for path in removed]


def files_in_use(process: Path) -> Iterator[str]:
    """Yield the names of the files in DIRECTORY that a process, /proc/<id>, has mapped or open."""
    try:  # descriptors first: a file is closed after it has been mapped
        for descriptor in (process / 'fd').iterdir():
            target = os.readlink(descriptor)
            if target.startswith(f'{DIRECTORY}/'):
                yield Path(target).name
        yield from _MAPPED.findall((process / 'maps').read_text(encoding='utf-8'))
    except OSError:  # the process has ended, or belongs to another user
        return
