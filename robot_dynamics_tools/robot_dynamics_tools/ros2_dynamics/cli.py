# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

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
    from robot_dynamics_tools.ros2_dynamics.verbs import main as run_verb
    return run_verb(argv)
