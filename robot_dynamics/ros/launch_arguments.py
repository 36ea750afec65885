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

"""The files that arguments of launch files name, checked before any node starts."""

from pathlib import Path

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.robot_description import (
    description_path,
    embedded_description,
    read_description_file,
)


def parameter_files(params: str) -> list[str]:
    """
    Return the parameter file of the launch argument params, none if it is empty.

    Raises InvalidInputError if there is no such file.
    """
    if not params:
        return []
    path = Path(params).expanduser()
    _check_is_file('params', params, path, 'the path of a parameter file (YAML)')
    return [str(path)]


def launched_description(robot: str) -> str:
    """
    Return the URDF of the launch argument robot, that of the embedded arm if it is empty.

    Raises InvalidInputError if there is no such file, ModelError if it cannot be read.
    """
    if not robot:
        return embedded_description()
    path = description_path(robot, 'launch argument robot')
    _check_is_file('robot', robot, path, 'a URDF or .xacro file: a path or package://PACKAGE/PATH')
    return read_description_file(robot, 'launch argument robot')


def _check_is_file(argument: str, value: str, path: Path, expected: str) -> None:
    if not path.is_file():
        kind = 'a directory' if path.is_dir() else 'no such file'
        raise InvalidInputError(
            f'launch argument {argument} is {value!r}, which is {kind} '
            f'({path.absolute()}); expected {expected}. No node was started.')
