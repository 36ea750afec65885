# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/images/torque*, as `torque_map` draws them: the default arm, and a UR10."""

from pathlib import Path
import sys

from robot_dynamics_tools.commands.torque_map import main as torque_map

sys.path.insert(0, str(Path(__file__).parents[2] / 'test' / 'support'))
from robots import robot_path  # noqa: E402


def main(directory: Path) -> int:
    """Write the pictures into a directory."""
    ur10 = ['--urdf', str(robot_path('ur10'))]
    pictures = {
        'torque_map.png': ['gravity', '--payload', '8'],
        'torque_map_inertia.png': ['inertia'],
        'torques_in_motion.gif': ['motion'],
        'torque_map_workspace.png': ['workspace', '--payload', '8'],
        'torque_map_ur10.png': [*ur10, 'workspace', '--payload', '20'],
    }
    return max(
        torque_map([*arguments, '--force', '-o', str(directory / name)])
        for name, arguments in pictures.items())


if __name__ == '__main__':
    sys.exit(main(Path(sys.argv[1])))
