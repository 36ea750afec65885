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

"""The executable `dynamics`: the verbs of `ros2 dynamics` without ros2cli."""
# PYTHON_ARGCOMPLETE_OK

from collections.abc import Sequence
from functools import partial

from robot_dynamics.dependencies import require_ros
from robot_dynamics.tools.command_line import run_tool


def main(argv: Sequence[str] | None = None) -> int:
    """Run a verb; return its exit status."""
    return run_tool('dynamics', partial(_run, argv))


def _run(argv: Sequence[str] | None) -> int:
    require_ros('the tool')
    from robot_dynamics.tools.ros2_dynamics.verbs import main as run_verb
    return run_verb(argv)
