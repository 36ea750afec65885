# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A separate colcon workspace with a copy of this repository, for tests of the ROS tools."""

from collections.abc import Iterator, Mapping
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

import children

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ('robot_dynamics', 'robot_dynamics_interfaces', 'robot_dynamics_tools')
SEARCH_PATHS = ('AMENT_PREFIX_PATH', 'CMAKE_PREFIX_PATH', 'COLCON_PREFIX_PATH', 'LD_LIBRARY_PATH',
                'PATH', 'PYTHONPATH')
PROGRAMS = {
    'colcon': [sys.executable, '-m', 'colcon'],
    'rosdep': [sys.executable, '-c', 'from rosdep2.main import rosdep_main; rosdep_main()']}
"""The programs of this interpreter; those on the PATH may be of another one."""
NOT_SOURCES = ('.*', '__pycache__', '*.egg-info', 'build', 'install', 'log', 'out')


def is_of_this_project(path: Path) -> bool:
    """Return whether a directory of a search path belongs to an installation of this package."""
    prefixes = [path, *path.parents]
    return any((prefix / 'share' / name / 'package.xml').exists()
               for prefix in prefixes for name in PACKAGES) or any(
                   (path / name).is_dir() for name in PACKAGES)


def without_this_project(environment: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the variables of an environment that has ROS and nothing of this project."""
    for name, value in environment.items():
        if name in SEARCH_PATHS:
            kept = [part for part in value.split(os.pathsep)
                    if part and not is_of_this_project(Path(part))]
            yield name, os.pathsep.join(kept)
        elif not name.startswith(('PYTEST_', 'COLCON_')):
            yield name, value


def documented(start: str) -> str:
    """Return the one command of docs/installation.md that starts so."""
    lines = (ROOT / 'docs' / 'installation.md').read_text(encoding='utf-8').splitlines()
    command, = {line for line in lines if line.startswith(f'{start} ')}
    return command


class Workspace:
    """A directory with src/robot_dynamics; `run` runs commands there as a terminal does."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.source = directory / 'src' / 'robot_dynamics'
        shutil.copytree(ROOT, self.source, ignore=shutil.ignore_patterns(*NOT_SOURCES))
        self.environment = dict(without_this_project(os.environ))
        defaults = directory / 'defaults.yaml'  # what ROS from wheels needs for the messages
        defaults.write_text(json.dumps({'build': {'cmake-args': [
            '-DBUILD_TESTING=OFF', f'-DPython3_EXECUTABLE={sys.executable}',
            f'-DPYTHON_EXECUTABLE={sys.executable}']}}), encoding='utf-8')
        self.environment['COLCON_DEFAULTS_FILE'] = str(defaults)
        if shutil.which('ninja'):
            self.environment['CMAKE_GENERATOR'] = 'Ninja'

    def run(self, command: str, *more: str) -> 'subprocess.CompletedProcess[str]':
        """Return the result of a documented command line with further arguments."""
        program, *arguments = command.split()
        return children.run(
            [*PROGRAMS[program], *arguments, *more], cwd=self.directory, text=True,
            timeout=children.LONG, env=self.environment, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT)
