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

"""What `identify` prints."""

from collections.abc import Sequence
from pathlib import Path
import sys
import textwrap

from robot_dynamics.identification.bag_identification import BagIdentification
from robot_dynamics.identification.summary import (
    fact_rows,
    friction_rows,
    gain_rows,
    recording_lines,
    residual_rows,
    warnings,
)
from robot_dynamics.reporting.text_table import quantity_table, text_table

LONGEST_LIST = 20
_WIDTH = 110


def print_identification(found: BagIdentification, paths: Sequence[Path]) -> None:
    """Print what was found, and where it was written."""
    identification = found.identification
    print(text_table([], fact_rows(found)))
    _print_list('Recordings:', recording_lines(found))
    print('\nResidual on samples that were not trained with, RMS relative to the effort:')
    print(quantity_table(residual_rows(identification)))
    print('\nFriction and rotors [N·m, rad, kg·m², or N, m, kg]:')
    print(quantity_table(friction_rows(identification)))
    if identification.gains is not None:
        print('\nDrive gains:')
        print(quantity_table(gain_rows(identification, identification.gains)))
    _print_list('Warnings:', warnings(identification))
    print('\nWritten:\n' + '\n'.join(f'  {path}' for path in paths))
    if found.failed:
        print(f'identify: {len(found.failed)} recordings could not be used:', file=sys.stderr)
        for bag, error in found.failed[:LONGEST_LIST]:
            print(f'  {bag}: {" ".join(error.split())}', file=sys.stderr)


def _print_list(title: str, lines: Sequence[str]) -> None:
    if not lines:
        return
    print(f'\n{title}')
    for line in lines[:LONGEST_LIST]:
        print(textwrap.fill(
            line, _WIDTH, initial_indent='  ', subsequent_indent='    ',
            break_long_words=False, break_on_hyphens=False))
    if len(lines) > LONGEST_LIST:
        print(f'  and {len(lines) - LONGEST_LIST} more')
