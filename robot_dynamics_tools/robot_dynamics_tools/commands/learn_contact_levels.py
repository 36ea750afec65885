# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Learn the levels of ~/contacts from recordings without contact.

Exit status: 0 done; 2 a mistake in the arguments, or a recording cannot be used.
"""

import argparse
from collections.abc import Sequence
import json

from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.analysis import contact_learning
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.reporting.text_table import text_table


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='learn_contact_levels', description=__doc__)
    options.add_recordings(parser, None)
    options.add_parameters(parser, (
        'joints, friction, motors, measured_effort, external_effort_bandwidth (not payload.*)'))
    parser.add_argument('--alarms-per-hour', **options.number(
        1.0, 'RATE', 'Most false alarms per hour of all joints together'))
    options.add_output(parser, 'FILE', (
        'Parameter file for dynamics_node. Without it, the levels are only printed.'))
    parser.add_argument('--json', action='store_true', help='Print the result as JSON.')
    parser.set_defaults(cutoff=None)
    return options.run_tool(parser, _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    rate, output = arguments.alarms_per_hour, arguments.output
    if output is not None:
        command_line.prepare_file(output, arguments.force)
    found, joints = contact_learning.levels_from_bags(
        find_recordings(arguments.bags), options.read_settings(arguments), rate)
    columns = found.levels.effort, found.levels.per_velocity, found.exceeded
    data = {
        'duration_s': found.duration, 'alarms_per_hour': rate, 'joints': list(joints),
        **{name: values.tolist() for name, values in zip(
            ('effort', 'effort_per_velocity', 'by_largest'), columns)}}
    lines = [
        f'Levels for at most {rate:g} false alarms per hour, extrapolated from '
        f'{found.duration:.0f} s without contact',
        text_table(['joint', 'at rest', 'per velocity', 'by the largest recorded'], [
            [name, *(f'{value:.4g}' for value in values)]
            for name, *values in zip(joints, *columns)], left_columns=1)]
    kept = 3600.0 * contact_learning.EXPECTED / found.duration
    if rate < kept:
        lines.append(
            f'The recording shows at least {kept:.3g} per hour. {rate:g} per hour is an upper '
            'bound, with slightly higher levels: record '
            f'{contact_learning.EXPECTED / rate:.2g} h to show it')
    if output is not None:
        command_line.write_file(output, contact_learning.parameter_text(found, joints, rate))
        data['output'] = str(output)
        lines.append(f'Written: {output}, a parameter file of dynamics_node')
    print(json.dumps(data, indent=2) if arguments.json else '\n'.join(lines))
    return command_line.DONE
