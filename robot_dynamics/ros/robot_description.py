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

"""Where a node's URDF comes from: a parameter, a file, a package, or the embedded arm."""

from pathlib import Path

from robot_dynamics.exceptions import InvalidInputError, MissingDependencyError, ModelError
from robot_dynamics.planar_urdf import default_arm_urdf
from robot_dynamics.ros.parameters import ParameterSpec, Type, Values

DESCRIPTION_SPECS = (
    ParameterSpec(
        'robot_description', Type.STRING, '',
        'The URDF of the arm, as XML.', read_only=True),
    ParameterSpec(
        'robot_description_file', Type.STRING, '',
        'The URDF as a file: a path, or package://PACKAGE/PATH; .xacro files are expanded where '
        'xacro is installed.', read_only=True),
    ParameterSpec(
        'joints', Type.STRING_ARRAY, [],
        'The actuated joints, in the order of all arrays. Empty: all that move and do not mimic, '
        'in the order of the URDF. Moving joints left out are locked.', read_only=True),
    ParameterSpec(
        'gravity', Type.DOUBLE_ARRAY, [0.0, 0.0, -9.81],
        'Acceleration of gravity in the base frame [m/s^2].', read_only=True,
        minimum=-1000.0, maximum=1000.0),
)


def description_from_parameters(values: Values) -> str | None:
    """
    Return the URDF that the parameters give, or None where they give none.

    Raises InvalidInputError or ModelError where they give two, or a file that cannot be read.
    """
    xml, file = values['robot_description'], values['robot_description_file']
    if xml and file:
        raise InvalidInputError(
            f'robot_description_file is {file!r} and robot_description is given too, '
            'expected one of them')
    return read_description_file(file) if file else xml or None


def embedded_description() -> str:
    """Return the URDF of the planar two-link arm."""
    return default_arm_urdf()


def read_description_file(file: str) -> str:
    """Return the URDF in a file, expanding xacro; raise ModelError where that fails."""
    path = _resolve(file)
    if path.suffix == '.xacro':
        return _expand_xacro(path)
    try:
        return path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(
            f'robot_description_file is {file!r}, which cannot be read: {error}') from None


def _resolve(file: str) -> Path:
    scheme, separator, rest = file.partition('://')
    if not separator:
        return Path(file).expanduser()
    if scheme == 'file':
        return Path(rest)
    if scheme != 'package':
        raise ModelError(
            f'robot_description_file is {file!r}, expected a path, file:// or package://')
    from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
    package, _, inside = rest.partition('/')
    try:
        return Path(get_package_share_directory(package)) / inside
    except (PackageNotFoundError, ValueError):
        raise ModelError(
            f'robot_description_file is {file!r}, but there is no package {package!r} in this '
            'environment') from None


def _expand_xacro(path: Path) -> str:
    try:
        import xacro
    except ImportError:
        raise MissingDependencyError(
            f'robot_description_file is {str(path)!r}, which needs the package xacro '
            '(apt install ros-jazzy-xacro, or pip install xacro)') from None
    try:
        return str(xacro.process_file(str(path)).toxml())
    except Exception as error:  # xacro raises what the document makes it raise
        raise ModelError(
            f'robot_description_file: xacro cannot expand {str(path)!r}: {error}') from None
