# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Write an arm, for example an identified one, as a model of MuJoCo (MJCF).

It has inertials, joints with limits, rotors and friction, motors and gravity, and no geometry.

Exit status: 0 written; 1 the file cannot be written; 2 a mistake in the arguments, or MuJoCo has
no such arm.
"""

import argparse
from collections.abc import Sequence
import sys

from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='export_mjcf', description=__doc__)
    options.add_robot(parser, '--urdf', 'the planar two-link arm', 'FILE_OR_PACKAGE')
    options.add_parameters(
        parser, 'joints, gravity, friction, motors, effort.command_scale, effort.command_offset')
    options.add_output(parser, 'FILE', 'Output file (default: stdout)')
    return options.run_tool(parser, _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    arm = arm_from_parameters(
        options.read_robot(arguments.urdf),
        options.read_parameters(arguments.parameters))
    command_line.write_output(arguments.output, arm_to_mjcf(arm), arguments.force)
    omitted = arm.friction.omitted
    if omitted:
        print(f'export_mjcf: MuJoCo has no counterpart of {", ".join(omitted)}', file=sys.stderr)
    return command_line.DONE
