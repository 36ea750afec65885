# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The node in long operation: states at 500 Hz, calls of all services, and pauses of the states.

`scripts/test -m soak` runs a short form of half a minute and a long one of ten minutes. Both
check answers and memory, independent of the load of the machine.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
import threading
import time
from typing import Any, NamedTuple

from fault_bench import fault_bench, FaultBench, NAMES, Q
from joint_state_driver import DriverProcess
from lifecycle_msgs.srv import ChangeState, GetState
import numpy as np
import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter
from robot_dynamics.model.payload import make_payload
from robot_dynamics.ros.middleware.conversions import floats_to_ros, payload_to_ros
from ros_harness import RosClient, TIMEOUT
from service_requests import NAN, REFUSALS, SERVICES
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

SAMPLES, POINTS = 3000, 100
"""Samples of a batch, and points of a trajectory."""
TYPES: dict[str, Any] = {
    **SERVICES, 'set_parameters': SetParameters, 'get_parameters': GetParameters,
    'describe_parameters': DescribeParameters, 'list_parameters': ListParameters,
    'reset_fault': Trigger, 'get_state': GetState, 'change_state': ChangeState}
FRACTION = 'effort_limit_fraction'


class Call(NamedTuple):
    """A service, the fields of a request, and a check of the answer."""

    name: str
    fields: dict[str, Any]
    is_right: Callable[[Any], bool]

    @property
    def request(self) -> Any:
        return TYPES[self.name].Request(**self.fields)


def succeeds(response: Any) -> bool:
    """Return whether a response reports success."""
    return bool(response.success)


def refuses(response: Any) -> bool:
    """Return whether a response rejects the request with a message."""
    return not response.success and bool(response.message)


def trajectory(times: Sequence[float]) -> JointTrajectory:
    """Return a trajectory near the pose of the driver, at rest at the last of these times [s]."""
    message = JointTrajectory(joint_names=NAMES)
    for t in times:
        point = JointTrajectoryPoint(
            positions=[q + 0.01 * np.sin(t) for q in Q], velocities=[0.01 * np.cos(t)] * 2)
        point.time_from_start.sec = int(t)
        point.time_from_start.nanosec = int(t % 1.0 * 1e9)
        message.points.append(point)
    message.points[-1].velocities = [0.0, 0.0]
    return message


def setting(name: str, value: Any) -> dict[str, Any]:
    """Return the fields of a request to set a parameter."""
    return {'parameters': [Parameter(name, value=value).to_parameter_msg()]}


def set_is(successful: bool) -> Callable[[Any], bool]:
    """Return a check whether a parameter was set, or rejected with a reason."""
    return lambda response: response.results[0].successful is successful and (
        successful or bool(response.results[0].reason))


def calls() -> list[Call]:
    """Return one request of each kind."""
    many = floats_to_ros(np.tile(Q, SAMPLES))
    times = np.linspace(0.1, 3.0, POINTS)
    parameters = [FRACTION, 'gains.natural_frequency', 'robot_description']
    return [
        *(Call(name, fields, refuses)  # one of each service, whose queues have ten places
          for name, fields in {name: fields for name, fields, _ in REFUSALS}.items()),
        Call('inverse_dynamics', {'position': Q}, succeeds),
        Call('inverse_dynamics_batch', {
            'position': many, 'velocity': many, 'acceleration': many}, succeeds),
        Call('inverse_dynamics_trajectory', {'trajectory': trajectory(times)}, succeeds),
        Call('forward_dynamics', {'position': Q, 'effort': [1.0, 1.0]}, succeeds),
        Call('manipulator_equation', {
            'position': Q, 'velocity': [1.0, -1.0], 'include_christoffel': True}, succeeds),
        Call('set_payload', {
            'payload': payload_to_ros(make_payload('tool0', 0.5)), 'transition_time': 0.3},
             succeeds),
        Call('set_payload', {}, succeeds),
        Call('set_parameters', setting(FRACTION, 0.9), set_is(True)),
        Call('set_parameters', setting(FRACTION, NAN), set_is(False)),
        Call('set_parameters', setting('gains.natural_frequency', [1.0] * 7), set_is(False)),
        Call('set_parameters', setting('no_such', 1), set_is(False)),
        Call('get_parameters', {'names': parameters},
             lambda response: len(response.values) == len(parameters)),
        Call('describe_parameters', {'names': parameters},
             lambda response: len(response.descriptors) == len(parameters)),
        Call('list_parameters', {},
             lambda response: set(parameters) <= set(response.result.names)),
        Call('reset_fault', {}, lambda response: bool(response.message)),
        Call('get_state', {}, lambda response: response.current_state.label == 'active'),
        Call('change_state', {}, lambda response: not response.success)]


