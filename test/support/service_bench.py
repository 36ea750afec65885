# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A running node `dynamics`, its services, and the dynamics of the same arm."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import time
from typing import Any

import numpy as np
from robot_dynamics.model import ArmDynamics, ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import DYNAMICS, NodeProcess, RosClient, wait_until
from sensor_msgs.msg import JointState
from service_requests import SERVICES

Q, V, A = (np.pi / 4, np.pi / 6), (0.5, 0.3), (0.1, 0.2)
TAU = (-48.74713301, -10.95795578)


@dataclass
class Served:
    """A running node, and the dynamics of the same arm in this process."""

    client: RosClient
    namespace: str
    arm: ArmModel

    @property
    def dynamics(self) -> ArmDynamics:
        return ArmDynamics(self.arm)

    def ask(self, service: str, **fields: Any) -> Any:
        kind = SERVICES[service]
        return self.client.call(
            kind, f'{self.namespace}/dynamics/{service}', kind.Request(**fields))

    def answer(self, service: str, **fields: Any) -> Any:
        response = self.ask(service, **fields)
        assert response.success, response.message
        return response

    def answer_while_streaming(self, q: Sequence[float], service: str, **fields: Any) -> Any:
        """Return the answer to a request; joint states at q must be answered meanwhile."""
        answers: list[float] = []
        node = self.client.node
        publisher = node.create_publisher(JointState, f'{self.namespace}/joint_states', 10)
        subscription = node.create_subscription(
            JointState, f'{self.namespace}/dynamics/gravity_compensation',
            lambda _: answers.append(time.monotonic()), 10)

        def publish() -> None:
            message = JointState(
                name=self.arm.joint_names, position=q, velocity=[0.0] * len(q))
            message.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(message)

        timer = node.create_timer(0.005, publish)
        wait_until(lambda: len(answers) > 20, 'answers to joint states')
        begin = time.monotonic()
        response = self.answer(service, **fields)
        end = time.monotonic()
        node.destroy_timer(timer)
        node.destroy_subscription(subscription)
        node.destroy_publisher(publisher)
        assert len([one for one in answers if begin < one < end]) > 5
        return response


@contextmanager
def served(
    client: RosClient, namespace: str, urdf: str | None = None, **parameters: Any,
) -> Iterator[Served]:
    """Run a node on a robot, by default the embedded arm, and yield both."""
    if urdf:
        parameters['robot_description'] = urdf
    with NodeProcess(DYNAMICS, parameters, namespace=namespace):
        yield Served(client, namespace, load_arm(urdf or default_arm_urdf()))
