# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The node in long operation: states at 500 Hz, calls of all services, and pauses of the states.

`scripts/test -m soak` runs a short form of half a minute and a long one of ten minutes. Both
check answers, finite numbers and memory, independent of the load of the machine. The long form,
for an otherwise idle machine, also checks a deadline. The deadline is missed if the first effort
of a fault action is published later after the effort of the last state than the timeout plus one
period, plus the delay with which a process that only sleeps woke up at that time.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
import signal
import sys
import threading
import time
from typing import Any

import children
from fault_bench import fault_bench, FaultBench
from joint_state_driver import DriverProcess
import numpy as np
import numpy.typing as npt
import pytest
from ros_harness import TIMEOUT
from soak_load import ServiceLoad

SUPPORT = Path(__file__).parents[1] / 'support'
RATE, STATE_TIMEOUT = 500.0, 0.05
FEWEST_SILENCES = 4
LOOK = 0.5
"""[s] between two looks at the memory."""
MOST_GROWTH = 5e6
"""[bytes] after the warm-up."""
SLACK = 0.01
"""[s] for the watch thread to get the interpreter, and for an effort to be published."""


@contextmanager
def watching(what: str, *arguments: str) -> Iterator[None]:
    """Run a process of `soak_watch`; it has written its file when the context ends."""
    process = children.popen(
        [sys.executable, str(SUPPORT / 'soak_watch.py'), what, *arguments])
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(TIMEOUT)


def resident(pid: int) -> int:
    """Return the memory of a process in RAM [bytes]."""
    lines = Path(f'/proc/{pid}/smaps_rollup').read_text(encoding='ascii').splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith('Rss'))


def work(
    bench: FaultBench, load: ServiceLoad, duration: float, apart: float,
) -> tuple[list[int], int]:
    """
    Run for `duration` [s], and until there were enough pauses at the required interval.

    Return the memory over time, and the number of pauses.
    """
    memory, silences, pause = [], 0, threading.Event()
    begin = time.monotonic()
    while not load.wrong and (
            time.monotonic() - begin < duration or silences < FEWEST_SILENCES):
        pause.wait(LOOK)
        memory.append(resident(bench.node.pid))
        if time.monotonic() - begin > (silences + 1) * apart:
            bench.driver.be_quiet()
            bench.wait_fault('state_timeout')
            bench.driver.go_on()
            silences += 1
    return memory, silences


def overdue(efforts: npt.NDArray[Any], late: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """
    Return by how much [s] each fault action was late, less the delay of the computer at that time.

    `efforts` has rows of number, time of publication and stamp [ns]; `late` has rows of the time
    [s] at which a process was to wake up, and its delay [s].
    """
    number, published, stamp = efforts.T
    repeated = np.diff(stamp) == 0
    first = np.flatnonzero(repeated & ~np.concatenate([[False], repeated[:-1]])) + 1
    first = first[number[first] - number[first - 1] == 1]  # no message was lost in between
    begin, end = 1e-9 * published[first - 1], 1e-9 * published[first]
    excuse = [
        max(late[(late[:, 0] < b) & (late[:, 0] + late[:, 1] > a), 1], default=0.0)
        for a, b in zip(begin, end)]
    return np.asarray(end - begin - STATE_TIMEOUT - 1.0 / RATE - np.array(excuse))


@pytest.mark.soak
@pytest.mark.parametrize(('duration', 'apart', 'has_deadline'), [
    pytest.param(24.0, 4.0, False, id='short'),
    pytest.param(600.0, 10.0, True, id='ten minutes')])
def test_soak(client, tmp_path, duration, apart, has_deadline):
    parameters = {'state_timeout': STATE_TIMEOUT, 'hold_time': 0.2, 'ramp_time': 0.1}
    recorded, woken = tmp_path / 'efforts.npz', tmp_path / 'late.npz'
    with fault_bench(
            client, '/soak', parameters, driver_type=partial(DriverProcess, rate=RATE)) as bench:
        bench.stop_listening()
        with watching('record', str(recorded), '/soak'), watching('wake', str(woken)):
            load = ServiceLoad(client, '/soak/dynamics')
            load.start()
            try:
                memory, silences = work(bench, load, duration, apart)
            finally:
                load.close()
        answered, wrong, log = load.answered, load.wrong, bench.node.log
    found, late = np.load(recorded), np.load(woken)['late']
    misses = overdue(found['efforts'], late)
    latest = misses.max(initial=-np.inf)
    warm = memory[len(memory) // 3:]
    growth = max(warm) - warm[0]
    print(f'\n{duration:g} s: {int(found["received"])} messages received, {answered} requests '
          f'answered, {silences} silences, {len(misses)} fault actions, the latest '
          f'{1e3 * latest:.1f} ms after its deadline; memory {1e-6 * warm[0]:.1f} MB and '
          f'{1e-6 * growth:.1f} MB more')
    assert not wrong
    assert int(found['not_finite']) == 0
    assert int(found['received']) > 0
    assert growth < MOST_GROWTH
    assert 'Traceback' not in log
    if has_deadline:
        assert len(misses) >= silences // 2  # the recorder lost an effort of some
        assert latest <= SLACK
