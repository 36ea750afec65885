# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Options that several tools share, and their results in directories and lists.

Nothing here loads the library at import: the verbs of `ros2 dynamics` start without it.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
import json
import math
import os
from pathlib import Path
import re
import sys
import textwrap
from typing import Any, TYPE_CHECKING

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.tools import command_line

if TYPE_CHECKING:
    from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings

KEPT = 'results'
"""Directory below the output that keeps results, from which an interrupted run resumes."""
COMMAND = 'command.json'
"""File in KEPT with the arguments of the run that made the output."""
LONGEST_LIST = 20
"""Number of printed lines of a list; the others are only counted."""
_WIDTH = 110
_WITHOUT_EFFECT = ('dask', 'force', 'jobs')
"""Arguments that do not change the results."""


def complete(parser: argparse.ArgumentParser) -> None:
    """Print what completes the words of a shell, and exit, if Tab has called this process."""
    if '_ARGCOMPLETE' in os.environ:
        with suppress(ImportError):
            import argcomplete
            argcomplete.autocomplete(parser)


def run_tool(
    parser: argparse.ArgumentParser, run: Callable[[argparse.Namespace], int],
    argv: Sequence[str] | None,
) -> int:
    """Return the exit status of `run` with the parsed arguments (`command_line.run_tool`)."""
    complete(parser)
    arguments = parsed(parser, argv)
    resumes = 'jobs' in arguments and arguments.output is not None
    return command_line.run_tool(
        parser.prog, lambda: run(arguments), interrupted='interrupted' + (
            '; run the same command to resume' if resumes else ''))


def print_list(title: str, lines: Sequence[str]) -> None:
    """Print a title and indented lines; nothing without lines."""
    if lines:
        print(f'\n{title}')
        for line in _shortened(lines):
            print(textwrap.fill(
                line, _WIDTH, initial_indent='  ', subsequent_indent='    ',
                break_long_words=False, break_on_hyphens=False))


def print_failures(prog: str, failed: Sequence[tuple[object, str]]) -> None:
    """Print the recordings that failed, with the reasons, to stderr."""
    if failed:
        print(f'{prog}: recordings that could not be used: {len(failed)}', file=sys.stderr)
        for line in _shortened([f'{name}: {" ".join(error.split())}' for name, error in failed]):
            print(f'  {line}', file=sys.stderr)


def _shortened(lines: Sequence[str]) -> list[str]:
    more = [f'and {len(lines) - LONGEST_LIST} more'] if len(lines) > LONGEST_LIST else []
    return [*lines[:LONGEST_LIST], *more]


def prepare_directory(
    directory: Path, outputs: Iterable[Path], arguments: argparse.Namespace,
) -> Path:
    """
    Return the directory KEPT below an output directory; both exist then.

    The same command may use the directory again, also to resume. Raises InvalidInputError if one
    of the `outputs` exists and is of another command, unless `arguments.force`.
    """
    kept = directory / KEPT
    command = kept / COMMAND
    wanted = json.dumps({
        name: value for name, value in sorted(vars(arguments).items())
        if name not in _WITHOUT_EFFECT}, default=str, indent=2) + '\n'
    existing = next((path for path in outputs if path.exists()), None)
    is_same = command.is_file() and command.read_text(encoding='utf-8') == wanted
    if existing is not None and not is_same and not arguments.force:
        raise InvalidInputError(
            f'output {str(existing)!r} exists and is not of the same command, expected another '
            '--output, or --force to replace it')
    command_line.make_directory(kept)
    command_line.write_file(command, wanted)
    return kept


def number(
    default: float | Sequence[float] | None, metavar: str | tuple[str, ...], text: str,
    kind: Callable[[str], float] = float, **settings: Any,
) -> dict[str, Any]:
    """Return the settings of an option with a number; its help states a default that is one."""
    of_default = ' (default: %(default)g)' if isinstance(default, (int, float)) else ''
    return {'type': kind, 'default': default, 'metavar': metavar, 'help': text + of_default,
            **settings}


def add_recordings(
    parser: argparse.ArgumentParser, urdf_default: str | None, required: bool = True,
) -> None:
    """Add BAG…, --urdf, which are `required` (--urdf without a default), --topic and --map."""
    parser.add_argument(
        'bags', nargs='+' if required else '*', type=Path, metavar='BAG',
        help='A rosbag2 directory, a .mcap or .db3 file, or a folder that contains any of these; '
             'or a .csv file with a header, or a data set of LeRobot')
    add_robot(parser, '--urdf', urdf_default, 'FILE_OR_PACKAGE', required and urdf_default is None)
    parser.add_argument(
        '--topic', metavar='NAME_OR_TYPE',
        help='Topic of the joint states, or the type sensor_msgs/msg/JointState if only one topic '
             'has it (default: /joint_states, or the only topic of this type)')
    parser.add_argument(
        '--command-topic', metavar='NAME',
        help='Topic of the commanded positions, for drives that report no effort: it is '
             'drive.stiffness (--parameters) times the distance from the position to the command. '
             '`identify` determines a stiffness that is not given, from the masses of the URDF '
             'and of payloads')
    parser.add_argument(
        '--map', action='append', default=[], type=pair, metavar='A=B', dest='joint_map',
        help='Two names of one joint, in the recording and in the URDF, in any order; may be '
             'repeated')
    parser.add_argument(
        '--columns', action='append', default=[], type=pair, metavar='WHAT=HEADER',
        help='Column of a .csv file: time=HEADER, or JOINT.position=HEADER, .velocity or .effort; '
             'may be repeated (default: by the words in the headers)')
    parser.add_argument(
        '--unit', choices=('rad', 'deg', 'range'), default='',
        help='Unit of the positions: radians, degrees, or −100 to 100 of the range in the URDF '
             '(default: radians; degrees of a .csv file are detected)')


