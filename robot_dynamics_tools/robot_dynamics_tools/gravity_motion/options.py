# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The options of `calibrate_gravity --move`."""

import argparse
from pathlib import Path


def add_motion_options(parser: argparse.ArgumentParser) -> None:
    """Add --move and the options of the motion."""
    group = parser.add_argument_group('motion of the arm')
    group.add_argument(
        '--move', action='store_true',
        help='Move the arm of a running dynamics_node through poses, record, and compute from the '
             'recording. Collisions are not checked')
    group.add_argument(
        '--preview', action='store_true',
        help='With --move: print the poses and their gravity torques, and do not move the arm')
    group.add_argument(
        '--yes', action='store_true',
        help='Move without the question on the terminal, for scripts')
    group.add_argument(
        '--recording', type=Path, metavar='DIR',
        help='New directory of the recording; that with the weight is DIR-with-weight (default: '
             'gravity-<time>)')
    group.add_argument(
        '--with-weight-after', action='store_true',
        help='Record a second time with the weight of --weight-mass, --weight-link and '
             '--weight-position, which the operator attaches when the tool asks for it')
    group.add_argument(
        '--poses', type=Path, metavar='FILE',
        help='YAML file with the list `poses` of JOINT: POSITION in rad or m (default: poses that '
             'are selected for this arm)')
    group.add_argument(
        '--count', type=int, default=10, metavar='N',
        help='Number of selected poses, 8 to 20 (default: %(default)d)')
    group.add_argument(
        '--seed', type=int, default=0, metavar='N',
        help='Seed of the selection of the poses (default: %(default)d)')
    group.add_argument(
        '--range', nargs=3, action='append', default=[], metavar=('JOINT', 'MIN', 'MAX'),
        dest='ranges',
        help='Range of a joint at the poses and between them [rad] or [m]; may be repeated '
             '(default: the position limits; without limits, one turn around 0)')
    group.add_argument(
        '--hold', type=float, default=2.0, metavar='S',
        help='Time at rest at each pose, after the motion from each side [s] (default: '
             '%(default)g)')
    for name, words in (
            ('approach', 'Distance from which each pose is approached, on both sides [rad] or [m] '
                         '(default: 0.1 rad, 0.02 m, at most 0.05 of the range)'),
            ('step', 'Largest displacement of a joint per move [rad] or [m] (default: 0.5 rad, '
                     '0.1 m)'),
            ('velocity', 'Largest velocity of a joint [rad/s] or [m/s] (default: 0.5 rad/s, '
                         '0.1 m/s); at most half of its limit'),
            ('tolerance', 'Largest distance of a measured position at rest from its goal [rad] or '
                          '[m]; an arm with wrong torque constants sags (default: 0.2 rad, '
                          '0.05 m)')):
        group.add_argument(f'--{name}', type=float, metavar='X', help=words)
    group.add_argument(
        '--node', default='', metavar='NODE',
        help='Name of the dynamics node with its namespace (default: the only one that runs)')
    group.add_argument(
        '--timeout', type=float, default=5.0, metavar='S',
        help='Time to search for the node, and to wait for each answer [s] (default: '
             '%(default)g)')
