# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Payloads that are set, removed or rejected while the node commands."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, figure_of, G, Q
from fault_stimuli import check_rate, wait_effort, wait_states
from fault_table import fault, fault_cases
from geometry_msgs.msg import Inertia, InertiaStamped, Vector3
from lifecycle_bench import (
    ACTIVATE,
    CLEANUP,
    CONFIGURE,
    DEACTIVATE,
    lifecycle_bench,
    LifecycleBench,
)
import numpy as np
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics_interfaces.srv import SetPayload
from ros_harness import LATCHED, RosClient, wait_until
from std_msgs.msg import Header

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Payloads'
MASS = 5.0
"""[kg]"""
SHOULDER = 1.0 * np.sin(Q[0]), 0.8 * np.sin(Q[0] + Q[1])
"""Horizontal distance of the elbow from the shoulder, and of the tip from the elbow [m]."""
LOADED = np.array(G) - 9.81 * MASS * np.array([sum(SHOULDER), SHOULDER[1]])
"""g(q) with this mass at the tip [N·m]; q = 0 is upright."""


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[LifecycleBench]:
    """Return an active node with a description; tests restore its state."""
    with lifecycle_bench(client, '/faults_payload', {
            'ramp_time': 0.1, 'robot_description': default_arm_urdf()}) as one:
        yield one


def set_payload(
    bench: FaultBench, mass: float, seconds: float = 0.0, link: str = 'tool0',
    com: Vector3 | None = None, **inertia: float,
) -> Any:
    """Call `~/set_payload`; return the response."""
    return bench.ask('set_payload', SetPayload, transition_time=seconds, payload=InertiaStamped(
        header=Header(frame_id=link), inertia=Inertia(m=mass, com=com or Vector3(), **inertia)))


@fault(GROUP, '5 kg at the tip without a transition time, then removed',
       'the command changes to the new g(q) within the rate limit')
def test_a_payload_at_once(bench, seen):
    assert set_payload(bench, MASS).success
    wait_effort(bench, LOADED)
    assert set_payload(bench, 0.0).success
    wait_until(lambda: np.allclose(bench.efforts.messages[-1].effort, G, atol=1e-6), 'g(q) alone')
    check_rate(bench.efforts)
    seen(f'from {G[0]:.0f} to {LOADED[0]:.0f} N·m')


@fault(GROUP, '5 kg at the tip with a transition time of 0.5 s',
       'the command changes to the new g(q) over that time')
def test_a_payload_that_fades_in(bench):
    assert set_payload(bench, MASS, 0.5).success
    wait_effort(bench, LOADED)
    check_rate(bench.efforts, abs(LOADED[0] - G[0]) / 0.5)
    assert set_payload(bench, 0.0).success


@fault_cases(
    ('request_', 'reported'), GROUP, '{}',
    'rejected with a message that names the field; the command does not change', (
        ('a negative mass', {'mass': -1.0}, 'payload.inertia.m is -1'),
        ('a centre of mass that is NaN', {'mass': 1.0, 'com': Vector3(y=float('nan'))},
         'payload.inertia.com[1] (y) is nan'),
        ('100 kg at the tip', {'mass': 100.0},
         "payload.inertia.m is 100 kg on 'tool0', expected at most 72.2 kg"),
        ('1 kg at a distance of 1 km', {'mass': 1.0, 'com': Vector3(z=1000.0)},
         "payload.inertia.com is 1000 m from the origin of 'tool0', expected at most 3.6 m")))
def test_an_invalid_payload(bench, request_, reported):
    answer = set_payload(bench, **request_)
    assert not answer.success
    assert reported in answer.message
    assert all(m.effort == pytest.approx(G, abs=1e-6) for m in bench.efforts.messages)


def permitted(bench: FaultBench) -> AbstractContextManager[None]:
    """Let the node accept any physical payload."""
    return bench.temporarily({'ignore_checks': ['density']}, ignore_checks=['payload'])


def wait_payloads(bench: FaultBench, words: str) -> DiagnosticStatus:
    """Wait until the diagnostics list these payloads; return the status."""
    return bench.wait_status('payload', lambda status: status.message == words)


@fault(GROUP, '100 kg at the tip with `ignore_checks: [payload]`',
       'accepted; the command changes to the effort limits within the rate limit')
def test_an_implausible_payload_that_is_permitted(bench):
    with permitted(bench):
        answer = set_payload(bench, 100.0)
        assert answer.success
        assert [line.split(', expected')[0] for line in answer.warnings] == [
            "payload.inertia.m is 100 kg on 'tool0'"]
        wait_effort(bench, [-150.0, -60.0])
        check_rate(bench.efforts)
        assert set_payload(bench, 0.0).success


@fault(GROUP, '5 kg at the tip, then 2 kg on another link; the first is removed, then all',
       'both are compensated and listed by link; after removing one the other stays active')
