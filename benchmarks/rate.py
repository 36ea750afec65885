# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The closed loop of `simulated_arm` and `dynamics` in wall time: missed cycles, jitter, latency.

Both nodes are separate processes. They share two cores with this process, which records their
messages (`loop_listener`). A cycle counts as missed if no state was published in it, or if its
state had no effort before the next state; messages that the listener missed count as missed by the
loop. Cycles count only once the arm has caught up with its lag after the start.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import os
import time
from typing import NamedTuple

from benchmarks.loop_listener import Cycles, in_microseconds, LoopListener
from benchmarks.processes import (
    arm_file,
    bench_node,
    DYNAMICS,
    node_command,
    on_two_cores,
    processor_seconds,
    running,
    SIMULATED_ARM,
)
from benchmarks.slow_motion import follow_slow_motion, hanging
from benchmarks.witness import watch
import numpy as np
from rclpy.node import Node

JOINTS = 7
RATE, SECONDS = 1000.0, 60.0
WATCHED = 10.0
"""[s] that the machine is watched before."""
SHORT, TRIES = 5.0, 2
"""[s] of a run that looks for the highest rate, and how many a rate may have."""
MOST_MISSED, HOPELESS = 1e-3, 1e-2
"""Shares of the cycles: what still holds, and what need not be tried again."""
LOWEST_RATE, HIGHEST_RATE = 50.0, 10_000.0
"""[Hz]; the latter is the most that `simulated_arm` allows."""
RESOLUTION = 1.1
"""Ratio between a rate that does not hold and the highest that does, where the search ends."""
WARM_UP, GRACE = 1.0, 0.3
"""[s] before the first cycle that counts, and after the last."""
LONGEST_WARM_UP, LATE = 5.0, 0.005
"""[s] that the arm gets to catch up what it lags behind after the start, and what is no lag."""
TIMEOUT = 30.0


def main() -> None:
    """Print the outcomes of the cycles at RATE, and the highest rate that the loop sustains."""
    with on_two_cores(), arm_file(JOINTS) as urdf:
        gaps = watch(WATCHED)
        print(f'The machine itself, two cores for {WATCHED:g} s: processes that only read the '
              f'clock could not do so in {100.0 * gaps.missed(1.0 / RATE):.3f} % of the periods '
              f'of {RATE:g} Hz, for {1e3 * gaps.longest:.1f} ms at the longest')
        with bench_node() as node:
            _measure(node, urdf)


def _measure(node: Node, urdf: str) -> None:
    _report(node, urdf)
    print(f'Highest rate with less than {100.0 * MOST_MISSED:g} % missed cycles, in the best '
          f'of {TRIES} runs of {SHORT:g} s each:')
    highest = highest_rate(node, urdf)
    print(f'  highest rate that holds: {highest:.0f} Hz' if highest else '  none holds')


@contextmanager
def closed_loop(node: Node, urdf: str, rate: float, seconds: float) -> Iterator[
        tuple[LoopListener, dict[str, int]]]:
    """Yield a listener to the running loop, which follows a motion, and the process ids."""
    with running({
            'dynamics': node_command(DYNAMICS, {'robot_description_file': urdf}),
            'simulated_arm': node_command(SIMULATED_ARM, {
                'robot_description_file': urdf, 'rate': rate,
                'initial_position': hanging(JOINTS)})}) as pids:
        listener = LoopListener(node)
        try:
            listener.connect(TIMEOUT)
            follow_slow_motion(node, JOINTS, seconds)
            yield listener, pids
        finally:
            listener.close()


class Run(NamedTuple):
    """Result of a run: its cycles, the cores used per process, and naps a period or more late."""

    cycles: Cycles
    cores: dict[str, float]
    late_naps: float


def measure(node: Node, urdf: str, rate: float, seconds: float) -> Run:
    """Return the result of a run of the loop."""
    with closed_loop(node, urdf, rate, seconds + 20.0) as (listener, pids):
        processes = {**pids, 'listener': os.getpid()}
        begin = time.monotonic()
        listener.listen(WARM_UP)
        while listener.lag() > LATE and time.monotonic() - begin < LONGEST_WARM_UP:
            listener.listen(WARM_UP)
        after, start = listener.newest_stamp(), time.monotonic()
        before = _processor_times(processes)
        late = listener.listen(seconds)
        passed = time.monotonic() - start
        cores = {name: (now - before[name]) / passed
                 for name, now in _processor_times(processes).items()}
        listener.listen(GRACE)
        cycles = listener.cycles(after, round(1e9 / rate), round(seconds * rate))
        return Run(cycles, cores, float(np.mean(late > 1.0 / rate)))


def _processor_times(processes: dict[str, int]) -> dict[str, float]:
    return {name: processor_seconds(pid) for name, pid in processes.items()}


def _report(node: Node, urdf: str) -> None:
    cycles, cores, _ = measure(node, urdf, RATE, SECONDS)
    print(f'{RATE:g} Hz for {SECONDS:g} s, {JOINTS} joints: {cycles.count} cycles, '
          f'{cycles.states} states sent, {cycles.answered} efforts answered')
    print(f'  missed cycles: {cycles.missed} ({100.0 * cycles.missed_fraction:.3f} %): '
          f'{cycles.paused} without a state, {cycles.unanswered} without an effort before the '
          'next state')
    print(f'  besides, {cycles.behind} efforts acted a period later than they should, '
          f'{cycles.late_states} states were more than a period late')
    for what, times in (
            ('jitter of the period between efforts', cycles.jitter),
            ('state: stamp to publication', cycles.state_delay),
            ('state published to effort published', cycles.answer_time),
            ('state: stamp to effort published', cycles.latency)):
        print(f'  {what:38}{in_microseconds(times)}')
    print('  processor, in cores: ' + ', '.join(
        f'{name} {fraction:.2f}' for name, fraction in cores.items()))


def highest_rate(node: Node, urdf: str) -> float:
    """Return the highest sustained rate [Hz], by doubling and bisection; 0 without one."""
    low, high = 0.0, RATE
    while _holds(node, urdf, high):
        low, high = high, min(2.0 * high, HIGHEST_RATE)
        if low == high:
            return low
    rate = high
    while low == 0.0:
        rate /= 2.0
        if rate < LOWEST_RATE:
            return 0.0
        low, high = (rate, high) if _holds(node, urdf, rate) else (0.0, rate)
    while high / low > RESOLUTION:
        middle = round((low * high) ** 0.5, -1)
        low, high = (middle, high) if _holds(node, urdf, middle) else (low, middle)
    return low


def _holds(node: Node, urdf: str, rate: float) -> bool:
    for _ in range(TRIES):
        cycles, _, late_naps = measure(node, urdf, rate, SHORT)
        print(f'  {rate:6.0f} Hz: missed {100.0 * cycles.missed_fraction:7.3f} %, effort a period '
              f'behind {100.0 * cycles.behind / cycles.count:7.3f} %; naps a period late '
              f'{100.0 * late_naps:.3f} %', flush=True)
        if not MOST_MISSED <= cycles.missed_fraction < HOPELESS:
            break
    return cycles.missed_fraction < MOST_MISSED


if __name__ == '__main__':
    main()
