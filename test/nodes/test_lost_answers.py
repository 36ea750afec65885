# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Every request of a client that can receive the response is answered.

A client that cannot receive it delays no request.
"""

from collections.abc import Iterator
import os
import signal
import threading

import pytest
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import DYNAMICS, NodeProcess, TIMEOUT, wait_until
from silent_clients import UnheardClient
from std_msgs.msg import String
from std_srvs.srv import Trigger

SERVICE = '/answers/dynamics/inverse_dynamics'
STOP = '/answers/dynamics/stop'


@pytest.fixture(scope='module')
def node() -> Iterator[NodeProcess]:
    with NodeProcess(DYNAMICS, namespace='/answers') as process:
        yield process


def test_a_response_waits_until_its_reader_is_discovered(client, node):
    # The announcements to a stopped node overflow its socket and are repeated later. Writers and
    # readers are announced separately: the node discovers the request writer before the reader.
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


def test_a_stop_acts_although_another_response_cannot_be_delivered(client, node):
    with UnheardClient() as unheard:
        unheard.send(STOP, 3)
        wait_until(lambda: node.log.count('~/stop: ') == 3, 'the stops of the unheard client')
        service = client.node.create_client(Trigger, STOP)
        wait_until(service.service_is_ready, f'the service {STOP}')
        answer = service.call_async(Trigger.Request())
        wait_until(lambda: node.log.count('~/stop: ') == 4, 'the stop of the other client')
        assert 'Discarded a response of ' + STOP not in node.log  # the first one waits for 10 s
        node.wait_for_log('Discarded a response of ' + STOP)
        wait_until(answer.done, 'the response of a client that can receive it')
        client.node.destroy_client(service)
