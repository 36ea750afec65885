# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Each answer of `dynamics` is of one model, while models, payloads and parameters change.

Masses and limits of the models are k times those of the first. The models with k = 1 and 2 have
other joints than those with k = 3 and 5; the joint states contain all of them. Each effort and
each answer must have one k, in the names, the gravity, the mass matrix and the limits.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
import math
import re
import struct
import sys
import threading
import time
from typing import Any, NamedTuple

import numpy as np
from own_process import own_process
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from robot_dynamics.model import ArmModel, load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.ros.middleware.conversions import payload_to_ros
from robot_dynamics_interfaces.msg import DynamicsTerms
from robot_dynamics_interfaces.srv import InverseDynamics, ManipulatorEquation, SetPayload
from ros_harness import RosClient, TIMEOUT, UNHURRIED, wait_until
from sensor_msgs.msg import JointState

Q = [math.pi / 4.0, math.pi / 6.0]
M = np.array([[6.95846097, 1.56923048], [1.56923048, 0.53]])
G = np.array([-49.52282521, -11.37087883])
"""M(q) and g(q) for k = 1."""
M_LOAD = np.array([[3.02564065, 1.33282032], [1.33282032, 0.64]])
G_LOAD = np.array([-14.51729, -7.58059])
"""Those of 1 kg at the tip."""
EFFORT_LIMIT, VELOCITY_LIMIT = 40.0, 2.0
"""For k = 1; the effort limit of joint 1 is below g(q)."""
NAMES = {1: ('a1', 'a2'), 2: ('a1', 'a2'), 3: ('b1', 'b2'), 5: ('b1', 'b2')}
LOADS = 0.0, 0.7
FRACTIONS = 1.0, 0.9


class Seen(NamedTuple):
    """What an answer contains of its model; empty tuples for what it does not contain."""

    names: tuple[str, ...]
    gravity: tuple[float, ...] = ()
    bounded: tuple[float, ...] = ()
    """Gravity within the effort limits."""
    mass_matrix: tuple[float, ...] = ()
    limits: tuple[float, ...] = ()
    """Multiples of those for k = 1."""


def model(k: int) -> ArmModel:
    return load_arm(planar_arm_urdf(
        [5.0 * k, 3.0 * k], [1.0, 0.8], [0.5, 0.4], [0.1 * k, 0.05 * k],
        effort_limits=EFFORT_LIMIT * k, velocity_limits=VELOCITY_LIMIT * k, name=f'k{k}',
        joint_names=NAMES[k]))


def is_of(seen: Seen, k: int, load: float) -> bool:
    """Return whether an answer is that of this model with this load."""
    g = k * G + load * G_LOAD
    expected = (
        (seen.gravity, [g]), (seen.mass_matrix, [(k * M + load * M_LOAD).ravel()]),
        (seen.bounded, [np.clip(g, -k * f * EFFORT_LIMIT, k * f * EFFORT_LIMIT)
                        for f in FRACTIONS]))
    return seen.names == NAMES[k] and all(limit == k for limit in seen.limits) and all(
        not found or any(np.allclose(found, one, rtol=1e-5) for one in ones)
        for found, ones in expected)


@cache
def scale_of(seen: Seen) -> int | None:
    """Return the k of an answer, None if it is that of no model."""
    return next((k for k in NAMES for load in LOADS if is_of(seen, k, load)), None)


class Observer:
    """Notes the answers that are of no model, and counts the others by k."""

    def __init__(self) -> None:
        self.wrong = list[Seen]()
        self.counts = dict.fromkeys(NAMES, 0)

    def look(self, seen: Seen) -> None:
        k = scale_of(seen)
        if k is None:
            self.wrong.append(seen)
        else:
            self.counts[k] += 1


def states(node: Any, observer: Observer, ends: threading.Event) -> None:
    """Deliver joint states as fast as possible; look at the loop before each of them."""
    data = bytearray(serialize_message(JointState(
        name=['a1', 'b1', 'a2', 'b2'], position=np.repeat(Q, 2).tolist(), velocity=[0.0] * 4)))
    with np.errstate(over='ignore', invalid='ignore'):
        while not ends.is_set():
            with node._path.command.lock:
                loop = node._path.loop
                controller, limits = loop.controller, loop.supervisor.limiter.limits
                body, planned = controller.dynamics.rigid_body, controller.load.planning.arm.limits
                observer.look(Seen(
                    loop.supervisor.joint_names, tuple(body.gravity(np.array(Q)).tolist()), (),
                    tuple(body.mass_matrix(np.array(Q)).ravel().tolist()),
                    (*limits.velocity / VELOCITY_LIMIT, *limits.effort / EFFORT_LIMIT,
                     *controller.arm.limits.effort / EFFORT_LIMIT,
                     *planned.velocity / VELOCITY_LIMIT)))
            data[4:12] = struct.pack('<iI', *divmod(time.time_ns(), 1_000_000_000))
            node._loop._deliver(bytes(data))


