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
One function on many recordings: a process for each core, or a Dask cluster; resumable.

A result is kept under a key of what it depends on: the recording's bytes, the function with its
settings, and the code of this package. So a run that was interrupted resumes where it was,
and what changed is done again. What fails is listed, and the rest is done.
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

from robot_dynamics.analysis.result_store import (
    from_plain,
    load_result,
    plain_value,
    save_result,
)
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.recordings.bag_files import METADATA, storage_groups

Settings = TypeVar('Settings')
"""What results depend on besides the recording: dataclasses, arrays, and what JSON can write."""
Outcome = TypeVar('Outcome')
"""What a task returns, as `result_store` stores it."""
Task = Callable[[Path, Settings], Outcome]
"""
A function of a module, so that another process can import it.

The annotation of its return value names the dataclass a stored result becomes; without one, it
stays plain names and values.
"""

_ONE_THREAD = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')


@dataclass(frozen=True, eq=False)
class TaskOutcome(Generic[Outcome]):
    """What became of a recording: a result, or the error in words; `resumed` from before."""

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
    Return what `function(bag, settings)` gives for each recording, in their order.

    `each` has the settings of every single recording, in the same order, in place of `settings`.
    `workers` processes share the work, one a core by default; with 1, this one does it. With
    `dask`, the address of a scheduler, its workers do, which must see the same files and have
    this package. `cache` is a directory for results, None to keep none; `is_valid` says of a kept
    one whether it still holds. `on_done` is called with each as it is done. An exception of the
    function, or the end of its process, is the error of its recording.

    Raises MissingDependencyError without the library of `dask`, RobotDynamicsError where the
    scheduler cannot be reached.
    """
    one = partial(
        _execute, function, cache=cache, is_valid=is_valid, code=_code_digest())
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
    """Return the outcome of one recording, from before where it is kept."""
    bag, settings = job
    try:
        if cache is None:
            return TaskOutcome(bag, function(bag, settings))
        key = task_key(function, bag, settings, code)
        plain = load_result(cache, key)
        if plain is not None:
            kept = from_plain(get_type_hints(_plain_function(function)).get('return'), plain)
            if is_valid is None or is_valid(bag, kept):
                return TaskOutcome(bag, kept, resumed=True)
        result = function(bag, settings)
        save_result(cache, key, result)
        return TaskOutcome(bag, result)
    except RobotDynamicsError as error:
        return TaskOutcome(bag, error=str(error))
    except Exception as error:  # one recording must not end the others
        return TaskOutcome(bag, error=f'{type(error).__name__}: {error}')


def _plain_function(function: Task[Any, Any]) -> Any:
    return function.func if isinstance(function, partial) else function


def task_key(
    function: Task[Settings, Any], bag: Path, settings: Settings, code: str = '',
) -> str:
    """Return the key of a result: a digest of all that it depends on; raise OSError."""
    digest = hashlib.blake2b(digest_size=20)
    # The path, too: it stands in what is written.
    name = _plain_function(function)
    about = (name.__module__, name.__qualname__, str(bag.resolve()), code, settings)
    digest.update(json.dumps(about, sort_keys=True, default=plain_value).encode())
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
    journals = [file for file in bag.iterdir() if file.name.endswith(('-wal', '-journal'))]
    metadata = bag / METADATA
    return [*files, *sorted(journals), *([metadata] if metadata.is_file() else [])]


@lru_cache
def _code_digest() -> str:
    """Return a digest of this package's own code."""
    digest = hashlib.blake2b(digest_size=20)
    package = Path(__file__).parents[1]  # all of it: a result depends on the model as well
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
        # A process died, and all that was under way with it: which one killed it, each tells in
        # a process of its own.
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
        # Not forked: the engines' threads would not survive that.
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
    """Finish what is under way at Ctrl-C, but end with the parent, however that ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that start in the block compute with one thread: there is one a core."""
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
    distributed = require_dask()
    try:
        client = distributed.Client(scheduler, timeout='10s')
    except (OSError, ValueError, TimeoutError) as error:
        raise RobotDynamicsError(
            f'no Dask scheduler answers at {scheduler!r}: {error}') from None
    with client:
        futures = {
            client.submit(one, (bag.resolve(), settings), pure=False): i
            for i, (bag, settings) in enumerate(jobs)}
        for future in distributed.as_completed(futures):
            i = futures[future]
            failure = future.exception()
            yield i, future.result() if failure is None else TaskOutcome(
                jobs[i][0], error=f'{type(failure).__name__}: {failure}')


def require_dask() -> Any:
    """Return the module of Dask's cluster; raise MissingDependencyError without it."""
    return optional('distributed', 'a Dask cluster')