class ServiceLoad:
    """Calls all services repeatedly and concurrently, and publishes references meanwhile."""

    def __init__(self, client: RosClient, node: str) -> None:
        """`node` is the full name of the node."""
        self.answered = 0
        self.wrong: list[str] = []
        """Descriptions of wrong and missing answers."""
        self._references = client.publisher(JointTrajectory, f'{node}/joint_trajectory')
        self._calls = calls()
        self._clients = {}
        for call in self._calls:
            if call.name not in self._clients:
                service = client.node.create_client(TYPES[call.name], f'{node}/{call.name}')
                assert service.wait_for_service(TIMEOUT), call.name
                self._clients[call.name] = service
        self._node = client.node
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """Stop after all requests have been answered."""
        self._ends.set()
        self._thread.join(TIMEOUT)
        for service in self._clients.values():
            self._node.destroy_client(service)
        self._node.destroy_publisher(self._references)

    def _run(self) -> None:
        references = [trajectory([0.0]), trajectory(np.linspace(0.1, 3.0, POINTS)),
                      trajectory([0.2, 0.1]), JointTrajectory(joint_names=['elbow'])]
        i = 0
        while not self._ends.is_set() and not self.wrong:
            self._references.publish(references[i % len(references)])
            self._round()
            i += 1

    def _round(self) -> None:
        left = threading.Semaphore(0)
        asked = []
        for call in self._calls:
            future = self._clients[call.name].call_async(call.request)
            future.add_done_callback(lambda _: left.release())
            asked.append((call, future))
        for _ in asked:
            if not left.acquire(timeout=TIMEOUT):
                break
        for call, future in asked:
            if future.done() and call.is_right(future.result()):
                self.answered += 1
            else:
                self.wrong.append(f'{str(call.request)[:500]} was answered {future.result()}')


FEWEST_SILENCES = 4
LOOK = 0.5
"""[s] between two looks at the memory."""
MOST_GROWTH = 5e6
"""[bytes] after the warm-up."""


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
    while not load.wrong and (time.monotonic() - begin < duration or silences < FEWEST_SILENCES):
        pause.wait(LOOK)
        memory.append(resident(bench.node.pid))
        if time.monotonic() - begin > (silences + 1) * apart:
            bench.driver.be_quiet()
            bench.wait_fault('state_timeout')
            bench.driver.go_on()
            silences += 1
    return memory, silences


@pytest.mark.soak
@pytest.mark.parametrize(('duration', 'apart'), [
    pytest.param(24.0, 4.0, id='short'), pytest.param(600.0, 10.0, id='ten minutes')])
def test_soak(client, duration, apart):
    parameters = {'state_timeout': 0.05, 'hold_time': 0.2, 'ramp_time': 0.1}
    with fault_bench(
            client, '/soak', parameters, driver_type=partial(DriverProcess, rate=500.0)) as bench:
        bench.stop_listening()
        load = ServiceLoad(client, '/soak/dynamics')
        load.start()
        try:
            memory, silences = work(bench, load, duration, apart)
        finally:
            load.close()
        answered, wrong, log = load.answered, load.wrong, bench.node.log
    warm = memory[len(memory) // 3:]
    growth = max(warm) - warm[0]
    print(f'\n{duration:g} s: {answered} requests answered, {silences} silences; memory '
          f'{1e-6 * warm[0]:.1f} MB and {1e-6 * growth:.1f} MB more')
    assert not wrong
    assert growth < MOST_GROWTH
    assert 'Traceback' not in log
