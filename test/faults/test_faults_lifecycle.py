# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Lifecycle faults: the node publishes commands only while it is active."""

from collections.abc import Iterator
from pathlib import Path
import time

from bad_descriptions import ARM, BAD_DESCRIPTIONS, MASSLESS
from fault_bench import G, NAMES, nanoseconds_of, Q
from fault_stimuli import follow, from_now, run_away, wait_effort
from fault_table import fault
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
PARAMETERS = {'ramp_time': RAMP_TIME, 'effort_rate_limit': 1e6}


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[LifecycleBench]:
    """Return an active, commanding node; tests restore its state."""
    with lifecycle_bench(client, '/faults_lifecycle', PARAMETERS) as one:
        yield one


@pytest.fixture
def latched(client: RosClient) -> Iterator[LifecycleBench]:
    """Return such a node for a test that latches a fault."""
    with lifecycle_bench(client, '/faults_latched', PARAMETERS) as one:
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


@fault(GROUP, 'deactivation while the node commands, with `end_action: ramp_to_zero`',
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


@fault(GROUP, 'activation, configuration or cleanup of an active node; an unknown number or name '
       'of a transition; an internal transition',
       '`success` false immediately; no change, commands continue')
def test_wrong_transitions(bench):
    for transition in (ACTIVATE, CONFIGURE, CLEANUP, 200, 10):
        assert not bench.change(transition)
    assert not bench.change(label='fly')
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


@fault(GROUP, 'a latched fault, then deactivation, activation, cleanup and configuration; '
       '`~/reset_fault` while the node is unconfigured',
       'the fault persists, and no command is published after activation; after the reset '
       'commands resume at the next activation, not earlier')
def test_a_latched_fault_survives_transitions(latched):
    latched.check_alive()
    follow(latched, Q)
    run_away(latched)
    latched.driver.go_on()
    latched.efforts.clear()  # the answer to valid states is g(q), but for the released joint
    wait_effort(latched, [0.0, G[1]])
    for transitions in ([DEACTIVATE, ACTIVATE], [DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE]):
        for transition in transitions:
            assert latched.change(transition)
        assert 'waits for ~/reset_fault' in latched.wait_fault('wrong_drive').message
        latched.check_silent()
    assert latched.change(DEACTIVATE)
    assert latched.change(CLEANUP)
    response = latched.ask('reset_fault', Trigger)
    assert response.success
    assert response.message.startswith('reset wrong_drive')
    assert not latched.ask('reset_fault', Trigger).success
    assert latched.change(CONFIGURE)
    latched.check_silent()
    assert latched.change(ACTIVATE)


# --- configuration that fails, and shutdown ------------------------------------------------------

@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file for a description."""
    return tmp_path_factory.mktemp('lifecycle') / 'arm.urdf'


@pytest.fixture(scope='module')
def other(client: RosClient, file: Path) -> Iterator[LifecycleBench]:
    """Return a node that is not configured, with a file and gains that a test corrects."""
    with lifecycle_bench(client, '/faults_corrected', {
            **PARAMETERS, 'autostart': False, 'robot_description_file': str(file),
            'joints': NAMES, 'gains.natural_frequency': [1.0] * 3}) as one:
        yield one


@fault(GROUP, '`autostart: false`: states and a set-point before configuration; configuration '
       'with an invalid file and a wrong number of gains, which are then corrected',
       'no command; services and `~/joint_trajectory` report that there is no model; `success` '
       'false, the reason in the log, unconfigured; configured after the correction')
def test_what_fails_and_is_corrected(client, file, other):
    bad = BAD_DESCRIPTIONS['a negative mass']
    file.write_text(bad.xml, encoding='utf-8')
    for _ in range(2):
        assert not other.change(CONFIGURE)
        assert other.state() == 'unconfigured'
    other.node.wait_for_log(f'Not configured: .*{bad.words}')
    file.write_text(MASSLESS, encoding='utf-8')
    assert not other.change(CONFIGURE)
    other.node.wait_for_log('Not configured: .*model check mass')
    check_no_model(other)
    file.write_text(ARM, encoding='utf-8')
    assert not other.change(CONFIGURE)
    other.node.wait_for_log(r'Not configured: gains\.natural_frequency has 3 values, expected 2')
    assert other.state() == 'unconfigured'
    client.set_parameters('/faults_corrected/dynamics', {'gains.natural_frequency': [10.0, 10.0]})
    assert other.change(CONFIGURE)
    other.check_answers()
    other.check_silent()
    assert other.change(ACTIVATE)
    assert other.efforts.wait_for().effort == pytest.approx(G, abs=1e-6)
    other.check_alive()


@fault(GROUP, 'shutdown while the node commands, with `end_action: ramp_to_zero`',
       'the command ramps to exactly 0 over `ramp_time`, then no command; no transition leaves '
       'this state')
def test_shutdown_ramps_to_zero(other):
    other.check_alive()
    begun = time.time()
    assert other.change(SHUTDOWN)
    other.efforts.wait_for(lambda message: not any(message.effort))
    ended, last = other.efforts.published()[-1]
    assert list(last.effort) == [0.0, 0.0]
    assert ended - begun > 0.5 * RAMP_TIME
    other.check_silent()
    for transition in (CONFIGURE, ACTIVATE, CLEANUP):
        assert not other.change(transition)
    assert other.state() == 'finalized'
