# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Profile of one message in `dynamics_node`, from taking the message to publishing its answers.

The benchmark times the functions of the node while the node follows a trajectory at 500 Hz, and
again while the node processes one state repeatedly without pause: data in the caches of the
processor cost a fraction of data that it has to fetch after two idle milliseconds.
"""

from collections.abc import Callable
import json
from pathlib import Path
import statistics
import struct
import sys
import tempfile
import time
from typing import Any

from benchmarks.control_path import Asker, follow_on
from benchmarks.processes import arm_file, DYNAMICS, module, node_command, running
import rclpy

JOINTS = 7
SERIES = 6
"""Of half a thousand messages each."""
MESSAGES_BEFORE, HOT_MESSAGES = 2500, 3000
SPARE = 2e-7
"""[s] that the clock takes, about."""
STEPS = (
    ('take the bytes', 'robot_dynamics.ros.middleware.message_loop:MessageLoop._take', 0),
    ('all that follows', 'robot_dynamics.ros.middleware.message_loop:MessageLoop._deliver', 0),
    ('read the numbers',
     'robot_dynamics.ros.middleware.cdr_templates:JointStateDecoder.decode', 1),
    ('find the joints',
     'robot_dynamics.ros.middleware.joint_state_reader:JointStateReader.read', 1),
    ('loop', 'robot_dynamics.control.loop:ControlLoop.answer', 1),
    ('control law', 'robot_dynamics.control.controller:Controller.answer', 2),
    ('g(q)', 'robot_dynamics.model.unchecked_rigid_body:UncheckedRigidBody.gravity', 2),
    ('reference and feedback',
     'robot_dynamics.control.laws.error_feedback:ErrorFeedback.track', 2),
    ('inverse dynamics',
     'robot_dynamics.model.unchecked_rigid_body:UncheckedRigidBody.inverse_dynamics', 2),
    ('rate limit', 'robot_dynamics.control.safety.effort_limiter:EffortLimiter.rate_limited', 2),
    ('check of the velocities',
     'robot_dynamics.monitoring.motion_consistency:MotionConsistency.update', 2),
    ('publish it, to one reader',
     'robot_dynamics.ros.dynamics.command_output:CommandOutput.publish', 2),
    ('all topics after the command',
     'robot_dynamics.ros.dynamics.control_path:ControlPath._publish', 1),
)
"""What it is, the function, and how deep it lies."""


class Stopwatch:
    """Times of wrapped functions."""

    def __init__(self) -> None:
        self.times: dict[str, list[float]] = {words: [] for words, *_ in STEPS}

    def wrap(self) -> None:
        """Time each of the steps from now on."""
        for words, where, _ in STEPS:
            module_name, path = where.split(':')
            class_name, name = path.split('.')
            owner = getattr(__import__(module_name, fromlist=[class_name]), class_name)
            setattr(owner, name, self._timed(getattr(owner, name), self.times[words]))

    def _timed(self, function: Callable[..., Any], times: list[float]) -> Callable[..., Any]:
        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                times.append(time.perf_counter() - start - SPARE)

        return timed

    def take_medians(self) -> dict[str, float]:
        """Return the medians of the second half of the times of each function; clear all times."""
        found = {words: statistics.median(times[len(times) // 2:])
                 for words, times in self.times.items() if times}
        for times in self.times.values():
            times.clear()
        return found


def main() -> None:
    """Print µs per step."""
    with tempfile.TemporaryDirectory() as directory, arm_file(JOINTS) as urdf:
        path = Path(directory, 'times.json')
        command = node_command(DYNAMICS, {
            'robot_description_file': urdf, 'state_timeout': 10.0, 'effort_check': 'false'})
        arguments = command[command.index('--ros-args'):]
        with running({'node': module('benchmarks.message_profile', str(path), *arguments)}):
            _drive()
        cold, hot = json.loads(path.read_text(encoding='utf-8'))
    print(f'{"µs, medians":36}{"at 500 Hz":>10}{"at once":>10}')
    for words, _, depth in STEPS:
        times = ''.join(
            f'{1e6 * each[words]:10.1f}' if words in each else f'{"":10}' for each in (cold, hot))
        print(f'{"  " * depth + words:36}{times}')


def _drive() -> None:
    rclpy.init()
    try:
        node = rclpy.create_node('bench')
        asker = Asker(node, 'joint_states', 'effort_command')
        asker.connect()
        follow_on(node)
        for _ in range(SERIES):
            asker.series()
    finally:
        rclpy.try_shutdown()


# ----------------------------------------------------------------------- the process of the node

def _measure_in(path: Path) -> None:
    """Time the steps in this process; write the medians once enough messages have arrived."""
    from robot_dynamics.ros.middleware.message_loop import MessageLoop

    stopwatch = Stopwatch()
    stopwatch.wrap()
    take, taken_so_far = MessageLoop._take, 0

    def take_and_count(loop: MessageLoop) -> bytes | None:
        nonlocal taken_so_far
        data = take(loop)
        taken_so_far += 1
        if taken_so_far == MESSAGES_BEFORE and data is not None:
            cold = stopwatch.take_medians()
            _repeat(loop, data)
            path.write_text(json.dumps([cold, stopwatch.take_medians()]), encoding='utf-8')
        return data

    MessageLoop._take = take_and_count  # type: ignore[method-assign, assignment]


def _repeat(loop: Any, data: bytes) -> None:
    """Pass a state to the control path repeatedly, with the current time as its stamp."""
    state = bytearray(data)
    for _ in range(HOT_MESSAGES):
        state[4:12] = struct.pack('<iI', *divmod(time.time_ns(), 1_000_000_000))
        loop._deliver(bytes(state))


if __name__ == '__main__':
    from robot_dynamics.ros.dynamics import node as dynamics_node

    _measure_in(Path(sys.argv[1]))
    sys.exit(dynamics_node.main(sys.argv[1:]))
