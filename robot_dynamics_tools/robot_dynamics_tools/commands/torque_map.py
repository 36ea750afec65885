# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw efforts or inertias over the positions of two joints, or of gravity over the workspace.

  gravity    the gravity-compensation torque g(q), and where it exceeds the limits
  inertia    the diagonal of the mass matrix, M_ii(q)
  motion     the effort of --velocity and --acceleration
  workspace  positions of the whole workspace at which gravity exceeds the effort limits

Exit status: 0 drawn; 1 the figure cannot be written; 2 a mistake in the arguments, or a file that
cannot be used.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.units import units_of
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model_check.html_page import Verdict
from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.animation.torque_tour import torque_frames
from robot_dynamics_tools.animation.video import FORMATS as VIDEO
from robot_dynamics_tools.animation.video import write_video
from robot_dynamics_tools.pictures import torque_grid
from robot_dynamics_tools.pictures.map_report import map_page, panel_verdict, workspace_verdicts
from robot_dynamics_tools.pictures.stick_figure import tool_link
from robot_dynamics_tools.pictures.torque_map import map_figure, MapPanel, POSES
from robot_dynamics_tools.pictures.workspace_map import map_gravity, workspace_figure
from robot_dynamics_tools.reporting.figures import save_figure
from robot_dynamics_tools.reporting.progress import Progress

