# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The control path while another process calls services: round trips without and with them.

The benchmark also calls the same services of a node that only echoes, and of a second `dynamics`
that receives no joint states. The effect of these two nodes on the control path is the cost of
sharing the cores. The additional effect of calls to the first `dynamics` is the cost of serving
in the same process.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import itertools
import subprocess
import sys
import threading
import time
from typing import Any

from benchmarks.control_path import Asker, MESSAGES
from benchmarks.processes import (
    arm_file,
    bench_node,
    DYNAMICS,
    module,
    node_command,
    on_two_cores,
    processor_seconds,
    running,
)
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from robot_dynamics_interfaces.srv import (
    ForwardDynamics,
    InverseDynamics,
    InverseDynamicsBatch,
    ManipulatorEquation,
)

JOINTS = 7
CALL_RATE = 100.0
BATCH_EVERY, SAMPLES = 50, 10_000
"""One call in so many is a batch of so many samples."""
ROUNDS = 10
PAUSE = 0.3
"""[s] for calls to begin, or for the last of them to be answered."""
LONGER_THAN_A_PAUSE = 10.0
"""[s]; the end of a series of joint states is no fault."""
TIMEOUT = 30.0
ALONE = 'no calls'
ECHO, OTHER, SERVED = 'to an echo', 'to another dynamics', 'to this dynamics'
TARGETS = {ECHO: 'echo', OTHER: 'other', SERVED: 'dynamics'}
KINDS = {
    'inverse_dynamics': InverseDynamics,
    'manipulator_equation': ManipulatorEquation,
    'forward_dynamics': ForwardDynamics,
    'inverse_dynamics_batch': InverseDynamicsBatch,
}


def requests() -> dict[str, Any]:
    """Return a request of each kind by the name of its service."""
    numbers = [0.1] * JOINTS
    batch = InverseDynamicsBatch.Request()
    batch.position, batch.velocity, batch.acceleration = (
        memoryview(rows).cast('B').cast('d')
        for rows in np.random.default_rng(0).uniform(-1.0, 1.0, (3, SAMPLES, JOINTS)))
    return {
        'inverse_dynamics': InverseDynamics.Request(
            position=numbers, velocity=numbers, acceleration=numbers),
        'manipulator_equation': ManipulatorEquation.Request(position=numbers, velocity=numbers),
        'forward_dynamics': ForwardDynamics.Request(
            position=numbers, velocity=numbers, effort=numbers),
        'inverse_dynamics_batch': batch,
    }


class Echo(Node):
    """Answers the same calls with as many numbers, without computing them."""

    def __init__(self) -> None:
        super().__init__('echo')
        row, square = [0.1] * JOINTS, [0.1] * JOINTS**2

        def offer(name: str, fill: Callable[[Any, Any], None]) -> None:
            def answer(request: Any, response: Any) -> Any:
                fill(request, response)
                response.success = True
                return response

            self.create_service(KINDS[name], f'~/{name}', answer)

        def inverse_dynamics(_: Any, response: Any) -> None:
            terms = response.terms
            response.effort = terms.inertial = terms.coriolis = terms.gravity = row
            terms.friction = terms.external = terms.effort = row

        def manipulator_equation(_: Any, response: Any) -> None:
            response.mass_matrix = response.coriolis_matrix = square
            response.gravity = response.nonlinear = response.friction = row

        def forward_dynamics(_: Any, response: Any) -> None:
            response.acceleration = row

        def batch(request: Any, response: Any) -> None:
            response.effort = request.position

        offer('inverse_dynamics', inverse_dynamics)
        offer('manipulator_equation', manipulator_equation)
        offer('forward_dynamics', forward_dynamics)
        offer('inverse_dynamics_batch', batch)


def run_echo() -> None:
    """Run the echo node in this process."""
    rclpy.init()
    try:
        rclpy.spin(Echo())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


# ---------------------------------------------------------------- the process that calls


class Caller:
    """Calls all services of a node in turn, without waiting for the answers."""

    def __init__(self, node: Node, target: str) -> None:
        self._clients = {
            name: node.create_client(kind, f'{target}/{name}') for name, kind in KINDS.items()}
        for name, client in self._clients.items():
            if not client.wait_for_service(TIMEOUT):
                raise TimeoutError(f'no service {target}/{name} in {TIMEOUT:g} s')
        self._requests = requests()
        self._numbers = itertools.count(1)
        self.answered = self.refused = 0

    def call(self) -> None:
        """Make the next call."""
        number = next(self._numbers)
        single = list(self._requests)[number % (len(self._requests) - 1)]
        name = single if number % BATCH_EVERY else 'inverse_dynamics_batch'
        future = self._clients[name].call_async(self._requests[name])
        future.add_done_callback(self._on_answer)

    def _on_answer(self, future: Any) -> None:
        self.answered += 1
        self.refused += not future.result().success


