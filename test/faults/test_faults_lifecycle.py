# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Lifecycle faults: the node publishes commands only while it is active."""

from collections.abc import Iterator
import time

from bad_descriptions import ARM, BAD_DESCRIPTIONS, MASSLESS
from fault_bench import G, NAMES, nanoseconds_of, Q
from fault_stimuli import follow, from_now, overflow, wait_effort
from fault_table import fault, fault_cases
from lifecycle_bench import (
    ACTIVATE,
    CLEANUP,
    CONFIGURE,
    DEACTIVATE,
    lifecycle_bench,
    LifecycleBench,
    SHUTDOWN,
)
from lifecycle_msgs.srv import GetAvailableTransitions
import pytest
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import RosClient
from std_srvs.srv import Trigger

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Lifecycle'
RAMP_TIME = 0.3
PARAMETERS = {'ramp_time': RAMP_TIME, 'effort_rate_limit': 1e6, 'scale_gains': False}
"""Without `scale_gains` even an implausible measured velocity is used, as `latch` needs."""
NOT_CHANGED = '`success` false immediately; no change, commands continue'


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[LifecycleBench]:
    """Return an active, commanding node; tests restore its state."""
    with lifecycle_bench(client, '/faults_lifecycle', PARAMETERS) as one:
        yield one


def check_no_model(bench: LifecycleBench) -> None:
    """Check that the node has no model, reports that, and answers no state."""
    before = bench.figure('joint states', 'dropped: no model yet')
    assert bench.state() == 'unconfigured'
    response = bench.ask('inverse_dynamics', InverseDynamics, position=Q)
    assert not response.success
    assert response.message.startswith('no model yet: expected')
    bench.wait_ended()
    moment = from_now(bench)
    bench.set_point(Q)
    bench.wait_dropped('no model yet', before + 50)
    bench.wait_status('reference', lambda status: any(
        'no model yet' in value.value for value in status.values))
    assert bench.efforts.messages == []
    assert not [m for m in bench.gravity.messages if nanoseconds_of(m.header.stamp) >= moment]


@fault(GROUP, '`autostart: false`: states and a set-point before configuration',
       'no command; services and `~/joint_trajectory` report that there is no model')
def test_unconfigured_until_asked(client):
    with lifecycle_bench(
            client, '/faults_unconfigured', {**PARAMETERS, 'autostart': False}) as one:
        check_no_model(one)
        assert one.change(CONFIGURE)
        one.check_answers()
        one.check_silent()
        assert one.change(ACTIVATE)
        first = one.efforts.wait_for()
        assert first.effort == pytest.approx(G, abs=1e-6)
        one.check_alive()


@fault(GROUP, 'a set-point while the node is inactive, then activation while states stream',
       'the set-point is rejected with the reason; the first command is exactly g(q), in answer '
       'to the next state')
def test_the_first_command_holds_the_arm(bench):
    assert bench.change(DEACTIVATE)
    bench.check_silent()
    bench.set_point([Q[0] + 0.5, Q[1]])  # the arm must not move there
    bench.node.wait_for_log('no reference can be followed now: the node is not active')
    gravity = bench.gravity.wait_for()
    assert bench.change(ACTIVATE)
    first = bench.efforts.wait_for()
    assert first.effort == pytest.approx(gravity.effort, abs=1e-9)
    assert first.effort == pytest.approx(G, abs=1e-6)
    bench.check_hold(100)


@fault(GROUP, 'deactivation while the node commands',
       'the command ramps to exactly 0 over `ramp_time`, then no command; services still answer')
def test_deactivation_ramps_to_zero(bench, seen):
    begun = time.time()
    assert bench.change(DEACTIVATE)
    bench.efforts.wait_for(lambda message: not any(message.effort))
    ramp = [(t, m) for t, m in bench.efforts.published() if m.effort[0] != pytest.approx(G[0])]
    assert list(ramp[-1][1].effort) == [0.0, 0.0]
    sizes = [abs(message.effort[0]) for _, message in ramp]
    assert sizes == sorted(sizes, reverse=True)
    assert ramp[-1][0] - begun > 0.5 * RAMP_TIME
    bench.check_silent()
    bench.check_answers()
    assert bench.change(ACTIVATE)
    bench.check_alive()
    seen(f'{len(ramp)} commands in a ramp of {ramp[-1][0] - ramp[0][0]:.2f} s')


@fault_cases('request_of', GROUP, '{}', NOT_CHANGED, (
    ('activation of an active node', {'transition': ACTIVATE}),
    ('configuration of an active node', {'transition': CONFIGURE}),
    ('cleanup of an active node', {'transition': CLEANUP}),
    ('an unknown transition number', {'transition': 200}),
    ('an unknown transition name', {'label': 'fly'}),
    ('an internal transition', {'transition': 10})))
def test_wrong_transitions(bench, request_of):
    assert not bench.change(**request_of)
    assert bench.state() == 'active'


def test_the_transitions_are_those_of_every_lifecycle_node(bench):
    def available() -> set[str]:
        return {one.transition.label for one in bench.ask(
            'get_available_transitions', GetAvailableTransitions).available_transitions}

    assert available() == {'deactivate', 'shutdown'}
    assert bench.change(label='deactivate')
    assert available() == {'activate', 'cleanup', 'shutdown'}
    assert bench.change(label='activate')


