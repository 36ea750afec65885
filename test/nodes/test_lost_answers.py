# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Every request of a client that can receive the response is answered."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from request_bench import ClientProcess
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import DYNAMICS, NodeProcess, RosClient, TIMEOUT, wait_until
from std_msgs.msg import String
from std_srvs.srv import Trigger

SERVICE = '/answers/dynamics/inverse_dynamics'
UNMATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Requests of such a client arrive; no server offers responses of this durability."""
PAIRS = 6
"""Servers, each with one client, that start and end at the same time."""


def test_a_client_that_cannot_receive_a_response_is_logged(client):
    with NodeProcess(DYNAMICS, namespace='/answers') as node:
        request = InverseDynamics.Request(position=[0.0, 0.0])
        client.call(InverseDynamics, SERVICE, request)
        unmatched = client.node.create_client(InverseDynamics, SERVICE, qos_profile=UNMATCHED)
        wait_until(
            lambda: client.node.count_clients(SERVICE) == 2, 'the second client in the graph')
        future = unmatched.call_async(request)
        node.wait_for_log(f'Discarded a response of {SERVICE}')
        assert client.call(InverseDynamics, SERVICE, request).success
        assert not future.done()
        client.node.destroy_client(unmatched)


def test_a_response_waits_until_its_reader_is_discovered(client):
    # The announcements to a stopped node overflow its socket and are repeated later. Writers and
    # readers are announced separately: the node discovers the request writer before the reader.
    with NodeProcess(DYNAMICS, namespace='/answers') as node:
        request = InverseDynamics.Request(position=[0.0, 0.0])
        client.call(InverseDynamics, SERVICE, request)
        os.kill(node.pid, signal.SIGSTOP)
        collectors = [client.collect(String, f'topic_{i}') for i in range(1000)]
        client.forget('/answers')
        service = client.node.create_client(InverseDynamics, SERVICE)
        wait_until(service.service_is_ready, f'the service {SERVICE}')
        answered = threading.Event()
        service.call_async(request).add_done_callback(lambda _: answered.set())
        os.kill(node.pid, signal.SIGCONT)
        assert answered.wait(TIMEOUT), node.log
        client.node.destroy_client(service)
        for collector in collectors:
            collector.close()


@pytest.mark.soak
def test_the_client_of_the_tests_survives_the_end_of_subscriptions(client):
    with NodeProcess(DYNAMICS, namespace='/answers'):
        client.forget('/answers')
        for _ in range(3):
            for collector in [client.collect(String, f'topic_{i}') for i in range(1000)]:
                collector.close()
        assert client.call(
            InverseDynamics, SERVICE, InverseDynamics.Request(position=[0.0, 0.0])).success


@contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Run processes that compute without a pause."""
    processes = [
        subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def answers_of(pair: int, deadline: float) -> tuple[int, int]:
    """Return how many servers a client has called as early as possible, and how many answered."""
    asked = answered = 0
    server = ClientProcess('short_lived_server')
    with RosClient(f'client_{pair}') as client:
        while time.monotonic() < deadline:
            namespace = f'/pair_{pair}_{asked}'
            try:
                server.ask(namespace)
            except (AssertionError, BrokenPipeError):
                # Fast DDS may block if nodes end at the same time (eProsima/Fast-DDS issue 6513);
                # the process of the previous node has ended at this point.
                server.kill()
                server = ClientProcess('short_lived_server')
                continue
            service = client.node.create_client(Trigger, f'{namespace}/server/trigger')
            wait_until(service.service_is_ready, f'the service {service.srv_name}')
            done = threading.Event()
            service.call_async(Trigger.Request()).add_done_callback(lambda _, d=done: d.set())
            asked += 1
            answered += done.wait(TIMEOUT)
            client.node.destroy_client(service)
    server.kill()
    return asked, answered


@pytest.mark.soak
def test_no_answer_is_lost_while_nodes_start_and_end():
    deadline = time.monotonic() + 180.0
    with busy_loops(2), ThreadPoolExecutor(PAIRS) as pool:
        counts = list(pool.map(lambda pair: answers_of(pair, deadline), range(PAIRS)))
    asked, answered = (sum(column) for column in zip(*counts))
    assert asked >= 100
    assert answered == asked
