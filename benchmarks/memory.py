# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Memory of `dynamics` and `simulated_arm` in the closed loop: at rest, and after many messages.

In lock-step each state waits for its effort, and simulated time runs as fast as the nodes answer
each other. "At rest" is the time just after the first effort.
"""

from pathlib import Path
import re
import time
from typing import NamedTuple

from benchmarks.processes import (
    arm_file,
    bench_node,
    DYNAMICS,
    node_command,
    running,
    SIMULATED_ARM,
)
from benchmarks.slow_motion import follow_slow_motion, hanging
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.ros.middleware.message_bytes import read_message
from robot_dynamics.ros.middleware.rclpy_internals import LEFT_TO_A_THREAD
from sensor_msgs.msg import JointState

JOINTS = 7
RATE = 500.0
STATES = 120_000
"""Four minutes at RATE."""
FRACTIONS = (0.05, 0.25, 0.5, 0.75, 1.0)
"""Of the states, at which to look."""
LOOK = 0.05
"""[s] between two looks at how far the loop is."""
TIMEOUT = 30.0


class Memory(NamedTuple):
    """Memory of one process in RAM [bytes], and the part that no other process shares."""

    resident: int
    private: int


def memory_of(pid: int) -> Memory:
    """Return the memory of a process as Linux reports it."""
    text = Path(f'/proc/{pid}/smaps_rollup').read_text(encoding='ascii')
    found = {name: 1024 * int(kb) for name, kb in re.findall(r'^(\w+):\s+(\d+) kB', text, re.M)}
    return Memory(found['Rss'], found['Private_Clean'] + found['Private_Dirty'])


class Progress:
    """Counts the states that the loop has processed, by the stamp of the newest effort."""

    def __init__(self, node: Node) -> None:
        self._subscription = node.create_subscription(
            JointState, 'effort_command', lambda _: None,
            QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
            callback_group=LEFT_TO_A_THREAD, raw=True)
        self._states = 0

    def wait_for(self, states: int) -> int:
        """
        Return once the loop has answered at least this number of states.

        Raises TimeoutError if the loop stops.
        """
        received_at = time.monotonic()
        while self._states < states:
            taken = self._subscription.handle.take_message(JointState, True)
            if taken is not None:
                stamp = read_message(taken[0], JointState).header.stamp
                self._states = round(RATE * (stamp.sec + 1e-9 * stamp.nanosec))
                received_at = time.monotonic()
            elif time.monotonic() - received_at > TIMEOUT:
                raise TimeoutError(f'no effort in {TIMEOUT:g} s')
            time.sleep(LOOK)
        return self._states


def main() -> None:
    """Print the memory over four minutes of messages."""
    with arm_file(JOINTS) as urdf, bench_node() as node:
        progress = Progress(node)
        with running({
                'dynamics': node_command(DYNAMICS, {
                    'robot_description_file': urdf, 'lock_step': True}),
                'simulated_arm': node_command(SIMULATED_ARM, {
                    'robot_description_file': urdf, 'rate': RATE, 'lock_step': True,
                    'initial_position': hanging(JOINTS)})}) as pids:
            print(f'Closed loop of {JOINTS} joints in lock-step, {STATES} states of {RATE:g} Hz '
                  f'({STATES / RATE / 60.0:g} minutes); MB in RAM (of these private), growth:')
            progress.wait_for(1)
            rest = {name: memory_of(pid) for name, pid in pids.items()}
            _print_row('at rest', rest, rest)
            begin = time.monotonic()
            follow_slow_motion(node, JOINTS, STATES / RATE)
            for fraction in FRACTIONS:
                count = progress.wait_for(round(fraction * STATES))
                _print_row(
                    str(count), {name: memory_of(pid) for name, pid in pids.items()}, rest)
            print(f'  {STATES / (time.monotonic() - begin):.0f} states per second')


def _print_row(when: str, found: dict[str, Memory], rest: dict[str, Memory]) -> None:
    columns = [
        f'{name} {1e-6 * memory.resident:6.1f} ({1e-6 * memory.private:5.1f}) '
        f'{1e-6 * (memory.resident - rest[name].resident):+5.1f}'
        for name, memory in found.items()]
    print(f'  {when:>8}: ' + '; '.join(columns), flush=True)


if __name__ == '__main__':
    main()