def limits_in(warnings: list[str]) -> tuple[float, ...]:
    """Return the limits in warnings of velocities and efforts, as multiples."""
    first = {'velocity': VELOCITY_LIMIT, 'effort': EFFORT_LIMIT}
    return tuple(
        float(limit) / first[field] for field, limit in
        re.findall(r'^(\w+) of .* outside its limits \[.*, (.*)\]$', '\n'.join(warnings), re.M))


def questions(client: RosClient, node: str) -> tuple[Callable[[], Seen], ...]:
    """Return two calls of services, for two threads."""
    def equation() -> Seen:
        found = client.call(
            ManipulatorEquation, f'{node}/manipulator_equation',
            ManipulatorEquation.Request(position=Q, velocity=[100.0, 100.0]))
        return Seen(
            tuple(found.joint_names), tuple(found.gravity), (), tuple(found.mass_matrix),
            limits_in(found.warnings))

    def inverse_dynamics() -> Seen:
        found = client.call(
            InverseDynamics, f'{node}/inverse_dynamics', InverseDynamics.Request(position=Q))
        return Seen(
            tuple(found.joint_names), tuple(found.effort), limits=limits_in(found.warnings))

    return equation, inverse_dynamics


@contextmanager
def threads(*targets: Callable[[threading.Event], None]) -> Iterator[None]:
    """Run functions in threads until the end of the statement."""
    ends = threading.Event()
    running = [threading.Thread(target=target, args=(ends,), daemon=True) for target in targets]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-4)  # as in the process of the node
    try:
        for thread in running:
            thread.start()
        yield
    finally:
        ends.set()
        for thread in running:
            thread.join(TIMEOUT)
        sys.setswitchinterval(interval)
    assert not any(thread.is_alive() for thread in running)


def change(client: RosClient, node: Any, number: int, models: dict[int, ArmModel]) -> None:
    """Replace the model; after some of the changes also change the load, or a parameter."""
    name = node.get_fully_qualified_name()
    k = (1, 2, 1, 3, 5, 3, 2, 5)[number % 8]
    task = node.executor.create_task(lambda: node._use_model(models[k], False))
    wait_until(task.done, 'a change of the model')
    task.result()
    if number % 3 == 0:
        answer = client.call(SetPayload, f'{name}/set_payload', SetPayload.Request(
            payload=payload_to_ros(make_payload('tool0', LOADS[1]) if number % 2 else None)))
        assert answer.success, answer.message
    elif number % 3 == 1:
        client.set_parameters(name, {'effort_limit_fraction': FRACTIONS[number % 2]})


@pytest.mark.parametrize('count', [60, pytest.param(1000, marks=pytest.mark.soak)])
def test_each_answer_is_of_one_model(client, count):
    models = {k: model(k) for k in NAMES}
    observers = {name: Observer() for name in (
        'loop', 'equation', 'inverse dynamics', 'effort_command', 'gravity', 'terms', 'drives')}
    with own_process() as process:
        node = process.dynamics(
            robot_description=planar_arm_urdf(
                [5.0, 3.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], effort_limits=100.0),
            command='gravity_compensation', ignore_checks=['payload'],
            effort_rate_limit=1e9, **UNHURRIED)
        node._use_model(models[1], False)
        name = node.get_fully_qualified_name()

        def asking(of: str, ask: Callable[[], Seen]) -> Callable[[threading.Event], None]:
            def run(ends: threading.Event) -> None:
                while not ends.is_set():
                    observers[of].look(ask())

            return run

        equation, inverse_dynamics = questions(client, name)
        with client.collect(JointState, f'{process.namespace}/effort_command') as commands, \
                client.collect(JointState, f'{name}/gravity_compensation') as gravities, \
                client.collect(DynamicsTerms, f'{name}/terms') as terms, \
                client.collect(JointState, f'{name}/feed_forward') as drives, \
                process.spun(SingleThreadedExecutor), \
                threads(lambda ends: states(node, observers['loop'], ends),
                        asking('equation', equation),
                        asking('inverse dynamics', inverse_dynamics)):
            for number in range(count):
                change(client, node, number, models)
            dropped = dict(node._path.states.dropped)
            for of, found in (
                    ('effort_command', commands), ('gravity', gravities), ('drives', drives)):
                for message in found.messages:
                    observers[of].look(Seen(tuple(message.name), **{
                        'gravity' if of == 'gravity' else 'bounded': tuple(message.effort)}))
            for message in terms.messages:
                observers['terms'].look(Seen(tuple(message.joint_names), tuple(message.gravity)))
    assert {of: one.wrong[:3] for of, one in observers.items() if one.wrong} == {}
    dropped.pop('stamp jumped ahead', None)  # a thread waited for 1 s after the time of its stamp
    assert dropped == {}
    for of, one in observers.items():
        assert min(one.counts.values()) > 0, (of, one.counts)
