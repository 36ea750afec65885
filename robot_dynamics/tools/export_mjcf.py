# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Write an arm, for example an identified one, as a model of MuJoCo (MJCF)."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys

from robot_dynamics.tools.command_line import (
    add_force,
    add_parameters,
    add_robot,
    DONE,
    Parser,
    prepare_file,
    read_parameters,
    read_robot,
    run_tool,
    writing,
)


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run the tool, and return its exit status.

    0: written; 1: the file cannot be written; 2: the arguments are invalid, or MuJoCo has no such
    arm. For status 1 and 2, one line on stderr has the reason.
    """
    arguments = _parser().parse_args(argv)
    return run_tool('export_mjcf', partial(_run, arguments))


def _parser() -> Parser:
    parser = Parser(
        prog='export_mjcf', formatter_class=argparse.HelpFormatter,
        description='Write an arm as a model of MuJoCo (MJCF): inertials, joints with limits, '
                    'rotors and friction, motors, gravity. Geometry is not written.')
    add_robot(parser, '--urdf', 'the planar two-link arm', 'FILE_OR_PACKAGE')
    add_parameters(parser, 'joints, gravity, friction, motors, effort.scale, effort.offset')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE', help='Output file (default: stdout)')
    add_force(parser)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from robot_dynamics.model.arm_parameters import arm_from_parameters
    from robot_dynamics.model.mjcf import arm_to_mjcf
    if arguments.output is not None:
        prepare_file(arguments.output, arguments.force)
    arm = arm_from_parameters(
        read_robot(arguments.urdf), read_parameters(arguments.parameters))
    text = arm_to_mjcf(arm)
    if arguments.output is None:
        sys.stdout.write(text)
    else:
        with writing(arguments.output):
            arguments.output.write_text(text, encoding='utf-8')
    omitted = arm.friction.omitted
    if omitted:
        print(f'export_mjcf: MuJoCo has no counterpart of {", ".join(omitted)}', file=sys.stderr)
    return DONE


if __name__ == '__main__':
    sys.exit(main())
