# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Make the CMake files of the ROS wheels in a virtual environment refer to this machine's headers.

The wheels were built on another machine, and their exports name the include directories of Python
and numpy of that machine. Each file that changes is replaced by a new file: uv may have linked the
file to its cache, which other virtual environments share.
Usage: _relocate_cmake.py VIRTUAL_ENVIRONMENT
"""

import os
from pathlib import Path
import re
import sys
import sysconfig

import numpy as np

NUMPY = re.compile(r'/[^"; ]*/numpy/_?core/include')
PYTHON = re.compile(r'/[^"; ]*/include/python3\.\d+')


def main() -> None:
    python_include = sysconfig.get_paths()['include']
    for path in Path(sys.argv[1], 'share').rglob('*.cmake'):
        text = path.read_text(encoding='utf-8', errors='surrogateescape')
        here = NUMPY.sub(lambda _: np.get_include(), text)
        here = PYTHON.sub(lambda _: python_include, here)
        if here != text:
            fresh = path.with_suffix('.fresh')
            fresh.write_text(here, encoding='utf-8', errors='surrogateescape')
            os.replace(fresh, path)


main()
