# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The log of an ordinary start, and of joint states that are dropped, as a new user reads it."""

import re

from fault_bench import fault_bench, NAMES, Q, STEADY
from fault_stimuli import altered, follow, shifted
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_path
from ros_harness import DYNAMICS, LONG, NodeProcess, running, SIMULATED_ARM

MOST_LINES = 6
NS = '/start_log'


def lines_of(node: NodeProcess) -> list[str]:
    """Return the lines of the log without their stamps."""
    return [re.sub(r'\[\d+\.\d+\] ', '', line) for line in node.log.splitlines()]


def check_lines(node: NodeProcess, *patterns: str) -> None:
    """Check that the log has few lines, and that these are among them, in this order."""
    lines = lines_of(node)
    slow = 'Gains and references at'  # on a loaded machine, where joint states come late
    assert len([line for line in lines if slow not in line]) <= MOST_LINES, node.log
    places = [next((i for i, line in enumerate(lines) if re.search(pattern, line)), -1)
              for pattern in patterns]
    assert -1 not in places, (places, node.log)
    assert places == sorted(places), node.log


def started(parameters: dict[str, object]) -> tuple[NodeProcess, NodeProcess]:
    return (NodeProcess(DYNAMICS, {**STEADY, **parameters}, namespace=NS),
            NodeProcess(SIMULATED_ARM, {**parameters, 'rate': 100.0}, namespace=NS))


def test_the_log_of_the_default_arm(client):
    dynamics, arm = started({})
    with running(dynamics, arm):
        dynamics.wait_for_log('Effort check', LONG)
        check_lines(
            dynamics, r"INFO.*Model 'planar_arm': joints \['joint1', 'joint2'\]",
            f'INFO.*Active with command: computed_torque. The command starts with the first valid '
            f'joint state on {NS}/joint_states.',
            f'INFO.*Joint states arrive: commanding on {NS}/effort_command and '
            f'{NS}/dynamics/commands, from the measured state.')
        check_lines(
            arm, r"INFO.*Model 'planar_arm': joints \['joint1', 'joint2'\]",
            f'INFO.*Simulating at 100 Hz on {NS}/joint_states. Until the first effort arrives on '
            f'{NS}/effort_command, the brakes hold the arm.')
        client.forget(NS)


def test_the_log_of_an_arm_that_is_only_watched(client):
    dynamics, arm = started({
        'robot_description_file': str(robot_path('ur10')), 'command': 'none',
        'actuator.reflected_inertia': [0.1]})
    with running(dynamics, arm):
        dynamics.wait_for_log('Effort check', LONG)
        check_lines(
            dynamics, 'INFO.*Model check: 0 errors, 2 warnings. Scope: ',
            r"INFO.*Model 'ur10': joints \['shoulder_pan_joint', ",
            f'INFO.*Active with command: none. Nothing is commanded; the results for the '
            f'states on {NS}/joint_states are published on dynamics/gravity_compensation and '
            'dynamics/computed_torque.')
        assert 'commanding on' not in dynamics.log
        client.forget(NS)


@pytest.mark.parametrize(('seconds', 'words'), [
    (-60.0, r'60\.\d+ s old'), (60.0, 'in the future')])
def test_a_dropped_state_names_the_remedy(client, seconds, words):
    words += '.*; synchronise the clocks of driver and computer, or set `state_max_age`'
    with fault_bench(client, NS) as bench:
        bench.driver.change = shifted(seconds)
        line = bench.node.wait_for_log('Dropped a joint state')
        assert '[WARN]' in line
        assert re.search(words, line), line
        bench.wait_message('joint states', f'.*{words}.*')
        client.forget(NS)


def test_an_incomplete_state_names_the_remedy(client):
    with fault_bench(client, NS) as bench:
        bench.driver.change = altered(name=NAMES[:1], position=Q[:1], velocity=[])
        line = bench.node.wait_for_log('No joint state is complete')
        assert "no new samples of ['joint2']" in line
        assert 'set the parameter joints' in line
        bench.wait_message('joint states', r".*\['joint2'\].*")
        client.forget(NS)


def test_a_model_that_replaces_the_embedded_arm_ends_the_reference_visibly(client):
    with client.describing(NS) as publish, \
            fault_bench(client, NS, {'command': 'computed_torque'}) as bench:
        follow(bench, Q)
        publish(default_arm_urdf().replace('planar_arm', 'other_arm'))
        bench.wait_message('reference', 'ended early: another model was loaded')
        bench.efforts.clear()
        bench.efforts.wait_count(5)  # the new model has a state, from which a set-point can start
        follow(bench, Q)
        client.forget(NS)