def add_robot(
    parser: argparse.ArgumentParser, option: str, default: str | None, metavar: str,
    required: bool | None = None,
) -> None:
    """Add the option that names the robot, by default required without a default."""
    parser.add_argument(
        option, required=default is None if required is None else required, metavar=metavar,
        help=command_line.ROBOT_HELP
             + (f' (default: {default})' if default is not None else ''))
    parser.add_argument(
        '--xacro', action='append', default=[], type=_assignment, metavar='NAME:=VALUE',
        help=f'Argument of the .xacro file of {option}; may be repeated')


def parsed(parser: argparse.ArgumentParser, argv: Sequence[str] | None) -> argparse.Namespace:
    """Return parsed arguments with those of --xacro after the file of the robot."""
    arguments = parser.parse_args(argv)
    for name in {'urdf', 'robot'} & set(vars(arguments)) if arguments.xacro else ():
        if vars(arguments)[name] is None:
            parser.error(f'--xacro has no effect, expected --{name} with a .xacro file')
        setattr(arguments, name, ' '.join([vars(arguments)[name], *arguments.xacro]))
    return arguments


def add_cutoff(
    parser: argparse.ArgumentParser, default: str = 'chosen from the data, and printed',
) -> None:
    """Add --cutoff; `default` describes the value without it."""
    parser.add_argument('--cutoff', **number(
        None, 'HZ', f'Cut-off frequency of the low-pass filter [Hz] (default: {default})'))


def add_node(parser: argparse._ActionsContainer) -> None:
    """Add --node and --timeout."""
    parser.add_argument(
        '-n', '--node', default='', metavar='NODE',
        help='Name of the dynamics node with its namespace (default: the only one that runs)')
    parser.add_argument('--timeout', **number(
        5.0, 'S', 'Time to search for the node, and to wait for each answer [s]'))


def add_output(
    parser: argparse.ArgumentParser, metavar: str, text: str, default: Path | None = None,
) -> None:
    """Add --output, a file or a directory, and --force."""
    parser.add_argument('-o', '--output', type=Path, metavar=metavar, default=default, help=text)
    command_line.add_force(parser)


def default_output(name: str, ending: str) -> Path:
    """Return the file in out/ of a robot with this name, which may have any characters."""
    return Path('out', re.sub(r'[^\w.-]', '_', name)[:80] + ending)


def add_parameters(parser: argparse.ArgumentParser, used: str) -> None:
    """Add --parameters; `used` names the parameters that have an effect."""
    parser.add_argument(
        '--parameters', type=Path, metavar='FILE',
        help=f'Parameter file of dynamics_node; used: {used}')


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add --jobs and --dask."""
    parser.add_argument(
        '--jobs', type=number_in(1, 10**4, int), metavar='N',
        help='Number of processes (default: one per core)')
    parser.add_argument(
        '--dask', metavar='SCHEDULER',
        help='Address of a Dask scheduler whose workers process the recordings, such as '
             'tcp://host:8786 (extra: dask)')


def read_settings(arguments: argparse.Namespace) -> 'AnalysisSettings':
    """
    Return the settings of the options for recordings.

    Raises ModelError or InvalidInputError if the URDF or the parameters cannot be read.
    """
    from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings
    from robot_dynamics_tools.urdf_editing import with_continuous_joints
    parameters, urdf = read_parameters(arguments.parameters), ''
    if arguments.urdf is not None:
        urdf, changed = with_continuous_joints(read_robot(arguments.urdf))
        for name in changed:
            print(f'Warning: joint {name!r} is revolute and has no <limit>, it is used as '
                  'continuous, the type of a joint without limits', file=sys.stderr)
    return AnalysisSettings(
        urdf, arguments.topic, tuple(arguments.joint_map), arguments.cutoff, parameters,
        columns=tuple(arguments.columns), unit=arguments.unit,
        command_topic=arguments.command_topic)


def read_parameters(path: Path | None) -> Mapping[str, Any]:
    """Return the parameters in a file, if there is one; raise InvalidInputError."""
    from robot_dynamics.model.arm_parameters import read_parameter_file
    return {} if path is None else read_parameter_file(path)


def read_robot(text: str | None, option: str = '--urdf') -> str:
    """
    Return the URDF of a path, or of `file://` or `package://`; the default arm for None.

    xacro is expanded. Raises ModelError, which names `option`, if there is no URDF.
    """
    if text is None:
        from robot_dynamics.planar.urdf import default_arm_urdf
        return default_arm_urdf()
    from robot_dynamics.urdf.description_file import read_description_file
    return read_description_file(text, option)


def _assignment(text: str) -> str:
    if not re.fullmatch(r'\w+:=\S*', text):
        raise argparse.ArgumentTypeError(f'{text!r}, expected NAME:=VALUE without spaces')
    return text


def pair(text: str) -> tuple[str, str]:
    """Return the two sides of A=B; the type of an option."""
    first, separator, second = text.partition('=')
    if not (first and separator and second):
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected two names such as fer_joint1=panda_joint1')
    return first, second


def number_in(
    low: float, high: float, kind: Callable[[str], float] = float,
) -> Callable[[str], float]:
    """Return the type of an option whose number is in a range."""
    def number(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f'{text!r}, expected a number in [{low:g}, {high:g}]')
        return value
    return number
