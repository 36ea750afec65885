# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The executable `dynamics`, also `python -m robot_dynamics_tools`: the verbs of `ros2 dynamics`.

They need no ros2cli. Verbs that are tools start without ROS.
"""
# PYTHON_ARGCOMPLETE_OK

from collections.abc import Sequence
import os
from pathlib import Path
import sys

from robot_dynamics.dependencies import require_ros
from robot_dynamics.tools.command_line import run_tool
from robot_dynamics_tools.ros2_dynamics.tools import is_tool, run_tool_verb


def main(argv: Sequence[str] | None = None) -> int:
    """Run a verb; return its exit status."""
    words = sys.argv[1:] if argv is None else list(argv)
    if start := int(os.environ.get('_ARGCOMPLETE', 0)):  # Tab; the words before are skipped
        *words, last = os.environ['COMP_LINE'].split(' ')[start:]
        if words and is_tool(words[0], [*words[1:], last]):
            os.environ['_ARGCOMPLETE'] = str(start + 1)

    def run() -> int:
        if words and is_tool(words[0], words[1:]):
            return run_tool_verb(words[0], words[1:])
        require_ros('the tool')
        from robot_dynamics_tools.ros2_dynamics.verbs import main as run_verb
        return run_verb(words)

    return run_tool(' '.join(['dynamics', *words[:1]]), run)


def tool() -> int:
    """Run the tool with the name of the executable, whatever its arguments are."""
    name = Path(sys.argv[0]).name.removeprefix('robot_dynamics_')
    return run_tool(name, lambda: run_tool_verb(name, sys.argv[1:]))


if __name__ == '__main__':
    sys.exit(main())