GRAVITY, INERTIA, MOTION, WORKSPACE = 'gravity', 'inertia', 'motion', 'workspace'
PAGE = '.html'
FORMATS = ('.png', '.pdf', '.svg', PAGE)
MOVING_SAMPLES = 41
"""Positions of each joint in an animation."""
DEFAULT_ARM = 'the planar two-link arm of this package'
STEPS = 3
"""Steps of the progress display: computed, drawn, written."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='torque_map', description=__doc__)
    parser.add_argument(
        'what', nargs='?', default=GRAVITY, choices=(GRAVITY, INERTIA, MOTION, WORKSPACE),
        help='Drawn quantity (default: %(default)s)')
    options.add_robot(parser, '--urdf', 'the planar two-link arm', 'FILE')
    parser.add_argument(
        '--joints', nargs=2, default=[], metavar='JOINT',
        help='Joints along the axes (default: the two joints with the largest gravity torque)')
    parser.add_argument(
        '--at', nargs='+', default=[], metavar='JOINT',
        help='Joints whose effort or inertia is drawn (default: the joints along the axes)')
    for name, text in (
            ('position', 'Positions of all joints [rad] or [m], for the joints that are not along '
                         'an axis (default: 0, or the nearest limit)'),
            ('velocity', 'Velocity of all joints [rad/s] or [m/s], for motion (default: 0)'),
            ('acceleration',
             'Acceleration of all joints [rad/s²] or [m/s²], for motion (default: 0)')):
        parser.add_argument(f'--{name}', **options.number([], 'X', text, nargs='+'))
    parser.add_argument('--payload', **options.number(
        0.0, 'KG', 'Mass at the origin of --link [kg]'))
    parser.add_argument(
        '--link', metavar='NAME',
        help='Link that carries the payload and whose workspace is drawn (default: the last link)')
    parser.add_argument('--pose', **options.number(
        None, 'X', 'Positions along the axes at which the arm is drawn; may be repeated (default: '
        f'{POSES} × {POSES} evenly spaced poses)', nargs=2, action='append'))
    parser.add_argument('--samples', **options.number(
        torque_grid.SAMPLES, 'N', 'Number of positions of each of the two joints',
        options.number_in(3, 1001, int)))
    options.add_output(parser, 'FILE', (
        f'Output file: {", ".join(FORMATS)}; {PAGE} is a report with a verdict per joint; '
        f'{", ".join(VIDEO)} for {MOTION}: an animation of the arm and its efforts in motion '
        '(default: out/<name of the arm>_<what>.png)'))
    return options.run_tool(parser, lambda arguments: _run(arguments, argv), argv)


def _run(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    suffix = '.png' if arguments.output is None else arguments.output.suffix.lower()
    has_values = arguments.velocity or arguments.acceleration
    if suffix in VIDEO and (arguments.what != MOTION or has_values):
        raise InvalidInputError(
            f'the output is {str(arguments.output)!r}, an animation, expected {MOTION!r} '
            'without --velocity and --acceleration')
    if suffix not in (*FORMATS, *VIDEO):
        raise InvalidInputError(
            f'the figure is {str(arguments.output)!r}, expected a name that ends in one of '
            f'{[*FORMATS, *VIDEO]}')
    if arguments.what != MOTION and has_values:
        raise InvalidInputError(
            f'--velocity and --acceleration are given with {arguments.what!r}, expected '
            f'{MOTION!r}')
    arm = arm_from_urdf(options.read_robot(arguments.urdf))
    link = arguments.link or tool_link(arm)
    arm.link_frame(link, '--link')
    load = f', {arguments.payload:g} kg on {link}' if arguments.payload else ''
    arm = arm.with_payloads([make_payload(link, arguments.payload)])
    output = arguments.output or options.default_output(arm.name, f'_{arguments.what}.png')
    command_line.prepare_file(output, arguments.force)
    if suffix in VIDEO:
        return _animate(arguments, arm, output)
    with Progress(STEPS, 'steps') as progress:
        draw = _workspace if arguments.what == WORKSPACE else _map
        figure, said, verdicts = draw(arguments, arm, load, progress.advance)
        progress.advance()
        if suffix == PAGE:
            origin = command_line.origin_of('torque_map', argv, arguments.urdf, DEFAULT_ARM)
            command_line.write_file(output, map_page(
                f'{arm.name}{load}: {arguments.what}', verdicts, figure, origin))
        else:
            with command_line.writing(output) as new:
                save_figure(figure, new)
        progress.advance()
    print(f'{output.resolve()}: {said}')
    return command_line.DONE


def _animate(arguments: argparse.Namespace, arm: ArmModel, output: Path) -> int:
    grid = torque_grid.make_grid(arm, arguments.joints, arguments.position, MOVING_SAMPLES)
    shown = [torque_grid.joint_index(arm, '--at', name) for name in arguments.at]
    with command_line.writing(output) as new:
        count = write_video(new, torque_frames(arm, grid, shown or list(grid.joints)))
    print(f'{output.resolve()}: {count} frames, {output.stat().st_size / 1e6:.2f} MB')
    return command_line.DONE


def _workspace(
    arguments: argparse.Namespace, arm: ArmModel, load: str, on_computed: Callable[[], object],
) -> tuple[Any, str, list[Verdict]]:
    """Return the figure of a map over the workspace, its summary, and the verdicts."""
    link = arguments.link or tool_link(arm)
    found = map_gravity(arm, link)
    on_computed()
    figure = workspace_figure(
        f'{arm.name}{load}: gravity as a share of the effort limits, at the positions of {link}',
        arm, link, found)
    said = f'{100.0 * found.held:.1f} % of the positions tried can be held'
    return figure, said, workspace_verdicts(arm, found)


def _map(
    arguments: argparse.Namespace, arm: ArmModel, load: str, on_computed: Callable[[], object],
) -> tuple[Any, str, list[Verdict]]:
    """Return the figure of a map over two joints, its summary, and the verdicts."""
    grid = torque_grid.make_grid(arm, arguments.joints, arguments.position, arguments.samples)
    named = [torque_grid.joint_index(arm, '--at', name) for name in arguments.at]
    shown = named or list(grid.joints)
    values, title = _values(arguments, arm, grid)
    on_computed()
    panels = [_panel(arguments.what, arm, joint, values[..., joint]) for joint in shown]
    figure = map_figure(f'{arm.name}{load}: {title}', arm, grid, panels, arguments.pose or ())
    said = ', '.join(
        f'{panel.title} from {panel.values.min():.4g} to {panel.values.max():.4g} {panel.unit}'
        for panel in panels)
    return figure, said, [panel_verdict(panel) for panel in panels]


def _values(
    arguments: argparse.Namespace, arm: ArmModel, grid: torque_grid.PositionGrid,
) -> tuple[FloatArray, str]:
    """Return the drawn values of all joints (l, k, n), and their name."""
    if arguments.what == GRAVITY:
        return torque_grid.gravity_efforts(arm, grid), 'gravity-compensation torque g(q)'
    if arguments.what == INERTIA:
        return torque_grid.inertia_diagonal(arm, grid), 'diagonal of the mass matrix, M(q)'
    zero = np.zeros(arm.joint_count)
    v = arguments.velocity or zero
    a = arguments.acceleration or zero
    efforts = torque_grid.motion_efforts(arm, grid, v, a)
    return efforts, f'effort τ at the velocity {_list(v)} and the acceleration {_list(a)}'


def _panel(what: str, arm: ArmModel, joint: int, values: FloatArray) -> MapPanel:
    name, kind = arm.joint_names[joint], arm.joint_kinds[joint]
    if what == INERTIA:
        return MapPanel(
            f'Inertia at {name}', values, 'kg' if kind == 'prismatic' else 'kg·m²', False)
    return MapPanel(
        f'Effort at {name}', values, units_of(kind).effort, True, float(arm.limits.effort[joint]))


def _list(values: Any) -> str:
    return '(' + ', '.join(f'{value:g}' for value in values).replace('-', '−') + ')'
