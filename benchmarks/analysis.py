# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Analysis of recordings, in samples per second and core: reading, filter, terms, residual.

The benchmark writes recordings of joint states as a driver publishes them: position, velocity and
effort of seven joints. One process, bound to one core, analyses each recording. The times of the
steps are processor times, which other processes on the machine do not increase.
"""

import os
from pathlib import Path
import statistics
import tempfile
import time
from typing import Any

from benchmarks.processes import chain_urdf
import numpy as np
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings
from robot_dynamics_tools.analysis.bag_analysis import analyze_recording
from robot_dynamics_tools.analysis.batch import run_tasks
from robot_dynamics_tools.analysis.tasks import AnalysisTask, analyze_task
from robot_dynamics_tools.recordings.messages import joint_state_messages
from robot_dynamics_tools.recordings.topics import JOINT_STATE

JOINTS, SAMPLES, RATE = 7, 200_000, 500.0
ROUNDS = 5
BAGS = 4
FORMATS = {
    'sqlite3': ('SQLITE3', 'NONE'), 'MCAP': ('MCAP', 'NONE'),
    'MCAP, chunks in zstd': ('MCAP', 'STORAGE')}


def main() -> None:
    """Print the times per sample and the throughput."""
    urdf = chain_urdf(JOINTS)
    messages = _messages(urdf)
    settings = AnalysisSettings(urdf)
    cores = os.sched_getaffinity(0)
    with tempfile.TemporaryDirectory() as scratch:
        os.sched_setaffinity(0, {min(cores)})
        print(f'{SAMPLES} samples of {JOINTS} joints, one process on one core, medians of '
              f'{ROUNDS}; µs of processor time per sample:')
        print(f'{"":22}{"read":>7}{"filter":>8}{"terms":>7}{"whole":>7}   samples/s')
        try:
            for name, form in FORMATS.items():
                _print_steps(name, _write(Path(scratch, name), messages, *form), settings)
        finally:
            os.sched_setaffinity(0, cores)
        _print_many(_write(Path(scratch, 'many'), messages, 'MCAP', 'NONE'), settings)


def _print_steps(name: str, bag: Path, settings: AnalysisSettings) -> None:
    rounds = []
    for _ in range(ROUNDS + 1):
        times = [time.process_time()]

        def add_time(_: object, times: list[float] = times) -> None:
            times.append(time.process_time())

        analyze_recording(bag, settings, add_time)
        rounds.append([*np.diff(times), times[-1] - times[0]])
    read, filtered, compared, whole = (statistics.median(column) for column in zip(*rounds[1:]))
    print(f'{name:22}' + ''.join(
        f'{1e6 * part / SAMPLES:{width}.1f}' for part, width in (
            (read, 7), (filtered, 8), (compared, 7), (whole, 7))) + f'{SAMPLES / whole:12.0f}')


def _print_many(bag: Path, settings: AnalysisSettings) -> None:
    """Print the time of the task on many recordings, with one process and with one per core."""
    task = AnalysisTask(settings)
    print(f'{BAGS} of the MCAP recordings, each a task, by processes:')
    for processes in sorted({1, os.cpu_count() or 1}):
        start, used = time.perf_counter(), _processor_seconds()
        outcomes = run_tasks(analyze_task, [bag] * BAGS, task, processes)
        seconds, used = time.perf_counter() - start, _processor_seconds() - used
        assert not any(outcome.error for outcome in outcomes)
        print(f'  {processes} process{"es" if processes > 1 else ""}: {seconds:.1f} s with their '
              f'start, {BAGS * SAMPLES / seconds:.0f} samples/s; {used:.1f} s of processor time, '
              f'{BAGS * SAMPLES / used:.0f} samples/s of it')


def _processor_seconds() -> float:
    """Return the processor time [s] of this process and of its child processes that ended."""
    return sum(os.times()[:4])


def _messages(urdf: str) -> list[tuple[int, bytes]]:
    arm = load_arm(urdf)
    t = np.arange(SAMPLES) / RATE
    rng = np.random.default_rng(0)
    q, v, a = np.zeros((3, SAMPLES, JOINTS))
    for w in 2.0 * np.pi * np.array([0.1, 0.3, 0.7]):
        phase, amplitude = rng.uniform(0.0, 6.0, JOINTS), rng.uniform(0.1, 0.3, JOINTS)
        x = w * t[:, None] + phase
        q += amplitude * np.sin(x)
        v += amplitude * w * np.cos(x)
        a -= amplitude * w**2 * np.sin(x)
    tau = ArmDynamics(arm).inverse_dynamics_batch(q, v, a)
    noise = rng.normal(0.0, 1.0, (3, SAMPLES, JOINTS))
    stamps = np.round(1e9 * (1000.0 + t)).astype(np.int64)
    return list(zip(stamps.tolist(), joint_state_messages(
        stamps, arm.joint_names, q + 1e-5 * noise[0], v + 1e-3 * noise[1], tau + 0.1 * noise[2])))


def _write(path: Path, messages: list[tuple[int, bytes]], storage: str, compression: str) -> Path:
    from rosbags import rosbag2, typesys
    writer: Any = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage])
    writer.set_compression(
        rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(
            '/joint_states', JOINT_STATE,
            typestore=typesys.get_typestore(typesys.Stores.ROS2_JAZZY))
        for time_ns, data in messages:
            writer.write(connection, time_ns, data)
    return path
