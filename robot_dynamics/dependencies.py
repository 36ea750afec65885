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

"""Optional libraries that some functions need, and the ways to install them."""

import importlib
from importlib.util import find_spec
from pathlib import Path
import shlex
import sys
import sysconfig
from typing import Any, NamedTuple

from robot_dynamics.exceptions import MissingDependencyError


class Library(NamedTuple):
    """
    How to install a library.

    `apt` is its package in Ubuntu 24.04 or ROS 2 Jazzy, '' without one; `pip` are its
    packages on PyPI; `extra` is the extra in setup.py that contains it.
    """

    name: str
    apt: str
    pip: tuple[str, ...]
    extra: str


LIBRARIES = {
    'PIL': Library('Pillow', 'python3-pil', ('pillow',), 'tools'),
    'bokeh': Library('Bokeh', '', ('bokeh',), 'report'),
    'distributed': Library('distributed', '', ('distributed',), 'dask'),
    'imageio_ffmpeg': Library('imageio-ffmpeg', '', ('imageio-ffmpeg',), 'video'),
    'matplotlib': Library('matplotlib', 'python3-matplotlib', ('matplotlib',), 'tools'),
    'mcap': Library('mcap', '', ('mcap',), 'tools'),
    'pyarrow': Library('pyarrow', '', ('pyarrow',), 'parquet'),
    'rosbags': Library('rosbags', '', ('rosbags',), 'tools'),
    'scipy': Library('scipy', 'python3-scipy', ('scipy',), 'tools'),
    'viser': Library('viser', '', ('viser', 'pycollada'), 'viewer'),
    'xacro': Library('xacro', 'ros-jazzy-xacro', ('xacro',), 'xacro'),
    'yaml': Library('PyYAML', 'python3-yaml', ('pyyaml',), 'tools'),
}
"""The libraries by module."""

NUMPY_OF_APT = 'numpy<2'
"""What the modules of ROS and Pinocchio from apt are compiled for on Ubuntu 24.04."""


def optional(module: str, purpose: str) -> Any:
    """
    Return a module of one of LIBRARIES; `purpose` names its user in the message.

    Raises MissingDependencyError if the library is not installed.
    """
    library = module.partition('.')[0]
    try:
        importlib.import_module(library)
        return importlib.import_module(module)
    except ImportError:
        name = LIBRARIES[library].name
        raise MissingDependencyError(
            f'{purpose} needs the library {name}, which cannot be imported. Install it: '
            f'{install_command(library)}') from None


def install_command(module: str) -> str:
    """Return the command that installs a library of LIBRARIES for this Python interpreter."""
    library = LIBRARIES[module]
    if not _belongs_to_system():
        return shlex.join([sys.executable, '-m', 'pip', 'install', *library.pip])
    if library.apt:
        return f'sudo apt install {library.apt}'
    command = shlex.join([
        sys.executable, '-m', 'pip', 'install', '--user', '--break-system-packages',
        *library.pip, NUMPY_OF_APT])
    return command if find_spec('pip') else f'sudo apt install python3-pip && {command}'


def _belongs_to_system() -> bool:
    """
    Return whether apt manages this interpreter, so that a plain `pip install` is refused.

    The file is that of PEP 668. A virtual environment is exempt.
    """
    marker = Path(sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED')
    return sys.prefix == sys.base_prefix and marker.exists()
