# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Execution of one function on many recordings, resumable: one process per core, or a Dask cluster.

A result is stored under a key that depends on the bytes of the recording, on the function with its
settings, and on the code of this package. An interrupted run therefore resumes where it stopped,
and outdated results are computed again. Failed recordings are listed; the others are processed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
import hashlib
import json
import multiprocessing
import os
from pathlib import Path
import signal
import threading
from typing import Any, Generic, get_type_hints, TypeVar

import robot_dynamics
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.analysis import result_store
from robot_dynamics_tools.recordings.bag_files import METADATA, storage_groups

Settings = TypeVar('Settings')
"""Settings on which results depend: dataclasses, arrays, and types of JSON."""
Outcome = TypeVar('Outcome')
"""The result of a task, as `result_store` stores it."""
Task = Callable[[Path, Settings], Outcome]
"""
A function at module level, so that another process can import it.

A stored result is converted to the dataclass that the annotation of the return value names;
without an annotation, it remains a dictionary of names and values.
"""

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
    jobs = list(zip(bags, each or [settings] * len(bags)))
    processes = min(workers or os.cpu_count() or 1, len(bags))
    if dask is not None:
        done = _on_dask(one, jobs, dask)
    elif processes <= 1:
        done = ((i, one(job)) for i, job in enumerate(jobs))
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
        key = task_key(function, bag, settings, code)
        plain = result_store.load_result(cache, key)
        if plain is not None:
            kept = result_store.from_plain(
                get_type_hints(_plain_function(function)).get('return'), plain)
            if is_valid is None or is_valid(bag, kept):
                return TaskOutcome(bag, kept, resumed=True)
        result = function(bag, settings)
        result_store.save_result(cache, key, result)
        return TaskOutcome(bag, result)
    except ToolError:  # the outputs cannot be written
        raise
    except RobotDynamicsError as error:
        return TaskOutcome(bag, error=str(error))
    except Exception as error:  # an error of one recording must not stop the others
        return TaskOutcome(bag, error=f'{type(error).__name__}: {error}')


def _plain_function(function: Task[Any, object]) -> Any:
    return function.func if isinstance(function, partial) else function


def task_key(
    function: Task[Settings, object], bag: Path, settings: Settings, code: str = '',
) -> str:
    """Return the key of a result, a digest of everything that it depends on; raise OSError."""
    digest = hashlib.blake2b(digest_size=20)
    # The path as well, because the outputs contain it.
    name = _plain_function(function)
    about = (name.__module__, name.__qualname__, str(bag.resolve()), code, settings)
    digest.update(json.dumps(about, sort_keys=True, default=result_store.plain_value).encode())
    for file in _files_of(bag):
        digest.update(f'\0{file.name}\0{file.stat().st_size}\0'.encode())
        with file.open('rb') as opened:
            while part := opened.read(1 << 20):
                digest.update(part)
    return digest.hexdigest()


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


# ---------------------------------------------------------------------- processes

def _in_processes(
    one: Callable[[Job], TaskOutcome[Any]], jobs: Sequence[Job], workers: int,
) -> Iterator[Numbered]:
    left = dict(enumerate(jobs))
    try:
        for i, outcome in _in_pool(one, left, workers):
            del left[i]
            yield i, outcome
    except BrokenProcessPool:
        # A process died, and the pool lost all running tasks. Each of them runs again in a
        # separate process, which shows the recording that ended the process.
        for i, job in left.items():
            try:
                yield from _in_pool(one, {i: job}, 1)
            except BrokenProcessPool:
                yield i, TaskOutcome(job[0], error='its process died, by a signal or for lack of '
                                                'memory')


def _in_pool(
    one: Callable[[Job], TaskOutcome[Any]], jobs: Mapping[int, Job], workers: int,
) -> Iterator[Numbered]:
    with _one_thread_each():
        # Not forked, because the threads of the numerical libraries would not survive a fork.
        pool = ProcessPoolExecutor(
            workers, multiprocessing.get_context('spawn'), initializer=_begin_process)
        try:
            futures: dict[Future[TaskOutcome[Any]], int] = {
                pool.submit(one, job): i for i, job in jobs.items()}
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


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
def _one_thread_each() -> Iterator[None]:
    """Limit processes that start in the block to one thread, as there is one process per core."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, '1'))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


# ---------------------------------------------------------------------- Dask

def _on_dask(
    one: Callable[[Job], TaskOutcome[Any]], jobs: Sequence[Job], scheduler: str,
) -> Iterator[Numbered]:
    distributed = optional('distributed', 'a Dask cluster')
    try:
        client = distributed.Client(scheduler, timeout='10s')
    except (OSError, ValueError, TimeoutError) as error:
        raise RobotDynamicsError(f'no Dask scheduler answers at {scheduler!r}: {error}') from None
    with client:
        futures = {
            client.submit(one, (bag.resolve(), settings), pure=False): i
            for i, (bag, settings) in enumerate(jobs)}
        for future in distributed.as_completed(futures):
            i = futures[future]
            failure = future.exception()
            yield i, future.result() if failure is None else TaskOutcome(
                jobs[i][0], error=f'{type(failure).__name__}: {failure}')
