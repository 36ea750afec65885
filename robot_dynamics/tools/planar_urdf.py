# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Write the URDF of a planar arm from its masses, lengths and inertias."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys

from robot_dynamics.planar import urdf
from robot_dynamics.planar.chain import PlanarChain
from robot_dynamics.planar.two_link import PlanarTwoLink
from robot_dynamics.tools import command_line


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run the tool, and return its exit status.

    0: written; 1: the file cannot be written; 2: the arm cannot be built. For status 1 and 2, one
    line on stderr has the reason.
    """
    arguments = _parser().parse_args(argv)
    return command_line.run_tool('planar_urdf', partial(_run, arguments))


def _parser() -> command_line.Parser:
    parser = command_line.Parser(
        prog='planar_urdf', formatter_class=argparse.HelpFormatter,
        description='Write the URDF of a planar arm, with one value per link, base first. '
                    'Without arguments: the default two-link arm of this package.')
    own = PlanarChain.from_two_link(PlanarTwoLink())
    for flag, unit, meaning, default in (
        ('--masses', 'kg', 'mass', _in_words(own.masses)),
        ('--lengths', 'm', 'length', _in_words(own.lengths)),
        ('--com-distances', 'm', 'centre of mass: distance from the joint',
         _in_words(own.com_distances)),
        ('--inertias', 'kg·m²', 'moment of inertia about the centre of mass',
         _in_words(own.inertias)),
        ('--viscous', 'N·m·s/rad', 'viscous friction', '0'),
        ('--coulomb', 'N·m', 'Coulomb friction', '0'),
        ('--effort-limits', 'N·m', 'effort limits',
         f'{_in_words(urdf.DEFAULT_EFFORT_LIMITS)} for the default links, '
         f'{urdf.GENEROUS_EFFORT_LIMIT:g} for others'),
        ('--velocity-limits', 'rad/s', 'velocity limits',
         f'{_in_words(urdf.DEFAULT_VELOCITY_LIMITS)} for the default links, '
         f'{urdf.GENEROUS_VELOCITY_LIMIT:g} for others'),
    ):
        parser.add_argument(
            flag, type=float, nargs='+', metavar='X',
            help=f'[{unit}] {meaning} (default: {default})')
    parser.add_argument(
        '--name', default='planar_arm', help='name of the robot (default: %(default)s)')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE', help='output file (default: stdout)')
    command_line.add_force(parser)
    return parser


def _in_words(values: Sequence[float]) -> str:
    return ' '.join(f'{value:g}' for value in values)


def _run(arguments: argparse.Namespace) -> int:
    command_line.write_output(arguments.output, _urdf(arguments), arguments.force)
    return command_line.DONE


def _urdf(arguments: argparse.Namespace) -> str:
    own = PlanarChain.from_two_link(PlanarTwoLink())
    given = (arguments.masses, arguments.lengths, arguments.com_distances, arguments.inertias)
    # The limits of the default arm do not apply to links of the user.
    is_default = all(values is None for values in given)
    return urdf.planar_arm_urdf(
        arguments.masses or own.masses,
        arguments.lengths or own.lengths,
        arguments.com_distances or own.com_distances,
        arguments.inertias or own.inertias,
        viscous_friction=arguments.viscous or 0.0,
        coulomb_friction=arguments.coulomb or 0.0,
        effort_limits=arguments.effort_limits or (
            urdf.DEFAULT_EFFORT_LIMITS if is_default else urdf.GENEROUS_EFFORT_LIMIT),
        velocity_limits=arguments.velocity_limits or (
            urdf.DEFAULT_VELOCITY_LIMITS if is_default else urdf.GENEROUS_VELOCITY_LIMIT),
        name=arguments.name,
    )


if __name__ == '__main__':
    sys.exit(main())
