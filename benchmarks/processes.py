# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes in separate processes, for benchmarks that use ROS."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import threading

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from robot_dynamics.planar.urdf import planar_arm_urdf

# Nodes on other machines must not exchange messages with the benchmarks.
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))

LONGEST_END = 10.0
"""[s] that a process has to end before it is killed."""
DYNAMICS = 'robot_dynamics.ros.dynamics.node'
SIMULATED_ARM = 'robot_dynamics.ros.simulated_arm.node'
MONITOR = 'robot_dynamics_tools.monitor.node'


def chain_urdf(n: int) -> str:
    """Return a planar arm of n equal links as URDF."""
    ones = [1.0] * n
    return planar_arm_urdf(ones, ones, [0.5] * n, [0.1] * n)


def processor_seconds(pid: int) -> float:
    """Return the processor time [s] that a process has used."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def thread_seconds(pid: int) -> dict[str, float]:
    """Return the processor time [s] of each thread of a process, by its identifier."""
    used = {}
    for stat in Path(f'/proc/{pid}/task').glob('*/stat'):
        fields = stat.read_text(encoding='ascii').rsplit(')', 1)[1].split()
        used[stat.parent.name] = (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
    return used


def module(name: str, *arguments: str) -> list[str]:
    """Return the command that runs a Python module."""
    return [sys.executable, '-m', name, *arguments]


@contextmanager
def arm_file(n: int) -> Iterator[str]:
    """Yield the path of a URDF file of an arm of n joints."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory, 'arm.urdf')
        path.write_text(chain_urdf(n), encoding='utf-8')
        yield str(path)


def node_command(node: str, parameters: Mapping[str, object]) -> list[str]:
    """Return the command that runs a node with these parameters."""
    arguments = [part for name, value in parameters.items() for part in ('-p', f'{name}:={value}')]
    return module(node, '--ros-args', '--log-level', 'error', *arguments)


@contextmanager
def running(commands: Mapping[str, Sequence[str]]) -> Iterator[dict[str, int]]:
    """Run processes; yield their ids by name, and end them all."""
    processes = {name: subprocess.Popen(command) for name, command in commands.items()}
    try:
        yield {name: process.pid for name, process in processes.items()}
    finally:
        for process in processes.values():
            _end(process)


def _end(process: 'subprocess.Popen[bytes]') -> None:
    """End a process; kill it after LONGEST_END: Fast DDS may hang if other processes end too."""
    process.terminate()
    try:
        process.wait(LONGEST_END)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def on_two_cores() -> Iterator[None]:
    """Bind this process and its child processes to two cores, if there are more."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(cores)[:2])
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


@contextmanager
def bench_node(name: str = 'bench') -> Iterator[Node]:
    """Yield a node of this process, which spins in a thread."""
    rclpy.init()
    node = rclpy.create_node(name)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    try:
        yield node
    finally:
        executor.shutdown()
        spinning.join()
        rclpy.try_shutdown()
