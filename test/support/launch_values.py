# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Values of the launch arguments, for tests."""

from pathlib import Path

from robot_dynamics.ros.launch_arguments import ARGUMENTS, arm_arguments, ArmArguments

DYNAMICS = 'dynamics'
BOTH = ('simulated_arm', DYNAMICS)


def arm_of(nodes: tuple[str, ...] = BOTH, outer: str = '', **values: str) -> ArmArguments:
    """Return the arguments of an arm, with defaults for those that are not given."""
    defaults = {name: default for name, (default, _) in ARGUMENTS.items()}
    return arm_arguments({**defaults, **values}, nodes, outer)


def write(path: Path, text: str) -> str:
    path.write_text(text, encoding='utf-8')
    return str(path)
