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
Identify an arm from recordings: `identify BAG… --urdf URDF`.

Exit status: 0 done; 1 some recordings failed, which are listed; 2 a mistake in the arguments, or
nothing could be identified; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import sys
from typing import NoReturn

DONE, FAILED, MISTAKE, INTERRUPTED = 0, 1, 2, 130
KEPT = 'results'
"""Where results are kept below the output, for a run that is broken off."""
OUTPUT = Path('identified')


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        print(f'identify: {message} (identify --help lists the options)', file=sys.stderr)
        raise SystemExit(MISTAKE)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    arguments = _parser().parse_args(argv)
    # Small matrices, one after another: more threads than one only wait for each other.
    for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'):
        os.environ.setdefault(name, '1')
    from robot_dynamics.exceptions import RobotDynamicsError
    try:
        return _run(arguments)
    except RobotDynamicsError as error:
        print(f'identify: {error}', file=sys.stderr)
        return MISTAKE
    except OSError as error:
        print(f'identify: {error.filename!r} cannot be used: {error.strerror}', file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        print('identify: interrupted; the same command goes on from here', file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='identify', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Identify masses, inertias, rotors and friction of an arm from recorded joint '
                    'states with\neffort. Writes a URDF, parameters that dynamics_node loads as '
                    'they are, and a report.',
        epilog='exit status: 0 done, 1 some recordings failed, 2 a mistake in the arguments or '
               'nothing could\nbe identified, 130 interrupted')
    parser.add_argument(
        'bags', nargs='+', type=Path, metavar='BAG',
        help='a directory of rosbag2, a file .mcap or .db3, or a folder with any of these')
    parser.add_argument(
        '--urdf', required=True, metavar='FILE_OR_PACKAGE',
        help='a path, or package://PACKAGE/PATH; .xacro too')
    parser.add_argument(
        '--topic', metavar='NAME_OR_TYPE',
        help='of the joint states: a topic, or sensor_msgs/msg/JointState where only one has it '
             '(default: /joint_states, or the only one)')
    parser.add_argument(
        '--map', action='append', default=[], type=_pair, metavar='A=B', dest='joint_map',
        help='two names of one joint, in the recording and in the URDF, in either order; may be '
             'given again')
    parser.add_argument(
        '--train-fraction', type=_share, default=0.6, metavar='SHARE',
        help='of the samples, from the first on, to train with; the rest tests the model '
             '(default: 0.6)')
    parser.add_argument(
        '--cutoff', type=float, metavar='HZ',
        help='of the filter [Hz] (default: chosen from the data, and printed)')
    parser.add_argument(
        '--effort', choices=('auto', 'torque', 'current'), default='auto',
        help='what recorded effort is: torque or force, or current, whose gains are then '
             'identified with the masses of the URDF, and of payloads, as reference (default: '
             'auto, which is torque unless most joints differ in their gains)')
    parser.add_argument(
        '--payload', action='append', default=[], type=_payload, metavar='LINK=KG[,X,Y,Z]',
        help='a load that the arm carries in all recordings: its mass [kg] and centre of mass '
             '[m] in the frame of the link; it is not identified, and no part of what is '
             'written; may be given again')
    parser.add_argument(
        '--parameters', type=Path, metavar='FILE',
        help='parameters of dynamics_node: joints, gravity, motors, measured_effort')
    parser.add_argument(
        '--output', type=Path, default=OUTPUT, metavar='DIR',
        help=f'write there (default: {OUTPUT})')
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


def _payload(text: str) -> tuple[str, tuple[float, ...]]:
    link, _, numbers = text.partition('=')
    try:
        values = tuple(float(number) for number in numbers.split(','))
    except ValueError:
        values = ()
    if not link or len(values) not in (1, 4):
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected LINK=KG or LINK=KG,X,Y,Z as tool0=1.2,0,0,0.05')
    return link, values


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = float('nan')
    if not 0.0 < share <= 1.0:
        raise argparse.ArgumentTypeError(f'{text!r}, expected a number in (0, 1]')
    return share


def _count(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r}, expected a number of at least 1')
    return int(text)


def _run(arguments: argparse.Namespace) -> int:
    from robot_dynamics.analysis.arm_recording import AnalysisSettings
    from robot_dynamics.analysis.batch import (
        Outcome,
        require_dask,
        run_tasks,
        Settings,
        Task,
        TaskOutcome,
    )
    from robot_dynamics.identification.bag_identification import identify_bags
    from robot_dynamics.identification.pipeline import STAGES
    from robot_dynamics.identification.report import write_identification
    from robot_dynamics.identification.tasks import IdentificationSettings
    from robot_dynamics.model.arm_parameters import read_parameter_file
    from robot_dynamics.model.payload import make_payload
    from robot_dynamics.recordings.bag_files import find_recordings
    from robot_dynamics.reporting.progress import Progress
    from robot_dynamics.tools.arguments import read_robot
    from robot_dynamics.tools.identification_console import print_identification
    bags = find_recordings(arguments.bags)
    parameters = {} if arguments.parameters is None else read_parameter_file(arguments.parameters)
    urdf = read_robot(arguments.urdf)
    if arguments.dask is not None:
        require_dask()
    settings = IdentificationSettings(
        AnalysisSettings(
            urdf, arguments.topic, tuple(arguments.joint_map), arguments.cutoff, parameters),
        arguments.train_fraction,
        tuple(make_payload(link, values[0], values[1:] or (0.0, 0.0, 0.0))
              for link, values in arguments.payload))
    settings.arm(())  # a mistake is told before anything is read
    kept = arguments.output / KEPT if len(bags) > 1 else None
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
    done = 0
    with Progress(3 * len(bags) + 2, 'steps') as progress:
        def advance(_: object) -> None:
            nonlocal done
            done += 1
            progress.update(done)

        def run(
            function: Task[Settings, Outcome], left: Sequence[Path], task: Settings,
        ) -> list[TaskOutcome[Outcome]]:
            return run_tasks(
                function, left, task, arguments.jobs, kept, arguments.dask, advance)

        found = identify_bags(
            bags, settings, run,
            None if arguments.effort == 'auto' else arguments.effort == 'current',
            lambda stage: advance(stage) if stage in (STAGES[1], STAGES[3]) else None)
    paths = write_identification(found, urdf, arguments.output, parameters)
    print_identification(found, paths)
    return FAILED if found.failed else DONE


if __name__ == '__main__':
    sys.exit(main())
