# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Both nodes as processes, which close the loop in lock-step."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from typing import Any

from builtin_interfaces.msg import Duration
from children import TIMEOUT
from ros_harness import (
    Collector,
    DYNAMICS,
    MONITOR,
    NodeProcess,
    RosClient,
    running,
    SIMULATED_ARM,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAMES = ['joint1', 'joint2']
START = [0.8, 0.5]


@contextmanager
def closed_loop(
    namespace: str, dynamics: Mapping[str, Any] | None = None,
    arguments: Sequence[str] = (), monitor: Mapping[str, Any] | None = None, **arm: Any,
) -> Iterator[NodeProcess]:
    """
    Run `dynamics` and `simulated_arm` with these parameters; yield the process of `dynamics`.

    `arguments` are those of `dynamics`. With parameters `monitor`, `dynamics_monitor` runs too.

    By default the arm starts at `START` and runs in lock-step at 125 Hz, at twice real time: a
    loop at full speed would use two cores also while the test waits for something else.
    """
    arm = {
        'rate': 125.0, 'lock_step': True, 'real_time_factor': 2.0, 'initial_position': START,
        **arm}
    node = NodeProcess(
        DYNAMICS, {'lock_step': arm['lock_step'], **(dynamics or {})}, namespace=namespace,
        arguments=arguments)
    others = [] if monitor is None else [NodeProcess(MONITOR, monitor, namespace=namespace)]
    with running(node, NodeProcess(SIMULATED_ARM, arm, namespace=namespace), *others):
        yield node


@contextmanager
def collecting(client: RosClient, namespace: str, *topics: str) -> Iterator[list[Collector]]:
    """Record the messages of several topics of the type JointState."""
    with ExitStack() as stack:
        yield [stack.enter_context(client.collect(JointState, f'{namespace}/{topic}'))
               for topic in topics]


@contextmanager
def receiving(
    client: RosClient, namespace: str, *topics: str, count: int = 1,
) -> Iterator[list[Collector]]:
    """
    Record several running topics of the type JointState, once each has `count` messages.

    A subscription of the middleware may be matched and receive nothing: then subscribe again.
    """
    with ExitStack() as stack:
        collectors = []
        for topic in topics:
            for _ in range(6):
                collector = client.collect(JointState, f'{namespace}/{topic}')
                if collector.find(lambda _: True, TIMEOUT / 6.0) is not None:
                    break
                collector.close()
            stack.callback(collector.close)
            collector.wait_count(count)
            collectors.append(collector)
        yield collectors


def publish(client: RosClient, topic: str, message: Any) -> None:
    """Publish one message; wait until it has been received."""
    publisher = client.publisher(type(message), topic)
    publisher.publish(message)
    publisher.wait_for_all_acked()


def send(client: RosClient, namespace: str, *points: tuple[float, Sequence[float]]) -> None:
    """Publish a trajectory of positions at times [s]; wait until it has been received."""
    message = JointTrajectory(joint_names=NAMES, points=[
        JointTrajectoryPoint(
            positions=list(map(float, q)),
            time_from_start=Duration(sec=int(t), nanosec=round(1e9 * (t % 1.0))))
        for t, q in points])
    publish(client, f'{namespace}/dynamics/joint_trajectory', message)
