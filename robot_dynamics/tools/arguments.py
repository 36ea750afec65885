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

"""The argument `--urdf` of the tools: a file, or one of a package."""

from pathlib import Path

from robot_dynamics.urdf.description_file import read_description


def read_robot(text: str) -> str:
    """
    Return the URDF of a path, or of file:// or package://; xacro is expanded.

    ROS is needed for package:// alone. Raises ModelError where there is none.
    """
    if '://' not in text:
        return read_description(Path(text).expanduser(), '--urdf')
    from robot_dynamics.ros.robot_description import read_description_file
    return read_description_file(text)
