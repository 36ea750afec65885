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

"""Values of the launch arguments, for tests."""

from pathlib import Path

from robot_dynamics.ros.launch_arguments import (
    ARGUMENTS,
    ArmArguments,
    check_arm_arguments,
    DYNAMICS,
    SIMULATED_ARM,
)

BOTH = (SIMULATED_ARM, DYNAMICS)


def checked(nodes: tuple[str, ...] = BOTH, outer: str = '', **values: str) -> ArmArguments:
    """Return the checked arguments, with defaults for those that are not given."""
    defaults = {name: default for name, (default, _) in ARGUMENTS.items()}
    return check_arm_arguments({**defaults, **values}, nodes, outer)


def write(path: Path, text: str) -> str:
    path.write_text(text, encoding='utf-8')
    return str(path)
