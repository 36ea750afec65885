# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Processor instructions per joint state in `dynamics_node`, up to the command.

The benchmark counts instructions with callgrind (valgrind) instead of timing them, so that the
figures repeat to about 0.5 % on a busy machine. A `DynamicsNode` for an arm of 7 joints runs in a
process under callgrind, and a process without callgrind subscribes to `effort_command`. The main
thread passes serialized joint states to `JointStateLoop._deliver`. Counting starts at the call of
`_deliver` and ends before the publish call of `effort_command`. The figure in brackets includes
this publish call. Both figures include:

- for `~/feed_forward`, also the publish call of `effort_command` before it;
- the attempt of `_deliver` to take another message, which finds none;
- decoding, checks, control law, supervisor and serialization of the command.

They do not include the wait for the message and its take, `~/commands` and all that follows the
command, the other threads of the process, and garbage collection (it is disabled). No other topic
than `effort_command` and `~/feed_forward` has a subscriber. The cost of starting and ending the
count is measured separately and subtracted.

The stamps advance by exactly 2 ms per state, although a message takes longer under callgrind: with
the current time as stamp, the measured state rate drops and varies, the node adapts its gains to
it, and the figures vary by 30 %. `state_max_age` is 60 s, so that the slower stamps are accepted.

For comparison, commit 34e2867 has, with CPython 3.11 and numpy 2 [1000 instructions]:

                                               gravity compensation   trajectory
before the publish call (the main figure)                       160          248
including the publish call, no subscriber                       165          253
including the publish call, one subscriber                      175          262
from the callback of the loop to the publish call               136          224
to the return of `_deliver`, no subscriber                      236          340
before the publish call, current time as stamp           178 to 232   276 to 319

