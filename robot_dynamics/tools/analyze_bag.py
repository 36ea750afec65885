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

"""
Compare the effort of recordings with that of a model: `analyze_bag BAG… --urdf URDF`.

Exit status: 0 done; 1 some recordings failed, which are listed; 2 a mistake in the arguments, or
none could be analysed; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
from typing import NoReturn

from robot_dynamics.analysis.arm_recording import AnalysisSettings
from robot_dynamics.analysis.bag_analysis import STEPS
from robot_dynamics.analysis.batch import require_dask, run_tasks, TaskOutcome
from robot_dynamics.analysis.sample_files import require_parquet
from robot_dynamics.analysis.tasks import (
    AnalysisResult,
    AnalysisTask,
    analyze_task,
    OUTPUTS,
    outputs_exist,
    PARQUET,
    PICTURE,
    REPORT,
    TABLE,
    TERMS,
)
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.recordings.bag_files import find_recordings, relative_names
from robot_dynamics.reporting.progress import Progress
from robot_dynamics.tools.analysis_console import print_failures, print_many, print_one
from robot_dynamics.tools.arguments import read_robot

DONE, FAILED, MISTAKE, INTERRUPTED = 0, 1, 2, 130
KEPT = 'results'
"""Where results are kept below the output, for a run that is broken off."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        print(f'analyze_bag: {message} (analyze_bag --help lists the options)', file=sys.stderr)
        raise SystemExit(MISTAKE)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    arguments = _parser().parse_args(argv)
    try:
        return _run(arguments)
    except RobotDynamicsError as error:
        print(f'analyze_bag: {error}', file=sys.stderr)
        return MISTAKE
    except OSError as error:
        print(f'analyze_bag: {error.filename!r} cannot be used: {error.strerror}',
              file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        print('analyze_bag: interrupted'
              + ('; the same command goes on from here' if arguments.output else ''),
              file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='analyze_bag', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Compare the measured effort of recorded joint states with inverse dynamics '
                    'of a model:\nresidual at each joint, effort by term, use of limits. '
                    'Recordings are those of rosbag2,\nsqlite3 or MCAP, also damaged ones.',
        epilog='exit status: 0 done, 1 some recordings failed, 2 a mistake in the arguments or '
               'none could be\nanalysed, 130 interrupted')
    parser.add_argument(
        'bags', nargs='+', type=Path, metavar='BAG',
        help='a directory of rosbag2, a file .mcap or .db3, or a folder with any of these')
    parser.add_argument(
        '--urdf', metavar='FILE_OR_PACKAGE',
        help='a path, or package://PACKAGE/PATH; .xacro too (default: the description in the '
             'recording)')
    parser.add_argument(
        '--topic', metavar='NAME_OR_TYPE',
        help='of the joint states: a topic, or sensor_msgs/msg/JointState where only one has it '
             '(default: /joint_states, or the only one)')
    parser.add_argument(
        '--map', action='append', default=[], type=_pair, metavar='A=B', dest='joint_map',
        help='two names of one joint, in the recording and in the URDF, in either order; may be '
             'given again')
    parser.add_argument(
        '--cutoff', type=float, metavar='HZ',
        help='of the filter [Hz] (default: chosen from the data, and printed)')
    parser.add_argument(
        '--parameters', type=Path, metavar='FILE',
        help='parameters of dynamics_node: joints, gravity, friction, motors, measured_effort')
    parser.add_argument(
        '--output', type=Path, metavar='DIR',
        help=f'write {REPORT}, {PICTURE}, {TABLE} and the recording {TERMS}/ there; of several '
             'recordings into a directory each')
    parser.add_argument(
        '--parquet', action='store_true', help=f'write {PARQUET} too (extra: parquet)')
    parser.add_argument(
        '--no-report', action='store_true', help=f'write neither {REPORT} nor {PICTURE}')
    parser.add_argument(
        '--jobs', type=_count, metavar='N', help='processes (default: one for each core)')
    parser.add_argument(
        '--dask', metavar='SCHEDULER',
        help='share the recordings among the workers of this Dask scheduler, as '
             'tcp://host:8786 (extra: dask)')
    return parser


def _pair(text: str) -> tuple[str, str]:
    first, separator, second = text.partition('=')
    if not (first and separator and second):
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected two names as fer_joint1=panda_joint1')
    return first, second


def _count(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r}, expected a number of at least 1')
    return int(text)


def _run(arguments: argparse.Namespace) -> int:
    if arguments.parquet:
        require_parquet()
        if arguments.output is None:
            raise InvalidInputError('--parquet is given without --output, the directory for it')
    if arguments.dask is not None:
        require_dask()
    bags = find_recordings(arguments.bags, arguments.output)
    names = relative_names(bags)
    parameters = {} if arguments.parameters is None else read_parameter_file(arguments.parameters)
    settings = AnalysisSettings(
        '' if arguments.urdf is None else read_robot(arguments.urdf), arguments.topic,
        tuple(arguments.joint_map), arguments.cutoff, parameters)
    task = AnalysisTask(settings, _outputs(arguments))
    kept, each = None, None
    if task.outputs:
        kept = arguments.output / KEPT
        kept.mkdir(parents=True, exist_ok=True)
        each = [
            replace(task, directory=str(
                arguments.output.resolve() / (name if len(bags) > 1 else ''))) for name in names]
    outcomes = _run_with_progress(bags, task, arguments, kept, each)
    results = [outcome.result for outcome in outcomes if outcome.result is not None]
    if len(bags) == 1 and results:
        print_one(results[0], outcomes[0].resumed)
    elif results:
        print_many(outcomes, names)
        if task.outputs:
            print(f'\nWritten to {arguments.output}, a directory for each recording')
    failed = [(name, outcome.error) for name, outcome in zip(names, outcomes) if outcome.error]
    print_failures(failed)
    return DONE if not failed else FAILED if results else MISTAKE


def _run_with_progress(
    bags: Sequence[Path], task: AnalysisTask, arguments: argparse.Namespace,
    kept: Path | None, each: Sequence[AnalysisTask] | None,
) -> list[TaskOutcome[AnalysisResult]]:
    """Analyse all, and show how far that is: by recordings, or by the steps of a single one."""
    single = len(bags) == 1 and arguments.dask is None
    steps = len(STEPS) + len(task.outputs) if single else len(bags)
    done = 0
    with Progress(steps, 'steps' if single else 'recordings') as progress:
        def advance(_: object) -> None:
            nonlocal done
            done += 1
            if not single or sys.stderr.isatty():
                progress.update(done)

        return run_tasks(
            partial(analyze_task, on_step=advance) if single else analyze_task, bags,
            task, arguments.jobs, kept, arguments.dask, None if single else advance,
            outputs_exist, each)


def _outputs(arguments: argparse.Namespace) -> tuple[str, ...]:
    if arguments.output is None:
        return ()
    left_out = set() if arguments.parquet else {PARQUET}
    if arguments.no_report:
        left_out |= {REPORT}
    return tuple(name for name in OUTPUTS if name not in left_out)


if __name__ == '__main__':
    sys.exit(main())
