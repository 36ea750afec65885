# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Identify masses, inertias, rotors and friction of an arm from recorded joint states with effort.

Writes a URDF, a parameter file for dynamics_node, and a report.

Exit status: 0 done; 1 some recordings failed, which are listed; 2 a mistake in the arguments, or
nothing could be identified; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.payload import make_payload
from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.analysis.batch import run_tasks
from robot_dynamics_tools.identification import bag_identification, summary
from robot_dynamics_tools.identification.pipeline import Observability, STAGES
from robot_dynamics_tools.identification.report import file_notes, FILES, write_identification
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.reporting.text_table import quantity_table, text_table


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='identify', description=__doc__)
    options.add_recordings(parser, None)
    parser.add_argument('--train-fraction', **options.number(
        0.6, 'SHARE', 'Fraction of the samples, from the first on, that is used for training; the '
        'others test the model. With 1, the model is tested on the cross-validation folds',
        options.number_in(0.001, 1.0)))
    parser.add_argument(
        '--samples', action='store_true',
        help='Also write the samples of the test part of each recording, with the effort of the '
             'model, to test_samples_RECORDING.csv')
    options.add_cutoff(parser)
    parser.add_argument(
        '--effort', choices=('auto', 'torque', 'current'), default='auto',
        help='Meaning of the recorded effort: torque (or force), or current. For current, the '
             'drive gains are identified with the masses of the URDF and of payloads as '
             'reference (default: auto, which is torque unless most joints have different '
             'gains)')
    parser.add_argument(
        '--payload', action='append', default=[], type=_payload,
        metavar='[RECORDING:]LINK=KG[,X,Y,Z]',
        help='Load that the arm carries in all recordings, or in the recording of this name: '
             'mass [kg] and centre of mass [m] in the frame of the link. It is neither identified '
             'nor part of the output; may be repeated')
    options.add_parameters(
        parser, 'joints, gravity, motors, measured_effort, '
                'effort.report_scale, effort.report_offset')
    parser.add_argument(
        '--dry-run', action='store_true',
        help='Read the recordings once, print what they determine, and write nothing')
    options.add_output(
        parser, 'DIR', 'Output directory (default: %(default)s)', Path('identified'))
    options.add_workers(parser)
    return options.run_tool(parser, lambda arguments: _run(arguments, argv), argv)


def _payload(text: str) -> tuple[str, str, tuple[float, ...]]:
    """Return the name of a recording, or '' for all, the link, and its values."""
    where, _, numbers = text.rpartition('=')
    recording, _, link = where.rpartition(':')
    try:
        values = tuple(float(number) for number in numbers.split(','))
    except ValueError:
        values = ()
    if not link or len(values) not in (1, 4):
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected LINK=KG or LINK=KG,X,Y,Z such as tool0=1.2,0,0,0.05, after '
            'RECORDING: for one recording')
    return recording, link, values


def _run(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    bags = find_recordings(arguments.bags)
    settings = options.read_settings(arguments)
    is_current = True if settings.seeks_stiffness or arguments.effort == 'current' else (
        None if arguments.effort == 'auto' else False)
    settings = replace(settings, effort_is_current=bool(is_current))
    payloads = tuple(
        (recording, make_payload(link, values[0], values[1:] or (0.0, 0.0, 0.0)))
        for recording, link, values in arguments.payload)
    identification = bag_identification.IdentificationSettings(
        settings, arguments.train_fraction, payloads)
    for recording in {'', *(recording for recording, _ in payloads)}:
        if recording and recording not in [bag.name for bag in bags]:
            raise InvalidInputError(
                f'--payload names the recording {recording!r}, expected one of '
                f'{[bag.name for bag in bags]}')
        identification.arm((), recording)  # report a mistake before the recordings are read
    samples = [f'test_samples_{bag.stem}.csv' for bag in bags if arguments.samples]
    kept = None
    if not arguments.dry_run:
        for name in (*FILES, *samples):
            command_line.prepare_file(arguments.output / name, arguments.force)
        directory = options.prepare_directory(arguments.output, [], arguments)
        kept = directory if len(bags) > 1 else None
    with Progress(3 * len(bags) + 2, 'steps') as progress:
        found = bag_identification.identify_bags(
            bags, identification, partial(
                run_tasks, workers=arguments.jobs, cache=kept, dask=arguments.dask,
                on_done=progress.advance),
            is_current,
            lambda stage: progress.advance() if stage in (STAGES[1], STAGES[3]) else None,
            arguments.samples, arguments.dry_run)
    if isinstance(found, Observability):
        options.print_list('Observable:', summary.observable_lines(found))
        return command_line.DONE
    paths = write_identification(
        found, settings.urdf, arguments.output, settings.parameters,
        command_line.origin_of('identify', argv, arguments.urdf, ''))
    print_identification(found, paths, file_notes(found.identification, settings.urdf))
    return command_line.FAILED if found.failed else command_line.DONE


def print_identification(
    found: bag_identification.BagIdentification, paths: Sequence[Path], notes: Sequence[str],
) -> None:
    """Print the results, the paths of the files, and notes about them."""
    identification = found.identification
    print(text_table([], summary.fact_rows(found)))
    options.print_list(
        'Contradictions, with their likely causes:',
        summary.recording_lines(found, 'contradictions'))
    options.print_list('Recordings:', summary.recording_lines(found, 'remarks'))
    print(f'\n{summary.residual_title(identification)}, RMS relative to the effort:')
    print(quantity_table(summary.residual_rows(identification)))
    print('\nResidual by the noise of the effort:')
    print(quantity_table(summary.noise_rows(found)[:options.LONGEST_LIST + 1]))
    print(f'\n{summary.FRICTION_TITLE}:')
    print(quantity_table(summary.friction_rows(identification)))
    if identification.gains is not None:
        print(f'\n{summary.GAIN_TITLE}:')
        print(quantity_table(summary.gain_rows(identification, identification.gains)))
    options.print_list('Warnings:', summary.warnings(identification))
    print('\nWritten:\n' + '\n'.join(f'  {path}' for path in paths))
    options.print_list('Notes on the files:', notes)
    options.print_failures('identify', found.failed)
