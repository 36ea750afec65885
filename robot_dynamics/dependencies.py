# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

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
    packages on PyPI.
    """

    name: str
    apt: str
    pip: tuple[str, ...]


LIBRARIES = {
    'PIL': Library('Pillow', 'python3-pil', ('pillow',)),
    'bokeh': Library('Bokeh', '', ('bokeh',)),
    'example_robot_data': Library(
        'example-robot-data', 'ros-jazzy-example-robot-data', ('example-robot-data',)),
    'distributed': Library('distributed', '', ('distributed',)),
    'imageio_ffmpeg': Library('imageio-ffmpeg', '', ('imageio-ffmpeg',)),
    'matplotlib': Library('matplotlib', 'python3-matplotlib', ('matplotlib',)),
    'mujoco': Library('MuJoCo', '', ('mujoco',)),
    'pyarrow': Library('pyarrow', '', ('pyarrow',)),
    'rosbags': Library('rosbags', '', ('rosbags',)),
    'scipy': Library('scipy', 'python3-scipy', ('scipy',)),
    'viser': Library('viser', '', ('viser', 'pycollada')),
    'xacro': Library('xacro', 'ros-jazzy-xacro', ('xacro',)),
    'yaml': Library('PyYAML', 'python3-yaml', ('pyyaml',)),
}
"""The libraries by module."""

_ROS = (
    ('rclpy', 'ROS 2 Jazzy', 'Activate ROS first: source /opt/ros/jazzy/setup.bash'),
    ('robot_dynamics_interfaces', 'the message package of robot_dynamics',
     'Build it with both paths, in a workspace: colcon build --base-paths src '
     'src/robot_dynamics/robot_dynamics_interfaces && source install/setup.bash'))
"""Modules of ROS, what each belongs to, and how to make it available."""

NUMPY_OF_APT = 'numpy<2'
"""What the modules of ROS and Pinocchio from apt are compiled for on Ubuntu 24.04."""


def optional(module: str, purpose: str) -> Any:
    """
    Return a module of one of LIBRARIES; `purpose` names its user in the message.

    Raises MissingDependencyError if the library is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise missing(purpose, module.partition('.')[0]) from None


def require(purpose: str, *modules: str) -> None:
    """
    Check before long work that libraries of LIBRARIES can be imported; `purpose` is their user.

    Raises MissingDependencyError, which names all that are missing and one command.
    """
    absent = [module for module in modules if not _is_importable(module)]
    if absent:
        raise missing(purpose, *absent)


def require_ros(purpose: str) -> None:
    """Raise MissingDependencyError if ROS, or the package of the messages, is not available."""
    for module, origin, remedy in _ROS:
        if not _is_importable(module):
            raise MissingDependencyError(
                f'{purpose} needs {origin} (the module {module}), which cannot be imported. '
                f'{remedy}. In a clone without ROS, start the command with scripts/run')


def install_command(*modules: str) -> str:
    """Return the command that installs libraries of LIBRARIES for this Python interpreter."""
    libraries = [LIBRARIES[module] for module in modules]
    if not _belongs_to_system():
        packages = [name for library in libraries for name in library.pip]
        return shlex.join([sys.executable, '-m', 'pip', 'install', *packages])
    of_apt = [library.apt for library in libraries if library.apt]
    packages = [name for library in libraries if not library.apt for name in library.pip]
    commands = []
    if packages and not find_spec('pip'):
        of_apt.append('python3-pip')
    if of_apt:
        commands.append(f'sudo apt install {" ".join(of_apt)}')
    if packages:
        commands.append(shlex.join([
            sys.executable, '-m', 'pip', 'install', '--user', '--break-system-packages',
            *packages, NUMPY_OF_APT]))
    return ' && '.join(commands)


def missing(purpose: str, *modules: str) -> MissingDependencyError:
    """Return the error of libraries of LIBRARIES that are not installed."""
    names = [LIBRARIES[module].name for module in modules]
    which = f'library {names[0]}' if len(names) == 1 else (
        f'libraries {", ".join(names[:-1])} and {names[-1]}')
    return MissingDependencyError(
        f'{purpose} needs the {which}, which cannot be imported. Install '
        f'{"it" if len(names) == 1 else "them"}: {install_command(*modules)}')


def _is_importable(module: str) -> bool:
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True


def _belongs_to_system() -> bool:
    """
    Return whether apt manages this interpreter, so that a plain `pip install` is refused.

    The file is that of PEP 668. A virtual environment is exempt.
    """
    marker = Path(sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED')
    return sys.prefix == sys.base_prefix and marker.exists()
