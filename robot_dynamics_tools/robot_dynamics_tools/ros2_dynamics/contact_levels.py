# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verb `learn_contact_levels`: levels of contacts from recordings, without a node."""

from argparse import Namespace

from robot_dynamics.monitoring.contact_levels import EXPECTED
from robot_dynamics.reporting.text_table import text_table
from robot_dynamics.tools.command_line import prepare_file, write_file
from robot_dynamics_tools.analysis.contact_recording import levels_from_bags, parameter_text
from robot_dynamics_tools.options import read_settings
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.ros2_dynamics.answers import Answer


def answer_learn_contact_levels(_: object, arguments: Namespace) -> Answer:
    """Learn the levels, print them, and write their parameter file if a path is given."""
    rate, output = arguments.alarms_per_hour, arguments.output
    if output is not None:
        prepare_file(output, arguments.force)
    found, joints = levels_from_bags(
        find_recordings(arguments.bags), read_settings(arguments), rate)
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
    kept = 3600.0 * EXPECTED / found.duration
    if rate < kept:
        lines.append(
            f'The recording shows at least {kept:.3g} per hour. {rate:g} per hour is an upper '
            f'bound, with slightly higher levels: record {EXPECTED / rate:.2g} h to show it')
    if output is not None:
        write_file(output, parameter_text(found, joints, rate))
        data['output'] = str(output)
        lines.append(f'Written: {output}, a parameter file of dynamics_node')
    return Answer(data, '\n'.join(lines))
