# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/images/double_pendulum.gif: the recursion at work, as `animate` draws it."""

from pathlib import Path
import sys

from robot_dynamics_tools.commands.animate import main as animate


def main(directory: Path) -> int:
    """Write the animation into a directory."""
    return animate(['--force', '-o', str(directory / 'double_pendulum.gif')])


if __name__ == '__main__':
    sys.exit(main(Path(sys.argv[1])))