def test_payloads_on_two_links(bench):
    elbow = np.array([-2.0 * 9.81 * SHOULDER[0], 0.0])  # g(q) of 2 kg at the elbow
    assert set_payload(bench, MASS).message.startswith("5 kg on 'tool0';")
    answer = set_payload(bench, 2.0, link='link2')
    assert answer.message.startswith("5 kg on 'tool0', 2 kg on 'link2';")
    assert set_payload(bench, 2.0, link='link2').message.startswith(
        "5 kg on 'tool0', 2 kg on 'link2' (replaces 2 kg on 'link2');")
    wait_effort(bench, LOADED + elbow)
    status = wait_payloads(bench, "5 kg on 'tool0', 2 kg on 'link2'")
    assert figure_of(status, 'payloads') == 2
    with bench.client.collect(InertiaStamped, bench.name('payload'), LATCHED) as topic:
        topic.wait_for(lambda m: m.header.frame_id == 'link2')
        assert set_payload(bench, 0.0).message.startswith("2 kg on 'link2';")
        wait_effort(bench, G + elbow)
        wait_payloads(bench, "2 kg on 'link2'")
        assert set_payload(bench, 0.0, link='').message.startswith('no payload;')
        topic.wait_for(lambda m: m.inertia.m == 0.0)
    bench.efforts.clear()
    wait_effort(bench, G)


def restart(bench: LifecycleBench) -> bool:
    """Deactivate, clean up and configure; return whether the last one succeeded."""
    assert bench.change(DEACTIVATE)
    assert bench.change(CLEANUP)
    return bench.change(CONFIGURE)


@pytest.fixture(scope='module')
def managed(client: RosClient) -> Iterator[LifecycleBench]:
    """Return an active node without a description; the last test publishes one on the topic."""
    with lifecycle_bench(client, '/faults_kept_payload', {'ramp_time': 0.1}) as one:
        yield one


@fault(GROUP, 'a payload of 5 kg, then `cleanup`, `configure` and activation',
       'the payload is active before the first command')
def test_a_payload_survives_cleanup(bench):
    assert set_payload(bench, MASS).success
    wait_effort(bench, LOADED)
    assert restart(bench)
    bench.wait_ended()
    assert bench.change(ACTIVATE)
    assert bench.efforts.wait_for().effort == pytest.approx(LOADED, abs=1e-5)
    wait_payloads(bench, "5 kg on 'tool0'")
    assert set_payload(bench, 0.0).success


@fault(GROUP, '`configure` with a payload that the arm cannot carry',
       'configuration fails with an error that names the payload, until it is removed')
def test_a_payload_that_does_not_suit_the_next_model(bench):
    with permitted(bench):
        assert set_payload(bench, 100.0).success
    assert not restart(bench)
    assert bench.state() == 'unconfigured'
    bench.node.wait_for_log("Not configured: .* were set .100 kg on 'tool0'")
    status = bench.wait_status('payload', lambda one: one.level == DiagnosticStatus.ERROR)
    assert 'expected at most 72.2 kg' in status.message
    assert set_payload(bench, 0.0).message == 'no payload'
    assert bench.change(CONFIGURE)
    assert bench.change(ACTIVATE)


@fault(GROUP, '`configure` with a payload that the embedded arm cannot carry',
       'no model is used and no command is published, with one error, until the payload is '
       'removed')
def test_a_payload_that_does_not_suit_the_embedded_arm(managed):
    managed.check_alive()
    with permitted(managed):
        assert set_payload(managed, 100.0).success
    assert restart(managed)
    managed.node.wait_for_log("No model in use: .* were set .100 kg on 'tool0'")
    managed.wait_ended()
    assert managed.change(ACTIVATE)
    wait_states(managed, 100)
    assert managed.efforts.messages == []
    assert set_payload(managed, 0.0).message == 'no payload'
    managed.check_alive()


@fault(GROUP, 'a `robot_description` without the link that carries a payload',
       'the active model stays, with an error; the new one is loaded when the payload is removed')
def test_a_description_without_the_link_of_a_payload(client, managed):
    managed.check_alive()
    assert set_payload(managed, 1.0, link='link2').success
    single = planar_arm_urdf([5.0], [1.0], [0.5], [0.1], name='single')
    with client.describing('/faults_kept_payload') as publish:
        publish(single)
        managed.node.wait_for_log('Kept the model in use: the payloads that were set')
        managed.wait_status('payload', lambda one: "'link2'" in one.message and (
            one.level == DiagnosticStatus.ERROR))
        assert "Model 'single'" not in managed.node.log
        assert managed.change(DEACTIVATE)
        assert set_payload(managed, 0.0, link='link2').success
        managed.node.wait_for_log("Model 'single'")
        wait_payloads(managed, 'no payload')
