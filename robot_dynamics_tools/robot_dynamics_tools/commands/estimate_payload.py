# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Estimate mass, first moments and inertia of what is attached to a link.

Reads recorded joint states with effort: static holds in several poses, or a motion.

Exit status: 0 done; 1 mass or first moments are not observable or implausible, or some recordings
failed; 2 a mistake in the arguments, or no recording can be used; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
import json

from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.estimation.priors import GIVEN_DEVIATION, SCALE_DEVIATION
from robot_dynamics_tools.payload_estimation import summary
from robot_dynamics_tools.payload_estimation.recordings import estimate_from_bags, RecordedPayload
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.recordings.sample_faults import counted
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.reporting.text_table import text_table


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='estimate_payload', description=__doc__)
    options.add_recordings(parser, None)
    parser.add_argument(
        '--link', required=True, metavar='NAME',
        help='Link to which the unknown body is attached; the URDF must not contain the body')
    options.add_cutoff(parser, '5, or less for slow joint states')
    parser.add_argument('--scale-deviation', **options.number(
        None, 'SHARE', 'Relative standard deviation of the effort scales, unless --parameters has '
        f'effort.report_covariance; 0 for exact efforts (default: {SCALE_DEVIATION:g}, or '
        f'{GIVEN_DEVIATION:g} with effort.report_scale in --parameters)',
        options.number_in(0.0, 1.0)))
    options.add_parameters(parser, 'joints, gravity, friction, motors, measured_effort')
    parser.add_argument(
        '--json', action='store_true', help='Print the result as JSON instead of text')
    return options.run_tool(parser, _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    bags = find_recordings(arguments.bags)
    settings = options.read_settings(arguments)
    with Progress(len(bags), 'recordings') as progress:
        found = estimate_from_bags(
            bags, arguments.link, settings, progress.advance, arguments.scale_deviation)
    if arguments.json:
        print(json.dumps({
            **summary.as_dictionary(found.estimate),
            'recordings': [str(bag) for bag in found.bags],
            'failed': {str(bag): error for bag, error in found.failed}}, indent=2))
    else:
        print_payload(found)
    options.print_failures('estimate_payload', found.failed)
    estimate = found.estimate
    is_good = estimate.is_observable and not estimate.implausible and not found.failed
    return command_line.DONE if is_good else command_line.FAILED


def print_payload(found: RecordedPayload) -> None:
    """Print the estimate, its verdicts, and the advice."""
    estimate = found.estimate
    rows = summary.parameter_rows(
        estimate.values, estimate.deviations, estimate.per_percent, estimate.verdicts)
    print(summary.headline(estimate))
    print(f'{counted(len(found.bags), "recording")}, {summary.data_text(estimate)}')
    print(f'{summary.fit_text(estimate)}\n')
    print(text_table(rows[0], rows[1:], left_columns=1))
    for title, lines in (
            ('Implausible:', estimate.implausible),
            ('To make parameters observable:', estimate.advice),
            ('Dry friction at rest:', (estimate.friction,)),
            ('Remarks:', (*estimate.remarks, *found.remarks))):
        options.print_list(title, lines)
