# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Execution of one function on many recordings, resumable: one process per core, or a Dask cluster.

A result is stored under a key that depends on the bytes of the recording, on the function with its
settings, and on the code of this package. An interrupted run therefore resumes where it stopped,
and outdated results are computed again. Failed recordings are listed; the others are processed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed, Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache, partial
import hashlib
import io
import json
import multiprocessing
import os
from pathlib import Path
import pickle
import signal
import sys
import threading
from typing import Any, Generic, TypeVar

import numpy as np
import robot_dynamics
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.tools.command_line import make_directory, ToolError, write_file
from robot_dynamics_tools.recordings.bag_files import METADATA, storage_groups

Settings = TypeVar('Settings')
"""Settings on which results depend: dataclasses, arrays, and types of JSON."""
Outcome = TypeVar('Outcome')
"""The result of a task, which `pickle` stores."""
Task = Callable[[Path, Settings], Outcome]
"""A function at module level, so that another process can import it."""

_SAFE = ('ndarray', 'dtype', '_reconstruct', '_frombuffer', 'scalar', 'Path', 'PosixPath')
"""Names of numpy and pathlib in a result."""
_ONE_THREAD = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')


@dataclass(frozen=True, eq=False)
class TaskOutcome(Generic[Outcome]):
    """The result of a recording, or the text of its error; `resumed`: from an earlier run."""

    bag: Path
    result: Outcome | None = None
    error: str = ''
    resumed: bool = False


def run_tasks(
    function: Task[Settings, Outcome], bags: Sequence[Path], settings: Settings,
    workers: int | None = None, cache: Path | None = None, dask: str | None = None,
    on_done: Callable[[TaskOutcome[Outcome]], None] | None = None,
    is_valid: Callable[[Path, Outcome], bool] | None = None,
    each: Sequence[Settings] | None = None,
) -> list[TaskOutcome[Outcome]]:
    """
    Return the outcome of `function(bag, settings)` for each recording, in their order.

    `each` has separate settings for every recording, in the same order, instead of `settings`.
    The work is shared by `workers` processes, by default one per core; with 1, this process does
    it. With `dask`, the address of a scheduler, the workers of Dask do it; they must have access
    to the same files and to this package. `cache` is a directory for results, None to store none;
    `is_valid` returns whether a stored result is still valid. `on_done` is called with each
    outcome when it is complete. An exception of the function, or the end of its process, is the
    error of its recording.

    Raises MissingDependencyError without the library of `dask`, RobotDynamicsError if the
    scheduler cannot be reached.
    """
    one = partial(_execute, function, cache=cache, is_valid=is_valid, code=_code_digest())
    jobs = dict(enumerate(zip(bags, each or [settings] * len(bags))))
    processes = min(workers or os.cpu_count() or 1, len(bags))
    if dask is not None:
        done = _by_executor(one, {
            i: (bag.resolve(), own) for i, (bag, own) in jobs.items()}, _dask_cluster(dask))
    elif processes <= 1:
        done = ((i, one(job)) for i, job in jobs.items())
    else:
        done = _in_processes(one, jobs, processes)
    outcomes: dict[int, TaskOutcome[Outcome]] = {}
    for i, outcome in done:
        outcomes[i] = outcome
        if on_done is not None:
            on_done(outcome)
    return [outcomes[i] for i in range(len(bags))]


Job = tuple[Path, Any]
"""A recording, and its settings."""
Numbered = tuple[int, TaskOutcome[Any]]


def _execute(
    function: Task[Any, Any], job: Job, *, cache: Path | None,
    is_valid: Callable[[Path, Any], bool] | None, code: str,
) -> TaskOutcome[Any]:
    """Return the outcome of one recording, from an earlier run if it is stored."""
    bag, settings = job
    try:
        if cache is None:
            return TaskOutcome(bag, function(bag, settings))
        file = cache / f'{task_key(function, bag, settings, code)}.pickle'
        kept = load_result(file)
        if kept is not None and (is_valid is None or is_valid(bag, kept)):
            return TaskOutcome(bag, kept, resumed=True)
        result = function(bag, settings)
        save_result(file, result)
        return TaskOutcome(bag, result)
    except ToolError:  # the outputs cannot be written
        raise
    except RobotDynamicsError as error:
        return TaskOutcome(bag, error=str(error))
    except Exception as error:  # an error of one recording must not stop the others
        return TaskOutcome(bag, error=f'{type(error).__name__}: {error}')


def save_result(file: Path, result: object) -> None:
    """Store a result, so that an existing file is always complete; raise ToolError."""
    make_directory(file.parent)
    write_file(file, pickle.dumps(result))