Needs valgrind with its header `callgrind.h`, and a C compiler (Debian, Ubuntu: valgrind, gcc).
"""

from collections.abc import Callable, Mapping
import ctypes
import gc
import os
from pathlib import Path
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any

from benchmarks.processes import arm_file, module
import numpy as np
import rclpy
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from robot_dynamics.ros.middleware import rclpy_internals
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = 7
NAMES = [f'joint{i + 1}' for i in range(JOINTS)]
PERIOD = 2_000_000
"""[ns] from one stamp to the next."""
WARM_UP = 600
"""States before each count: gains have their values, and the last segment of the trajectory."""
MESSAGES = 200
COMMAND_TOPIC = 'effort_command'
TIMEOUT = 30.0
EMPTY, PUBLISHED, UNPUBLISHED = 'empty', 'published', 'unpublished'
FEED_FORWARD = 'feed_forward'
MODES = {
    'gravity_compensation': ('gravity_compensation', COMMAND_TOPIC),
    'hand_guiding': ('hand_guiding', COMMAND_TOPIC),
    'trajectory': ('computed_torque', COMMAND_TOPIC),
    'joint_impedance': ('joint_impedance', COMMAND_TOPIC),
    'cartesian_impedance': ('cartesian_impedance', COMMAND_TOPIC),
    FEED_FORWARD: ('computed_torque', FEED_FORWARD)}
"""The parameter `command`, and the topic at whose message counting ends."""
ENVIRONMENT = {
    'PYTHONHASHSEED': '0', 'OPENBLAS_NUM_THREADS': '1', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
COUNTER_SOURCE = """
#include <valgrind/callgrind.h>
void start_instrumentation(void) { CALLGRIND_START_INSTRUMENTATION; }
void toggle(void) { CALLGRIND_TOGGLE_COLLECT; }
void dump(const char *name) { CALLGRIND_DUMP_STATS_AT(name); }
"""
"""Requests to callgrind; `toggle` starts or ends counting in the calling thread."""


def main() -> None:
    """Print the instructions per message of each mode."""
    missing = [name for name in ('valgrind', 'cc') if shutil.which(name) is None]
    if missing:
        sys.exit(f'instructions: needs {" and ".join(missing)} (Debian, Ubuntu: apt-get install '
                 'valgrind gcc)')
    os.environ.update(ENVIRONMENT)
    rclpy.init()
    try:
        node = rclpy.create_node('bench')
        for topic in (COMMAND_TOPIC, f'dynamics/{FEED_FORWARD}'):
            node.create_subscription(JointState, topic, lambda _: None, 1)
        with tempfile.TemporaryDirectory() as directory:
            counts = _counts(Path(directory))
    finally:
        rclpy.try_shutdown()
    for mode in MODES:
        print(f'{mode:22}{counts[mode, UNPUBLISHED]:9,.0f} instructions per message before the '
              f'command ({counts[mode, PUBLISHED]:,.0f} with its publish call)')


def _counts(directory: Path) -> dict[tuple[str, str], float]:
    """Run the node under callgrind; return the instructions per message by mode and end."""
    source, library = directory / 'counter.c', directory / 'counter.so'
    source.write_text(COUNTER_SOURCE, encoding='ascii')
    subprocess.run(['cc', '-shared', '-fPIC', '-O2', '-o', library, source], check=True)
    subprocess.run(  # rclpy may replace its process by another one: --trace-children
        ['valgrind', '--quiet', '--tool=callgrind', '--trace-children=yes', '--instr-atstart=no',
         '--collect-atstart=no', f'--callgrind-out-file={directory}/counts.%p',
         *module('benchmarks.instructions', str(library))], check=True)
    found: dict[tuple[str, str], float] = {}
    for path in directory.glob('counts.*'):
        text = path.read_text(encoding='utf-8', errors='replace')
        label = re.search(r'^desc: Trigger: Client Request: (\w+)-(\w+)$', text, re.MULTILINE)
        total = re.search(r'^totals: (\d+)$', text, re.MULTILINE)
        if label is not None and total is not None:
            found[label[1], label[2]] = int(total[1]) / MESSAGES
    empty = found[EMPTY, EMPTY]
    return {key: count - empty for key, count in found.items()}


# ------------------------------------------------------------------- the process under callgrind

class Counter:
    """Counts the instructions of the main thread, with the requests of COUNTER_SOURCE."""

    def __init__(self, library: str) -> None:
        functions = ctypes.CDLL(library)
        self.toggle: Callable[[], object] = functions.toggle
        """Starts or ends counting."""
        self._dump = functions.dump
        functions.start_instrumentation()

    def store(self, mode: str, end: str) -> None:
        """Write the count to a file, and start the next one at 0."""
        self._dump(f'{mode}-{end}'.encode('ascii'))


class CommandPublisher:
    """Publishes the command by the function `publish`, which can be replaced at any time."""

    def __init__(self, publisher: Any, publish: Callable[[bytes], None]) -> None:
        self.original = self.publish = publish
        self.published = 0
        self._publisher = publisher

    def __call__(self, data: bytes) -> None:
        self.published += 1
        self.publish(data)

    def wait_for_subscriber(self) -> None:
        """Wait until a subscriber is discovered; raise TimeoutError without one."""
        deadline = time.monotonic() + TIMEOUT
        while not self._publisher.get_subscription_count():
            if time.monotonic() > deadline:
                raise TimeoutError(
                    f'no subscriber of {self._publisher.topic_name} after {TIMEOUT:g} s')
            time.sleep(0.01)


class NodeUnderTest:
    """A `DynamicsNode` that gets its joint states from the main thread."""

    def __init__(self, urdf: str) -> None:
        """`robot_dynamics.ros` must not have been imported beyond `rclpy_internals`."""
        self.commands: dict[str, CommandPublisher] = {}
        original = rclpy_internals.raw_publish

        def raw_publish(publisher: Any) -> Callable[[bytes], None]:
            publish = original(publisher)
            topic = publisher.topic_name.split('/')[-1]
            if topic not in (COMMAND_TOPIC, FEED_FORWARD):
                return publish
            self.commands[topic] = CommandPublisher(publisher, publish)
            return self.commands[topic]

        rclpy_internals.raw_publish = raw_publish  # before other modules import it
        from robot_dynamics.ros.dynamics.node import DynamicsNode

        self._stamp = 0
        self._data = bytearray(serialize_message(
            JointState(name=NAMES, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)))
        parameters: Mapping[str, Any] = {
            'robot_description_file': urdf, 'state_timeout': 60.0, 'state_max_age': 60.0}
        self._node = DynamicsNode(parameter_overrides=[
            Parameter(name, value=value) for name, value in parameters.items()])
        self.deliver: Callable[[bytes], None] = self._node._loop._deliver

    def next_state(self) -> bytes:
        """Return a joint state, PERIOD after the last one."""
        self._stamp += PERIOD
        self._data[4:12] = struct.pack('<iI', *divmod(self._stamp, 1_000_000_000))
        return bytes(self._data)

    def restart_stamps(self) -> None:
        """Continue from the present time: on a busy machine the stamps become too old."""
        self._stamp = time.time_ns()
        for _ in range(20):
            self.deliver(self.next_state())

    def set_command(self, command: str) -> None:
        """Set the parameter `command`."""
        result, = self._node.set_parameters([Parameter('command', value=command)])
        if not result.successful:
            raise RuntimeError(result.reason)

    def follow(self) -> None:
        """Follow a trajectory that does not end."""
        message = JointTrajectory(joint_names=NAMES)
        for seconds, position in ((1, 0.1), (100_000, 0.2)):
            point = JointTrajectoryPoint(
                positions=[position] * JOINTS, velocities=[0.0] * JOINTS,
                accelerations=[0.0] * JOINTS)
            point.time_from_start.sec = seconds
            message.points.append(point)
        self._node._trajectories.take(message, {})

    def close(self) -> None:
        """Check that the node answered every state, ramp the command to zero, destroy the node."""
        counters = self._node._path.states
        if counters.dropped or not counters.following:
            raise RuntimeError(f'states were dropped or no trajectory was followed: {counters}')
        self._node.destroy_node()


def _run(library: str) -> None:
    """Count in this process, which runs under callgrind."""
    counter = Counter(library)
    rclpy.init(args=['--ros-args', '--log-level', 'error'])
    with arm_file(JOINTS) as urdf:
        node = NodeUnderTest(urdf)
    for command in node.commands.values():
        command.wait_for_subscriber()
    for _ in range(MESSAGES):
        counter.toggle()
        counter.toggle()
    counter.store(EMPTY, EMPTY)
    with np.errstate(over='ignore', invalid='ignore'):  # as in the thread of the loop
        for mode, (law, topic) in MODES.items():
            node.restart_stamps()
            node.set_command(law)
            if law not in ('gravity_compensation', 'hand_guiding'):
                node.follow()
            for end in (UNPUBLISHED, PUBLISHED):
                _count(node, counter, node.commands[topic], end == PUBLISHED)
                counter.store(mode, end)
    node.close()
    rclpy.try_shutdown()


def _count(
    node: NodeUnderTest, counter: Counter, command: CommandPublisher, with_publish: bool,
) -> None:
    """Count the instructions of MESSAGES states from `_deliver` to the command."""
    publish, toggle = command.original, counter.toggle

    def publish_and_end(data: bytes) -> None:
        publish(data)
        toggle()

    def end_and_publish(data: bytes) -> None:
        toggle()
        publish(data)

    for _ in range(WARM_UP):
        node.deliver(node.next_state())
    gc.collect()
    gc.disable()
    command.publish = publish_and_end if with_publish else end_and_publish
    before = command.published
    for _ in range(MESSAGES):
        state = node.next_state()
        toggle()
        node.deliver(state)
    command.publish = publish
    gc.enable()
    if command.published - before != MESSAGES:  # counting would start where it has to end
        raise RuntimeError(f'{command.published - before} commands for {MESSAGES} states')


if __name__ == '__main__':
    if len(sys.argv) > 1:
        _run(sys.argv[1])
    else:
        main()