@fault(GROUP, 'a `robot_description` message while the node is unconfigured',
       'not loaded until the next configuration')
def test_no_model_while_unconfigured(client, bench):
    assert bench.change(DEACTIVATE)
    assert bench.change(CLEANUP)
    heavy = planar_arm_urdf([9.0, 9.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], name='heavy')
    with client.describing('/faults_lifecycle') as publish:
        publish(heavy)
        check_no_model(bench)
        assert 'heavy' not in bench.node.log
        assert bench.change(CONFIGURE)
        bench.node.wait_for_log("Model 'heavy'")
    assert bench.change(CLEANUP)
    assert bench.change(CONFIGURE)  # without a description: the embedded arm
    bench.check_answers()
    assert bench.change(ACTIVATE)


@fault(GROUP, 'a latched fault, then deactivation, activation, cleanup and configuration',
       'the fault persists, and no command is published after activation, until `~/reset_fault`')
def test_a_latched_fault_survives_transitions(bench):
    latch(bench)
    for transitions in ([DEACTIVATE, ACTIVATE], [DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE]):
        for transition in transitions:
            assert bench.change(transition)
        assert 'waits for ~/reset_fault' in bench.wait_fault('non_finite').message
        bench.check_silent()
    response = bench.ask('reset_fault', Trigger)
    assert response.success
    assert response.message.startswith('reset non_finite')


@fault_cases(
    'transitions', GROUP, '`~/reset_fault` after a latched fault while the node is {}',
    '`success` true; commands resume at the next activation, not earlier', (
        ('inactive', [DEACTIVATE]), ('unconfigured', [DEACTIVATE, CLEANUP])))
def test_a_reset_while_not_active(bench, transitions):
    latch(bench)
    for transition in transitions:
        assert bench.change(transition)
    response = bench.ask('reset_fault', Trigger)
    assert response.success
    assert response.message.startswith('reset non_finite')
    assert not bench.ask('reset_fault', Trigger).success  # the fault is already reset
    if CLEANUP in transitions:
        assert bench.change(CONFIGURE)
    bench.check_silent()
    assert bench.change(ACTIVATE)


def latch(bench: LifecycleBench) -> None:
    """Cause a latched fault: a state for which the computed torque is not finite."""
    bench.check_alive()
    follow(bench, Q)
    overflow(bench)
    bench.driver.go_on()
    bench.efforts.clear()  # the answer to valid states is g(q)
    wait_effort(bench, G)


# --- configuration that fails --------------------------------------------------------------------

@fault(GROUP, 'configuration with an invalid file, which is then corrected',
       '`success` false, the reason in the log, unconfigured; configured after the correction')
def test_an_invalid_file_that_is_corrected(client, tmp_path):
    file = tmp_path / 'arm.urdf'
    bad = BAD_DESCRIPTIONS['a negative mass']
    file.write_text(bad.xml, encoding='utf-8')
    with lifecycle_bench(client, '/faults_corrected', {
            **PARAMETERS, 'autostart': False, 'robot_description_file': str(file)}) as one:
        for _ in range(2):
            assert not one.change(CONFIGURE)
            assert one.state() == 'unconfigured'
        one.node.wait_for_log(f'Not configured: .*{bad.words}')
        file.write_text(MASSLESS, encoding='utf-8')
        assert not one.change(CONFIGURE)
        one.node.wait_for_log('Not configured: .*model check mass')
        check_no_model(one)
        file.write_text(ARM, encoding='utf-8')
        assert one.change(CONFIGURE)
        one.check_answers()
        assert one.change(ACTIVATE)
        one.check_alive()


@fault(GROUP, 'configuration with a wrong number of gains, which is then corrected',
       '`success` false, the reason in the log, unconfigured; configured after the correction')
def test_wrong_gains_that_are_corrected(client):
    node = '/faults_gains/dynamics'
    with lifecycle_bench(client, '/faults_gains', {
            **PARAMETERS, 'autostart': False, 'joints': NAMES, 'gains.kp': [1.0] * 3}) as one:
        assert not one.change(CONFIGURE)
        one.node.wait_for_log(r'Not configured: gains\.kp has 3 values, expected 2')
        assert one.state() == 'unconfigured'
        client.set_parameters(node, {'gains.kp': [100.0, 100.0]})
        assert one.change(CONFIGURE)
        assert one.change(ACTIVATE)
        one.check_alive()


@fault(GROUP, 'shutdown while the node commands',
       'the command ramps to exactly 0 over `ramp_time`, then no command; no transition leaves '
       'this state')
def test_shutdown_ramps_to_zero(client):
    with lifecycle_bench(client, '/faults_shutdown', PARAMETERS) as one:
        one.check_alive()
        begun = time.time()
        assert one.change(SHUTDOWN)
        one.efforts.wait_for(lambda message: not any(message.effort))
        ended, last = one.efforts.published()[-1]
        assert list(last.effort) == [0.0, 0.0]
        assert ended - begun > 0.5 * RAMP_TIME
        one.check_silent()
        for transition in (CONFIGURE, ACTIVATE, CLEANUP):
            assert not one.change(transition)
        assert one.state() == 'finalized'
