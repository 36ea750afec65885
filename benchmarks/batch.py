# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`inverse_dynamics_batch` compared with a bare service that echoes its bytes, and with Pinocchio.

The middleware sends a request of megabytes in fragments. If fragments arrive faster than the
receiver takes them, some are lost and sent again 10 ms later. This loss affects some of the calls
to either service, so that medians jump by steps of 10 ms; the fastest calls had no such loss.
"""

from collections.abc import Callable
import statistics
import threading
import time
from typing import Any

from benchmarks.processes import (
    arm_file,
    bench_node,
    chain_urdf,
    DYNAMICS,
    module,
    node_command,
    running,
)
import numpy as np
import pinocchio as pin
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from robot_dynamics.model.arm import load_arm
from robot_dynamics_interfaces.srv import InverseDynamicsBatch, InverseDynamicsTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

JOINTS = 7
ROUNDS = 25
TIMEOUT = 60.0


class Echo(Node):
    """Services that return as many bytes as `dynamics` does, and compute nothing."""

    def __init__(self) -> None:
        super().__init__('echo')
        self.create_service(InverseDynamicsBatch, '~/batch', self._batch)
        self.create_service(InverseDynamicsTrajectory, '~/trajectory', self._trajectory)

    def _batch(self, request: Any, response: Any) -> Any:
        response.joint_names, response.effort = request.joint_names, request.position
        return response

    def _trajectory(self, request: Any, response: Any) -> Any:
        response.trajectory = request.trajectory
        return response


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


class Client:
    """Calls a service and waits for the response."""

    def __init__(self, node: Node, kind: Any, name: str) -> None:
        self._client = node.create_client(kind, name)
        if not self._client.wait_for_service(TIMEOUT):
            raise TimeoutError(f'no service {name} in {TIMEOUT:g} s')

    def __call__(self, request: Any) -> Any:
        done = threading.Event()
        future = self._client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        if not done.wait(TIMEOUT):
            raise TimeoutError(f'no answer in {TIMEOUT:g} s')
        return future.result()


def main() -> None:
    """Print the times and ratios."""
    names = [f'joint{i + 1}' for i in range(JOINTS)]
    with arm_file(JOINTS) as urdf, running({
            'echo': module('benchmarks.batch'),
            'dynamics': node_command(DYNAMICS, {'robot_description_file': urdf})}), \
            bench_node() as node:
        ours = Client(node, InverseDynamicsBatch, 'dynamics/inverse_dynamics_batch')
        echo = Client(node, InverseDynamicsBatch, 'echo/batch')
        for samples in (10_000, 100_000):
            _batch(ours, echo, names, samples)
        _trajectory(
            Client(node, InverseDynamicsTrajectory, 'dynamics/inverse_dynamics_trajectory'),
            Client(node, InverseDynamicsTrajectory, 'echo/trajectory'), names)


def _batch(ours: Client, echo: Client, names: list[str], samples: int) -> None:
    states = np.random.default_rng(0).uniform(-1.0, 1.0, (3, samples, JOINTS))
    model = load_arm(chain_urdf(JOINTS)).pinocchio_model
    pool, columns = pin.ModelPool(model, 1), [np.asfortranarray(rows.T) for rows in states]
    request = InverseDynamicsBatch.Request(joint_names=names)
    request.position, request.velocity, request.acceleration = (
        memoryview(rows).cast('B').cast('d') for rows in states)
    answer = ours(request)
    assert answer.success, answer.message
    rounds = [
        (seconds(lambda: ours(request)), seconds(lambda: echo(request)),
         seconds(lambda: pin.rneaInParallel(1, pool, *columns)))
        for _ in range(ROUNDS)]
    print(f'{samples:7} x {JOINTS} samples:')
    for words, pick in (('median', statistics.median), ('fastest', min)):
        mine, theirs, engine = (float(pick(column)) for column in zip(*rounds))
        print(f'  {words:8}{1e3 * mine:7.1f} ms; bare echo {1e3 * theirs:5.1f} ms + engine '
              f'{1e3 * engine:5.1f} ms; ratio {mine / (theirs + engine):.2f}')


def _trajectory(ours: Client, echo: Client, names: list[str]) -> None:
    request = InverseDynamicsTrajectory.Request()
    request.trajectory.joint_names = names
    for i in range(1000):
        point = JointTrajectoryPoint(
            positions=[0.001 * i] * JOINTS, velocities=[0.1 * (i < 999)] * JOINTS,
            accelerations=[0.0] * JOINTS)
        point.time_from_start.sec, ms = divmod(10 * i, 1000)
        point.time_from_start.nanosec = 1_000_000 * ms
        request.trajectory.points.append(point)
    answer = ours(request)
    assert answer.success, answer.message
    rounds = [(seconds(lambda: ours(request)), seconds(lambda: echo(request)))
              for _ in range(ROUNDS)]
    mine, theirs = map(statistics.median, zip(*rounds))
    print(f'plan of 1000 points: {1e3 * mine:.1f} ms; bare echo {1e3 * theirs:.1f} ms; '
          f'{1e3 * (mine - theirs):.1f} ms more')


def run_echo() -> None:
    """Run the bare echo node in this process."""
    rclpy.init()
    try:
        rclpy.spin(Echo())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    run_echo()
