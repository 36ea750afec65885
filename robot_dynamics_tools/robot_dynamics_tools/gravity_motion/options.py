# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The options of `calibrate_gravity --move`."""

import argparse
from pathlib import Path

from robot_dynamics_tools.options import add_node, number


def add_motion_options(parser: argparse.ArgumentParser) -> None:
    """Add --move and the options of the motion."""
    group = parser.add_argument_group('motion of the arm')
    for name, text in (
            ('move', 'Move the arm of a running dynamics_node through poses, record, and compute '
                     'from the recording. Collisions are not checked'),
            ('preview', 'With --move: print the poses and their gravity torques, and do not move '
                        'the arm'),
            ('yes', 'Move without the question on the terminal, for scripts'),
            ('with-weight-after',
             'Record a second time with the weight of --weight-mass, --weight-link and '
             '--weight-position, which the operator attaches when the tool asks for it')):
        group.add_argument(f'--{name}', action='store_true', help=text)
    group.add_argument(
        '--recording', type=Path, metavar='DIR',
        help='New directory of the recording; that with the weight is DIR-with-weight (default: '
             'gravity-<time>)')
    group.add_argument(
        '--poses', type=Path, metavar='FILE',
        help='YAML file with the list `poses` of JOINT: POSITION in rad or m (default: poses that '
             'are selected for this arm)')
    group.add_argument('--count', **number(10, 'N', 'Number of selected poses, 8 to 20', int))
    group.add_argument('--seed', **number(0, 'N', 'Seed of the selection of the poses', int))
    group.add_argument(
        '--range', nargs=3, action='append', default=[], metavar=('JOINT', 'MIN', 'MAX'),
        dest='ranges',
        help='Range of a joint at the poses and between them [rad] or [m]; may be repeated '
             '(default: the position limits; without limits, one turn around 0)')
    group.add_argument('--hold', **number(
        2.0, 'S', 'Time at rest at each pose, after the motion from each side [s]'))
    for name, text in (
            ('approach', 'Distance from which each pose is approached, on both sides [rad] or [m] '
                         '(default: 0.1 rad, 0.02 m, at most 0.05 of the range)'),
            ('step', 'Largest displacement of a joint per move [rad] or [m] (default: 0.5 rad, '
                     '0.1 m)'),
            ('velocity', 'Largest velocity of a joint [rad/s] or [m/s] (default: 0.5 rad/s, '
                         '0.1 m/s); at most half of its limit'),
            ('tolerance', 'Largest distance of a measured position at rest from its goal [rad] or '
                          '[m]; an arm with wrong torque constants sags (default: 0.2 rad, '
                          '0.05 m)')):
        group.add_argument(f'--{name}', **number(None, 'X', text))
    add_node(group)
