# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Large requests to the services of `dynamics`, from a separate process.

Building large requests would delay the driver in the process of a test. Each case checks the
numbers in its answer.
"""

from collections.abc import Callable, Mapping
import sys
import time
from typing import Any, NamedTuple

from builtin_interfaces.msg import Duration
import numpy as np
from request_bench import answer_lines, ClientProcess
from robot_dynamics.ros.middleware.conversions import floats_to_ros
from robot_dynamics_interfaces import srv
from ros_harness import RosClient, TIMEOUT
from simulated_arms import default_dynamics
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
SAMPLES, POINTS = 100_000, 5000
DYNAMICS = default_dynamics()
STILL = [0.0, 0.0]

Check = Callable[[Any], bool]


class Large(NamedTuple):
    """A large request: service, type, message, and a check of the numbers in the answer."""

    service: str
    kind: Any
    request: Any
    is_right: Check


class Answer(NamedTuple):
    """The result of a large request."""

    success: bool
    message: str
    is_right: bool
    seconds: float


def batch() -> Large:
    q, v, a = np.random.default_rng(1).uniform(-3.0, 3.0, (3, SAMPLES, 2))
    return Large(
        'inverse_dynamics_batch', srv.InverseDynamicsBatch, srv.InverseDynamicsBatch.Request(
            position=floats_to_ros(q), velocity=floats_to_ros(v), acceleration=floats_to_ros(a)),
        lambda response: np.allclose(
            np.reshape(response.effort, (-1, 2)), DYNAMICS.inverse_dynamics_batch(q, v, a)))


def points() -> Large:
    path = JointTrajectory(joint_names=NAMES, points=[
        JointTrajectoryPoint(
            positions=[1.0, 0.5], velocities=STILL, accelerations=STILL,
            time_from_start=Duration(sec=i)) for i in range(POINTS)])
    gravity = DYNAMICS.rigid_body.gravity(np.array([1.0, 0.5]))
    return Large(
        'inverse_dynamics_trajectory', srv.InverseDynamicsTrajectory,
        srv.InverseDynamicsTrajectory.Request(trajectory=path),
        lambda response: np.allclose(
            [point.effort for point in response.trajectory.points], gravity))


class LargeRequests(ClientProcess):
    """The process that sends these requests."""

    def __init__(self, namespace: str, environment: Mapping[str, str] | None = None) -> None:
        super().__init__('large_requests', namespace, environment=environment)

    def call(self, case: str) -> Answer:
        """Send the request of a case; return its result."""
        return Answer(*self.ask((case, True)))

    def send(self, case: str) -> None:
        """Send the request of a case without waiting."""
        self.ask((case, False))


CASES = {case.__name__: case for case in (batch, points)}


def main() -> None:
    """Send the requests of the cases on the standard input, with or without waiting."""
    namespace, = sys.argv[1:]
    with RosClient('large_client') as client:

        def answer(question: tuple[str, bool]) -> list[Any]:
            case, waits = question
            large = CASES[case]()
            name = f'{namespace}/dynamics/{large.service}'
            if not waits:
                service = client.node.create_client(large.kind, name)
                assert service.wait_for_service(TIMEOUT)
                service.call_async(large.request)
                return []
            begun = time.monotonic()
            response = client.call(large.kind, name, large.request, 3 * TIMEOUT)
            seconds = time.monotonic() - begun
            return [response.success, response.message, bool(large.is_right(response)), seconds]

        answer_lines(answer)


if __name__ == '__main__':
    main()
