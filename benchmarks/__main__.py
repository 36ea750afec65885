# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`scripts/bench [NAME …]`: run the named benchmarks, or all except the long ones.

Options after `safe_motion` are passed to that benchmark. The exit status is 1 if a benchmark
exits with status 1.
"""

import argparse
from collections.abc import Sequence
from contextlib import redirect_stdout
import io
import sys
from typing import TextIO

from benchmarks import page
from benchmarks.catalogue import BENCHMARKS, LONG_BENCHMARKS


class Both(io.TextIOBase):
    """Stores the printed text and forwards it to another stream."""

    def __init__(self, through: TextIO) -> None:
        self._through, self.text = through, ''

    def write(self, words: str) -> int:
        self.text += words
        return self._through.write(words)

    def flush(self) -> None:
        self._through.flush()


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog='scripts/bench', description=__doc__)
    known = {**BENCHMARKS, **LONG_BENCHMARKS}
    parser.add_argument(
        'names', nargs='*', metavar='NAME',
        help=f'one of {list(BENCHMARKS)}, all by default; or of {list(LONG_BENCHMARKS)}')
    parser.add_argument(
        '--write', action='store_true', help='write their output to docs/evidence/benchmarks.md')
    arguments, options = parser.parse_known_args(argv)
    names = arguments.names or list(BENCHMARKS)
    if options and names != ['safe_motion']:
        parser.error(f'unknown options {options}, expected them after safe_motion only')
    unknown = [name for name in names if name not in known]
    if unknown:
        parser.error(f'unknown benchmarks {unknown}, expected names out of {list(known)}')
    status = 0
    for name in names:
        print(f'== {name}', flush=True)
        printed = Both(sys.stdout)
        with redirect_stdout(printed):
            try:
                known[name](*([options] if options else []))
            except SystemExit as ended:
                status = 1
                if ended.code != 1:  # not a verdict, but --help or a wrong option
                    raise
        if arguments.write:
            page.write(name, printed.text)
    return status


sys.exit(main())
