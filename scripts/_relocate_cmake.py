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
Point the CMake files of the ROS wheels in a virtual environment to this machine's headers.

The wheels were built elsewhere, and their exports name that machine's include directories of
Python and numpy. Usage: _relocate_cmake.py VIRTUAL_ENVIRONMENT
"""

from pathlib import Path
import re
import sys
import sysconfig

import numpy as np

# Whatever machine they name: a cache of wheels may have been rewritten for another environment.
NUMPY_OF_ANY_MACHINE = re.compile(r'(?<=[";])/[^";]*/numpy/_?core/include(?=[";])')
PYTHON_OF_ANY_MACHINE = re.compile(r'(?<=[";])/[^";]*/include/python3\.\d+(?=[";])')


def main() -> None:
    python_include = sysconfig.get_paths()['include']
    for path in Path(sys.argv[1], 'share').rglob('*.cmake'):
        text = path.read_text(encoding='utf-8', errors='surrogateescape')
        relocated = NUMPY_OF_ANY_MACHINE.sub(lambda _: np.get_include(), text)
        relocated = PYTHON_OF_ANY_MACHINE.sub(lambda _: python_include, relocated)
        if relocated == text:
            continue
        # A file of its own: this one may be linked with the installer's cache, and through it
        # with other environments.
        path.unlink()
        path.write_text(relocated, encoding='utf-8', errors='surrogateescape')


main()
