# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
What the executables share: parser, exit statuses, errors in one line, and output files.

Nothing here loads the library at import: the verbs of `ros2 dynamics` start without it.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
import os
from pathlib import Path
import shlex
import sys
from tempfile import TemporaryFile
from typing import Any, NoReturn, TYPE_CHECKING

from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError

if TYPE_CHECKING:
    from robot_dynamics.model_check.html_page import Origin

_DEVICES = Path('/dev')
DONE, FAILED, MISTAKE, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141
ROBOT_HELP = ('URDF or .xacro file of the robot: a path, package://PACKAGE/PATH, or the name of a '
              'sample robot, such as ur10')


class ToolError(RobotDynamicsError):
    """The work of a tool failed although its arguments are valid: exit status FAILED."""


class Parser(argparse.ArgumentParser):
    """Keeps the line breaks of texts, and reports a mistake in one line with MISTAKE."""

    def __init__(self, **options: Any) -> None:
        options.setdefault('formatter_class', argparse.RawDescriptionHelpFormatter)
        super().__init__(**options)

    def error(self, message: str) -> NoReturn:
        """Print the mistake and where the options are listed; raise SystemExit."""
        print(f'{self.prog}: {message} ({self.prog} --help lists the options)', file=sys.stderr)
        raise SystemExit(MISTAKE)


def execute() -> int:
    """Run the tool of this package with the name of the executable; an interrupt is one line."""
    name = Path(sys.argv[0]).name.removeprefix('robot_dynamics_')
    return run_tool(name, lambda: int(import_module(f'robot_dynamics.tools.{name}').main()))


def run_tool(
    prog: str, run: Callable[[], int], rejected: int = MISTAKE, interrupted: str = 'interrupted',
) -> int:
    """
    Return the exit status of `run`, or of the error that it raises, which is printed to stderr.

    `rejected` is the status of a RobotDynamicsError or OSError, whose message takes one line;
    `interrupted` is the message of a KeyboardInterrupt. A broken pipe is no error to print. The
    message of a ToolError keeps its lines, because it may end with a log.
    """
    try:
        return run()
    except ToolError as error:
        message, status = str(error), FAILED
    except BrokenPipeError:  # the reader of the output has ended, such as `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except (RobotDynamicsError, OSError) as error:
        message, status = ' '.join(str(error).split()), rejected
        if isinstance(error, OSError) and error.filename is not None:
            message = f'{error.filename!r} cannot be used: {error.strerror}'
    except KeyboardInterrupt:
        message, status = interrupted, INTERRUPTED
    print(f'{prog}: {message}', file=sys.stderr)
    return status


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """
    Yield the path of a new file, which replaces `path` at the end and is removed after an error.

    Raises ToolError instead of an OSError. What is in /dev is written directly.
    """
    new = path if path.parent == _DEVICES else path.with_name(
        f'.unfinished-{os.getpid()}-{path.name}')
    try:
        yield new
        if new != path:
            new.replace(path)
    except OSError as error:
        raise ToolError(f'cannot write {path}: {error.strerror or error}') from None
    finally:
        if new != path:
            with suppress(OSError):
                new.unlink()


def make_directory(path: Path) -> None:
    """Make a directory with its parents; raise ToolError, also if it cannot be written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=path).close()
    except OSError as error:
        raise ToolError(f'cannot write {path}: {error.strerror}') from None


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add --force."""
    parser.add_argument(
        '--force', action='store_true',
        help='Replace output files that exist; without it, they are an error')


def prepare_file(path: Path, force: bool) -> None:
    """
    Make the directory of an output file, before any work.

    Raises InvalidInputError if the file exists, unless `force`; ToolError if the directory cannot
    be made. A device such as /dev/stdout is no file, also if it is redirected to one.
    """
    if path.parent == _DEVICES:
        return
    if path.is_dir():
        raise InvalidInputError(f'output {str(path)!r} is a directory, expected a file')
    if path.is_file() and not force:
        raise InvalidInputError(
            f'output {str(path)!r} exists, expected the name of a new file, or --force to '
            'replace it')
    make_directory(path.parent)


def write_file(path: Path, content: str | bytes) -> None:
    """Write an output file; raise ToolError."""
    with writing(path) as new:
        new.write_bytes(content.encode() if isinstance(content, str) else content)


def write_output(path: Path | None, text: str, force: bool) -> None:
    """Write an output file that `prepare_file` permits, or to stdout without a path."""
    if path is None:
        sys.stdout.write(text)
    else:
        prepare_file(path, force)
        write_file(path, text)


def origin_of(
    prog: str, argv: Sequence[str] | None, urdf: str | Path | None, default: str,
) -> 'Origin':
    """Return the origin of a report; `default` describes the URDF if none was given."""
    from robot_dynamics import __version__
    from robot_dynamics.model_check.html_page import Origin
    return Origin(
        default if urdf is None else str(urdf),
        shlex.join([prog, *(sys.argv[1:] if argv is None else argv)]), __version__)