class _Results(pickle.Unpickler):
    """Reads records of modules that are loaded, and arrays; anything else is no result."""

    def find_class(self, module: str, name: str) -> Any:
        known = getattr(sys.modules.get(module), name, None)
        if is_dataclass(known) or hasattr(known, '_fields') or (
                module.partition('.')[0] in ('numpy', 'pathlib') and name in _SAFE):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f'{module}.{name} is no part of a result')


def load_result(file: Path) -> Any | None:
    """Return a stored result, None if there is no complete one; no code of the file runs."""
    try:
        return _Results(io.BytesIO(file.read_bytes())).load()
    except Exception:  # a damaged file may raise any
        return None


def task_key(
    function: Task[Settings, object], bag: Path, settings: Settings, code: str = '',
) -> str:
    """Return the key of a result, a digest of everything that it depends on; raise OSError."""
    digest = hashlib.blake2b(digest_size=20)
    function = getattr(function, 'func', function)  # of a partial
    # The path as well, because the outputs contain it.
    about = (function.__module__, function.__qualname__, str(bag.resolve()), code, settings)
    digest.update(json.dumps(about, sort_keys=True, default=_plain_value).encode())
    for file in _files_of(bag):
        digest.update(f'\0{file.name}\0{file.stat().st_size}\0'.encode())
        with file.open('rb') as opened:
            while part := opened.read(1 << 20):
                digest.update(part)
    return digest.hexdigest()


def _plain_value(value: object) -> Any:
    """Return a dataclass, without fields that it does not compare, or an array for JSON."""
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value) if field.compare}
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f'{type(value).__name__} is no setting, expected a dataclass or an array')


def _files_of(bag: Path) -> list[Path]:
    if bag.is_file():
        return [bag]
    files = [file for group in storage_groups(bag) for file in group]
    return files + sorted(
        file for file in bag.iterdir() if file.name.endswith(('-wal', '-journal', METADATA)))


@lru_cache
def _code_digest() -> str:
    """Return a digest of the code of both packages, because results also depend on the model."""
    digest = hashlib.blake2b(digest_size=20)
    for package in (Path(robot_dynamics.__file__).parent, Path(__file__).parents[1]):
        for path in sorted(package.rglob('*.py')):
            digest.update(f'{path.relative_to(package)}\0'.encode() + path.read_bytes())
    return digest.hexdigest()


# ---------------------------------------------------------------------- executors

def _by_executor(
    one: Callable[[Job], TaskOutcome[Any]], jobs: Mapping[int, Job],
    workers: AbstractContextManager[Executor],
) -> Iterator[Numbered]:
    with workers as executor:
        futures = {executor.submit(one, job): i for i, job in jobs.items()}
        for future in as_completed(futures):
            i, failure = futures[future], future.exception()
            if isinstance(failure, (BrokenProcessPool, ToolError)):
                raise failure
            yield i, future.result() if failure is None else TaskOutcome(
                jobs[i][0], error=f'{type(failure).__name__}: {failure}')


def _in_processes(
    one: Callable[[Job], TaskOutcome[Any]], jobs: dict[int, Job], workers: int,
) -> Iterator[Numbered]:
    try:
        for i, outcome in _by_executor(one, dict(jobs), _process_pool(workers)):
            del jobs[i]
            yield i, outcome
    except BrokenProcessPool:
        # A process died, and the pool lost all running tasks. Each of them runs again in a
        # separate process, which shows the recording that ended the process.
        for i, job in jobs.items():
            try:
                yield from _by_executor(one, {i: job}, _process_pool(1))
            except BrokenProcessPool:
                yield i, TaskOutcome(job[0], error='its process died, by a signal or for lack of '
                                                'memory')


@contextmanager
def _process_pool(workers: int) -> Iterator[Executor]:
    """Yield processes of one thread each, as there is one per core."""
    kept = {name: os.environ[name] for name in _ONE_THREAD if name in os.environ}
    os.environ.update(dict.fromkeys(_ONE_THREAD, '1'))
    # Not forked, because the threads of the numerical libraries would not survive a fork.
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context('spawn'), initializer=_begin_process)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name in _ONE_THREAD:
            del os.environ[name]
        os.environ.update(kept)


def _begin_process() -> None:
    """Complete the running task at Ctrl-C, but end if the parent process ends for any reason."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _dask_cluster(scheduler: str) -> Iterator[Executor]:
    """Yield the workers of a Dask scheduler; raise RobotDynamicsError if it does not answer."""
    distributed = optional('distributed', 'a Dask cluster')
    try:
        client = distributed.Client(scheduler, timeout='10s')
    except (OSError, ValueError, TimeoutError) as error:
        raise RobotDynamicsError(f'no Dask scheduler answers at {scheduler!r}: {error}') from None
    with client:
        yield client.get_executor(pure=False)
