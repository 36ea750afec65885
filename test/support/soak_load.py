# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A load for a `dynamics` node: valid and invalid requests to all its services, continuously."""

from collections.abc import Callable, Sequence
import threading
from typing import Any, NamedTuple

from fault_bench import NAMES, Q
from lifecycle_msgs.srv import ChangeState, GetState
import numpy as np
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
    for time in times:
        point = JointTrajectoryPoint(
            positions=[q + 0.01 * np.sin(time) for q in Q], velocities=[0.01 * np.cos(time)] * 2)
        point.time_from_start.sec = int(time)
        point.time_from_start.nanosec = int(time % 1.0 * 1e9)
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
        Call('set_parameters', setting('gains.kp', [1.0] * 7), set_is(False)),
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
