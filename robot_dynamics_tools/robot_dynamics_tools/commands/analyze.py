# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Compare the measured effort of recorded joint states with inverse dynamics of a model.

Prints the residual per joint and the use of limits, and writes them with the effort by term.
Reads rosbag2 recordings (sqlite3 or MCAP).

Exit status: 0 done; 1 some recordings failed, which are listed; 2 a mistake in the arguments, or
no recording could be analysed; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from robot_dynamics.dependencies import require
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.analysis import tasks
from robot_dynamics_tools.analysis.bag_analysis import merged_statistics, STEPS
from robot_dynamics_tools.analysis.batch import run_tasks, TaskOutcome
from robot_dynamics_tools.analysis.report import limit_use_rows, residual_rows
from robot_dynamics_tools.recordings.bag_files import find_recordings, relative_names
from robot_dynamics_tools.recordings.topics import ROBOT_DESCRIPTION
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.reporting.text_table import percent, quantity_table, text_table


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='analyze', description=__doc__)
    options.add_recordings(parser, 'the description in the recording')
    options.add_cutoff(parser)
    options.add_parameters(
        parser, 'joints, gravity, friction, motors, measured_effort, '
                'effort.report_scale, effort.report_offset')
    options.add_output(parser, 'DIR', (
        f'Output directory of {tasks.REPORT}, {tasks.PICTURE}, {tasks.TABLE} and the recording '
        f'{tasks.TERMS}/; for several recordings, one directory each'))
    parser.add_argument(
        '--parquet', action='store_true', help=f'Also write {tasks.PARQUET} (extra: parquet)')
    parser.add_argument(
        '--no-report', action='store_true',
        help=f'Write neither {tasks.REPORT} nor {tasks.PICTURE}')
    options.add_workers(parser)
    return options.run_tool(parser, lambda arguments: _run(arguments, argv), argv)


def _run(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    if arguments.parquet:
        require('Parquet', 'pyarrow')
        if arguments.output is None:
            raise InvalidInputError('--parquet is given without --output, the output directory')
    bags = find_recordings(arguments.bags, arguments.output)
    names = relative_names(bags)
    settings = options.read_settings(arguments)
    task = tasks.AnalysisTask(settings, _outputs(arguments), origin=command_line.origin_of(
        'analyze', argv, arguments.urdf, f'{ROBOT_DESCRIPTION} of the recording'))
    kept, each = None, None
    if task.outputs:
        places = [arguments.output.resolve() / (name if len(bags) > 1 else '') for name in names]
        kept = options.prepare_directory(
            arguments.output, [place / name for place in places for name in task.outputs],
            arguments)
        each = [replace(task, directory=str(place)) for place in places]
    single = len(bags) == 1 and arguments.dask is None  # progress over its steps
    steps = len(STEPS) + len(task.outputs) if single else len(bags)
    with Progress(steps, 'steps' if single else 'recordings') as progress:
        advance = progress.advance
        outcomes = run_tasks(
            partial(tasks.analyze_task, on_step=advance) if single else tasks.analyze_task, bags,
            task, arguments.jobs, kept, arguments.dask, None if single else advance,
            tasks.outputs_exist, each)
    results = [outcome.result for outcome in outcomes if outcome.result is not None]
    if len(bags) == 1 and results:
        print_one(results[0], outcomes[0].resumed)
    elif results:
        print_many(outcomes, names)
        if task.outputs:
            print(f'\nWritten to {arguments.output}, a directory for each recording')
    failed = [(name, outcome.error) for name, outcome in zip(names, outcomes) if outcome.error]
    options.print_failures('analyze', failed)
    if not failed:
        return command_line.DONE
    return command_line.FAILED if results else command_line.MISTAKE


def _outputs(arguments: argparse.Namespace) -> tuple[str, ...]:
    is_left_out = {tasks.PARQUET: not arguments.parquet, tasks.REPORT: arguments.no_report}
    return tuple(name for name in tasks.OUTPUTS
                 if arguments.output is not None and not is_left_out.get(name, False))


def print_one(result: tasks.AnalysisResult, is_resumed: bool) -> None:
    """Print the analysis of one recording."""
    print(text_table([], result.facts))
    options.print_list('Remarks:', result.remarks)
    _print_figures([result])
    if result.written:
        print('\nWritten:\n' + '\n'.join(f'  {path}' for path in result.written))
    if is_resumed:
        print('(cached result from an earlier run)')


def print_many(
    outcomes: Sequence[TaskOutcome[tasks.AnalysisResult]], names: Sequence[str],
) -> None:
    """Print a line per analysed recording, and the combined figures per arm."""
    rows = [('recording', 'samples', 'remarks', 'relative residual per joint')]
    arms: dict[tuple[str, ...], list[tasks.AnalysisResult]] = {}
    for name, outcome in zip(names, outcomes):
        if outcome.result is None:
            continue
        result = outcome.result
        relative = 'no effort' if result.statistics is None else ' '.join(
            f'{percent(fraction):>8}' for fraction in result.statistics.relative)
        rows.append((name, str(result.counted), str(len(result.remarks) or '-'), relative))
        arms.setdefault((result.arm, *result.joint_names), []).append(result)
    print(quantity_table(rows))
    resumed = sum(outcome.resumed for outcome in outcomes)
    if resumed:
        print(f'{resumed} of them from an earlier run')
    for name, results in ((key[0], value) for key, value in arms.items()):
        print(f'\nTogether: {len(results)} recordings of {name}, '
              f'{sum(result.counted for result in results)} samples')
        _print_figures(results)


def _print_figures(results: Sequence[tasks.AnalysisResult]) -> None:
    first = results[0]
    known = [result.statistics for result in results if result.statistics is not None]
    if known:
        print('\nResidual, measured − model:')
        print(quantity_table(residual_rows(merged_statistics(known), first.joint_kinds)))
    whose = 'measured' if len(known) == len(results) else 'model' if not known else 'known'
    use = tasks.merged_limit_use([result.limit_use for result in results])
    if not all(np.isnan(values).all() for values in (use.effort, use.velocity, use.position)):
        print('\nUse of limits:')
        print(quantity_table(limit_use_rows(use, first.joint_names, first.joint_kinds, whose)))
