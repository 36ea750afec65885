# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Find a trajectory that excites all parameters of an arm, for identify.

It is a Fourier series from rest to rest within the limits of the arm, with a small condition
number.

Exit status: 0 done; 2 a mistake in the arguments, or no motion can be found; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from robot_dynamics.joints.units import units_of
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.tools import command_line
from robot_dynamics.trajectories.files import write_trajectory
from robot_dynamics_tools import options
from robot_dynamics_tools.excitation.excitation import Excitation, find_excitation, GENERATIONS
from robot_dynamics_tools.excitation.excitation_limits import motion_limits
from robot_dynamics_tools.excitation.excitation_trajectory import (
    exciting_trajectory,
    ExcitingTrajectory,
)
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.reporting.text_table import quantity_table


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='excite', description=__doc__)
    options.add_robot(parser, '--urdf', 'the planar two-link arm', 'FILE_OR_PACKAGE')
    options.add_output(parser, 'FILE', (
        'Output file of the trajectory_msgs/JointTrajectory (default: %(default)s)'),
        Path('trajectory.yaml'))
    options.add_parameters(
        parser, 'joints, gravity, friction, motors, effort.command_scale, effort.command_offset')
    parser.add_argument(
        '--joints', nargs='+', default=[], metavar='JOINT',
        help='Joints to move, like the parameter joints (default: all); the others are locked')
    parser.add_argument('--start', **options.number(
        None, 'Q', 'Joint positions at the start and the end of the motion, one per joint [rad] '
        'or [m] (default: a pose well within the limits)', nargs='+'))
    parser.add_argument('--harmonics', **options.number(
        5, 'N', 'Number of harmonics of the series; the highest frequency is N / duration [Hz]',
        int))
    for name, default, metavar, text in (
            ('duration', 10.0, 'S', 'Duration of the motion [s]'),
            ('lead', 3.0, 'S', 'Time to reach the start before the motion [s]'),
            ('position-margin', 0.05, 'X',
             'Fraction of each position range to keep free at each end'),
            ('velocity-scale', 0.6, 'X', 'Fraction of the velocity limits to use'),
            ('effort-scale', 0.8, 'X', 'Fraction of the effort limits to use'),
            ('acceleration', 6.0, 'X', 'Largest acceleration [rad/s²] or [m/s²]')):
        parser.add_argument(f'--{name}', **options.number(default, metavar, text))
    parser.add_argument('--seed', **options.number(
        0, 'N', 'Seed of the random search; the same seed gives the same trajectory on any '
        'processor', int))
    return options.run_tool(parser, _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    command_line.prepare_file(arguments.output, arguments.force)
    arm = arm_from_parameters(
        options.read_robot(arguments.urdf),
        options.read_parameters(arguments.parameters), arguments.joints)
    dynamics = ArmDynamics(arm)
    limits = motion_limits(
        dynamics, None if arguments.start is None else np.array(arguments.start),
        arguments.position_margin, arguments.velocity_scale, arguments.effort_scale,
        arguments.acceleration)
    print(f'Searching for {arm.name} ({arm.joint_count} joints) ...', flush=True)
    with Progress(GENERATIONS, 'generations') as progress:
        excitation = find_excitation(
            dynamics, limits, arguments.harmonics, arguments.duration, arguments.seed,
            lambda fraction: progress.update(fraction * GENERATIONS))
    found = exciting_trajectory(excitation, dynamics, arguments.lead)
    with command_line.writing(arguments.output) as new:
        write_trajectory(new, found.trajectory)
    _report(arm, excitation, found)
    print(f'Trajectory         {arguments.output}')
    print('Collisions are not checked. Run the trajectory slowly first.')
    return command_line.DONE


def _report(arm: ArmModel, excitation: Excitation, found: ExcitingTrajectory) -> None:
    rows: list[tuple[str, ...]] = [('joint', 'start', 'lowest', 'highest', 'velocity',
                                    'acceleration', 'effort')]
    for j, (name, kind, limit) in enumerate(zip(
            arm.joint_names, arm.joint_kinds, arm.limits.effort)):
        unit = units_of(kind).position
        rows.append((
            name, *(f'{x[j]:.3f} {unit}' for x in (
                excitation.limits.start, found.lowest, found.highest)),
            f'{found.velocity[j]:.3f} {unit}/s', f'{found.acceleration[j]:.3f} {unit}/s²',
            f'{found.effort[j]:.2f} {units_of(kind).effort}' + (
                f' ({100.0 * found.effort[j] / limit:.0f} %)' if np.isfinite(limit) else '')))
    print(f'\n{quantity_table(rows)}\n')
    random = excitation.random_conditions
    print(f'Condition number   {excitation.condition:.1f} of {excitation.parameter_count} base '
          f'parameters, friction and rotors; of {len(random)} random series within the same '
          f'limits:\n                   median {np.median(random):.1f}, best {random.min():.1f}')
    print(f'Motion             {found.lead:g} s to the start, then {excitation.duration:g} s; '
          f'{len(found.trajectory.points)} points, interpolation '
          f'error {found.interpolation_error:.1e} of the series')

