# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invalid robot descriptions while the node commands, and changes of the model."""

from collections.abc import Callable, Iterator

from bad_descriptions import BAD_DESCRIPTIONS
from fault_bench import G, LONGEST_STEP, nanoseconds_of, Q
from fault_table import fault, fault_cases
from lifecycle_bench import ACTIVATE, DEACTIVATE, lifecycle_bench, LifecycleBench
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import planar_arm_urdf
from ros_harness import RosClient

GROUP = 'Robot descriptions on the topic `robot_description`'
KEPT = 'rejected with the reason; the active model stays; control continues'
PARAMETERS = {'hold_time': 0.1, 'ramp_time': 0.1, 'effort_rate_limit': 1e6}


def arm_of(mass: float) -> str:
    """Return an arm named after the mass [kg] of its second link."""
    return planar_arm_urdf([5.0, mass], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], name=f'arm_{mass:g}')


def hold_of(xml: str) -> list[float]:
    """Return g(q) [N·m] of an arm at the position that the driver publishes."""
    return [float(effort) for effort in ArmDynamics(load_arm(xml)).rigid_body.gravity(np.array(Q))]


LIGHT, HEAVY = arm_of(2.0), arm_of(4.0)
Describe = Callable[[str], None]


@pytest.fixture(scope='module')
def describe(client: RosClient) -> Iterator[Describe]:
    """Return a function that publishes a description."""
    with client.describing('/faults_models') as publish:
        yield publish


@pytest.fixture(scope='module')
def bench(client: RosClient, describe: Describe) -> Iterator[LifecycleBench]:
    """Return a node that uses the light arm, from the topic; tests restore its state."""
    describe(LIGHT)
    with lifecycle_bench(client, '/faults_models', PARAMETERS, hold_of(LIGHT)) as one:
        one.node.wait_for_log("Model 'arm_2'")
        yield one


def check_model(bench: LifecycleBench, xml: str) -> None:
    """Check that services and commands use this arm, without a fault."""
    bench.hold = hold_of(xml)
    bench.check_answers()
    bench.check_alive()


def wait_model(bench: LifecycleBench, name: str, new_one_waits: bool = False) -> None:
    """Wait until the diagnostics report this model."""
    bench.wait_status('model', lambda status: status.message == name and any(
        value.key == 'a new one waits' and value.value == str(new_one_waits)
        for value in status.values))


KINDS = ('text that is not XML', 'a loop', 'joints that move no mass',
         'XML that expands to gigabytes (nested entities)', 'a million tags')
"""Each is rejected elsewhere."""


@fault_cases('bad', GROUP, '{}', KEPT, ((kind, BAD_DESCRIPTIONS[kind]) for kind in KINDS))
def test_a_bad_description(bench, describe, bad):
    bench.check_alive()
    describe(bad.xml)
    bench.node.wait_for_log(f'Kept the model in use: .*({bad.words})')
    check_model(bench, LIGHT)
    assert bench.known('command', 'faults: state_timeout') == 0


@fault(GROUP, 'another arm while the node commands, then a timeout of the joint states',
       'the log reports that the new arm waits; commands use the old arm; the new one is loaded '
       'when commands have ended; the next command is exactly its g(q)')
def test_a_new_model_waits_until_commands_have_ended(bench, describe):
    bench.check_alive()
    describe(HEAVY)
    bench.node.wait_for_log('Kept the model in use while commanding')
    wait_model(bench, 'arm_2', new_one_waits=True)
    check_model(bench, LIGHT)
    bench.driver.be_quiet()
    with bench.short_timeout():
        wait_model(bench, 'arm_4')
    bench.wait_silent()
    assert np.allclose(bench.efforts.messages[-1].effort, 0.0)
    first = bench.first_answer(bench.driver.go_on)
    assert first.effort == pytest.approx(hold_of(HEAVY), abs=1e-6)
    check_model(bench, HEAVY)


@fault(GROUP, 'another arm while the node commands, then deactivation and activation',
       'loaded while inactive; the first command is exactly its g(q)')
def test_a_new_model_is_loaded_while_inactive(bench, describe):
    settle(bench, describe, LIGHT, 'arm_2')
    describe(HEAVY)
    wait_model(bench, 'arm_2', new_one_waits=True)
    assert bench.change(DEACTIVATE)
    wait_model(bench, 'arm_4')
    bench.check_silent()
    assert bench.change(ACTIVATE)
    assert bench.efforts.wait_for().effort == pytest.approx(hold_of(HEAVY), abs=1e-6)
    check_model(bench, HEAVY)


@fault(GROUP, 'another arm while the node commands, then the active arm again, or an invalid one',
       'no model waits, as only the newest description counts; the active model stays; control '
       'continues')
def test_the_newest_description_counts(bench, describe):
    settle(bench, describe, LIGHT, 'arm_2')
    bad = BAD_DESCRIPTIONS['a negative mass']
    for last in (LIGHT, bad.xml):
        describe(HEAVY)
        wait_model(bench, 'arm_2', new_one_waits=True)
        describe(last)
        wait_model(bench, 'arm_2')
    bench.node.wait_for_log(f'Kept the model in use: .*{bad.words}')
    bench.driver.be_quiet()
    bench.wait_state_timeout()
    bench.wait_silent()
    check_model(bench, LIGHT)


def settle(bench: LifecycleBench, describe: Describe, xml: str, name: str) -> None:
    """Make this arm the active model."""
    if bench.change(DEACTIVATE):
        describe(xml)
        wait_model(bench, name)
        assert bench.change(ACTIVATE)
    check_model(bench, xml)


@fault(GROUP, 'a description while the node commands with the embedded arm',
       'loaded immediately; the command changes to its g(q) within `effort_rate_limit`')
def test_the_embedded_arm_gives_way_at_once(client):
    rate = 100.0
    with client.describing('/faults_embedded') as publish, lifecycle_bench(
            client, '/faults_embedded', {**PARAMETERS, 'effort_rate_limit': rate}) as one:
        one.check_alive()
        one.efforts.wait_count(len(one.efforts.messages) + 1)
        publish(HEAVY)
        one.efforts.wait_for(
            lambda message: np.allclose(message.effort, hold_of(HEAVY), atol=1e-6))
        assert one.efforts.published()[0][1].effort == pytest.approx(G, abs=1e-6)
        for before, after in one.efforts.in_a_row():
            dt = 1e-9 * (nanoseconds_of(after.header.stamp) - nanoseconds_of(before.header.stamp))
            change = np.abs(np.subtract(after.effort, before.effort)).max()
            assert change <= 2.0 * rate * max(dt, LONGEST_STEP)
        assert 'Kept the model' not in one.node.log
        check_model(one, HEAVY)