def run_caller() -> None:
    """Call the node last named on the standard input; call none after an empty line."""
    with bench_node('caller') as node:
        callers = {target: Caller(node, target) for target in TARGETS.values()}
        print('ready', flush=True)
        current: list[Caller | None] = [None]
        ended = threading.Event()

        def listen() -> None:
            for line in sys.stdin:
                current[0] = callers.get(line.strip())
            ended.set()

        threading.Thread(target=listen, daemon=True).start()
        due = time.monotonic()
        while not ended.is_set():
            due = max(due + 1.0 / CALL_RATE, time.monotonic() - 10.0 / CALL_RATE)
            time.sleep(max(0.0, due - time.monotonic()))
            if current[0] is not None:
                current[0].call()
        for target, caller in callers.items():
            print(target, caller.answered, caller.refused, flush=True)


@contextmanager
def calling() -> Iterator[Callable[[str], None]]:
    """Yield a function that names the node to call, '' for none; print the answers at the end."""
    with subprocess.Popen(
            module('benchmarks.disturbance', 'caller'), stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, text=True, bufsize=1) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        stdin = process.stdin
        try:
            if process.stdout.readline() != 'ready\n':
                raise RuntimeError('the process that calls services did not start')

            def call(target: str) -> None:
                stdin.write(f'{target}\n')
                time.sleep(PAUSE)

            yield call
        finally:
            stdin.close()
            counts = {line.split()[0]: line.split()[1:] for line in process.stdout}
            process.wait()
    for name, target in TARGETS.items():
        answered, refused = counts[target]
        print(f'  {answered} calls {name} answered, {refused} of them refused')


# ---------------------------------------------------------------- the measurement


def main() -> None:
    """Print round trips and their ratios."""
    with on_two_cores(), arm_file(JOINTS) as urdf:
        dynamics = node_command(DYNAMICS, {
            'robot_description_file': urdf, 'state_timeout': LONGER_THAN_A_PAUSE})
        with running({
                'dynamics': dynamics,
                'echo': module('benchmarks.disturbance', 'echo'),
                'other': [*dynamics, '-r', '__node:=other', '-r', 'joint_states:=no_states',
                          '-r', 'effort_command:=no_efforts']}) as pids, \
                calling() as call:
            rclpy.init()
            try:
                asker = Asker(rclpy.create_node('bench'), 'joint_states', 'effort_command')
                asker.connect()
                _measure(asker, call, pids)
            finally:
                rclpy.try_shutdown()


def _measure(asker: Asker, call: Callable[[str], None], pids: dict[str, int]) -> None:
    targets = {ALONE: '', **TARGETS}
    trips: dict[str, list[float]] = {name: [] for name in targets}
    work, passed = dict.fromkeys(targets, 0.0), dict.fromkeys(targets, 0.0)
    for _ in range(ROUNDS):
        for name, target in targets.items():
            call(target)
            before, start = processor_seconds(pids[target or 'dynamics']), time.perf_counter()
            trips[name] += asker.series()
            passed[name] += time.perf_counter() - start
            work[name] += processor_seconds(pids[target or 'dynamics']) - before
            call('')
    p50, p99, p999 = (
        {name: 1e6 * float(np.percentile(values, p)) for name, values in trips.items()}
        for p in (50, 99, 99.9))
    print(f'{CALL_RATE:g} calls/s, one in {BATCH_EVERY} a batch of {SAMPLES} samples; joint state '
          f'to effort, {JOINTS} joints, {len(trips[ALONE])} states each:')
    for name in targets:
        print(f'  calls {name:20}' if name != ALONE else f'  {name:26}', end=' ')
        print(f'p50 {p50[name]:5.0f} µs, p99 {p99[name]:5.0f} µs ({p99[name] / p99[ALONE]:4.2f} '
              f'times), p99.9 {p999[name]:5.0f} µs; {ROUNDS * MESSAGES - len(trips[name])} lost; '
              f'called node {work[name] / passed[name]:.2f} cores')
    print(f'ratio of p99 with calls and without: {p99[SERVED] / p99[ALONE]:.2f}; sharing the '
          f'cores with the same work alone: {p99[OTHER] / p99[ALONE]:.2f} '
          f'({_percentage(p99, OTHER):.0f} % of the difference), with the same messages alone: '
          f'{p99[ECHO] / p99[ALONE]:.2f} ({_percentage(p99, ECHO):.0f} %)')


def _percentage(p99: dict[str, float], name: str) -> float:
    """Return the increase of p99 by calls to `name` [% of the increase by calls to `dynamics`]."""
    return 100.0 * (p99[name] - p99[ALONE]) / (p99[SERVED] - p99[ALONE])


if __name__ == '__main__':
    {'echo': run_echo, 'caller': run_caller}[sys.argv[1]]()
