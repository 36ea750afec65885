# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What `analyze_bag` prints."""

from collections.abc import Sequence
import sys

import numpy as np
from robot_dynamics.analysis.batch import TaskOutcome
from robot_dynamics.analysis.residual import merged_statistics
from robot_dynamics.analysis.summary import limit_use_rows, residual_rows
from robot_dynamics.analysis.tasks import AnalysisResult, merged_limit_use
from robot_dynamics.reporting.text_table import percent, quantity_table, text_table

LONGEST_LIST = 20
"""Failures that are printed; of more it is said how many."""


def print_one(result: AnalysisResult, is_resumed: bool) -> None:
    """Print the analysis of one recording."""
    print(text_table([], result.facts))
    for title, lines in (('Lost:', result.losses), ('Remarks:', result.remarks)):
        if lines:
            more = len(lines) - LONGEST_LIST
            print('\n' + '\n'.join([
                title, *(f'  {line}' for line in lines[:LONGEST_LIST]),
                *([f'  and {more} more'] if more > 0 else [])]))
    _print_figures([result])
    if result.written:
        print('\nWritten:\n' + '\n'.join(f'  {path}' for path in result.written))
    if is_resumed:
        print('(from an earlier run: nothing of it has changed)')


def print_many(outcomes: Sequence[TaskOutcome[AnalysisResult]], names: Sequence[str]) -> None:
    """Print a line for each recording that was analysed, and all of an arm together."""
    rows = [('recording', 'samples', 'lost', 'remarks', 'relative residual of each joint')]
    arms: dict[tuple[str, ...], list[AnalysisResult]] = {}
    for name, outcome in zip(names, outcomes):
        if outcome.result is None:
            continue
        result = outcome.result
        relative = 'no effort' if result.statistics is None else ' '.join(
            f'{percent(ratio):>8}' for ratio in result.statistics.relative)
        rows.append((name, str(result.counted), str(len(result.losses) or '-'),
                     str(len(result.remarks) or '-'), relative))
        arms.setdefault((result.arm, *result.joint_names), []).append(result)
    print(quantity_table(rows))
    resumed = sum(outcome.resumed for outcome in outcomes)
    if resumed:
        print(f'{resumed} of them from an earlier run')
    for name, results in ((key[0], value) for key, value in arms.items()):
        print(f'\nTogether: {len(results)} recordings of {name}, '
              f'{sum(result.counted for result in results)} samples')
        _print_figures(results)


def print_failures(failed: Sequence[tuple[str, str]]) -> None:
    """Print which recordings failed, and why, to stderr."""
    if not failed:
        return
    print(f'analyze_bag: {len(failed)} could not be analysed:', file=sys.stderr)
    for name, error in failed[:LONGEST_LIST]:
        print(f'  {name}: {" ".join(error.split())}', file=sys.stderr)
    if len(failed) > LONGEST_LIST:
        print(f'  and {len(failed) - LONGEST_LIST} more', file=sys.stderr)


def _print_figures(results: Sequence[AnalysisResult]) -> None:
    first = results[0]
    known = [result.statistics for result in results if result.statistics is not None]
    if known:
        print('\nResidual, measured − model:')
        print(quantity_table(residual_rows(merged_statistics(known), first.joint_kinds)))
    whose = 'measured' if len(known) == len(results) else 'model' if not known else 'known'
    use = merged_limit_use([result.limit_use for result in results])
    if not all(np.isnan(values).all() for values in (use.effort, use.velocity, use.position)):
        print('\nUse of limits:')
        print(quantity_table(limit_use_rows(use, first.joint_names, first.joint_kinds, whose)))
