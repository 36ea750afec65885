# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A running node `dynamics`, its services, and the dynamics of the same arm."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import time
from typing import Any

from fault_bench import Driver, TimedCollector
import numpy as np
from robot_dynamics.model import ArmDynamics, ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import DYNAMICS, NodeProcess, RosClient, UNHURRIED
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
        driver = Driver(
            self.client, f'{self.namespace}/joint_states', self.arm.joint_names, q,
            [0.0] * len(q)).start()
        with TimedCollector(self.client.node, JointState,
                            f'{self.namespace}/dynamics/gravity_compensation', 10) as answers:
            answers.wait_count(20)
            begin = time.monotonic()
            response = self.answer(service, **fields)
            end = time.monotonic()
            driver.close()
        assert len([t for t in answers.times if begin < t < end]) > 5
        return response


@contextmanager
def served(
    client: RosClient, namespace: str, urdf: str | None = None, **parameters: Any,
) -> Iterator[Served]:
    """Run a node on a robot, by default the embedded arm, and yield both."""
    if urdf:
        parameters['robot_description'] = urdf
    with NodeProcess(DYNAMICS, {**UNHURRIED, **parameters}, namespace=namespace):
        yield Served(client, namespace, load_arm(urdf or default_arm_urdf()))
