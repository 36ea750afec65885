# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The log of an ordinary start, and of joint states that are dropped, as a new user reads it."""

import re

from fault_bench import fault_bench, NAMES, Q, STEADY
from fault_stimuli import altered, follow, shifted
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_path
from ros_harness import DYNAMICS, LONG, NodeProcess, running, SIMULATED_ARM

NS = '/start_log'


def check_lines(node: NodeProcess, *patterns: str) -> None:
    """Check that the log has few lines, and that these are among them, in this order."""
    slow = 'Gains and references at'  # on a loaded machine, where joint states come late
    lines = [line for line in node.log.splitlines() if slow not in line]
    assert len(lines) <= 6, node.log
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


def test_another_model_ends_the_reference_visibly_and_a_dropped_state_names_the_remedy(client):
    with client.describing(NS) as publish, \
            fault_bench(client, NS, {'command': 'computed_torque'}) as bench:
        follow(bench, Q)
        publish(default_arm_urdf().replace('planar_arm', 'other_arm'))
        bench.wait_message('reference', 'ended early: another model was loaded')
        bench.efforts.clear()
        bench.efforts.wait_count(5)  # the new model has a state, from which a set-point can start
        follow(bench, Q)
        for seconds, words in ((-60.0, r'60\.\d+ s old'), (60.0, 'in the future')):
            words += '.*; synchronise the clocks of driver and computer, or set `state_max_age`'
            bench.driver.change = shifted(seconds)
            bench.node.wait_for_log(r'\[WARN\].*Dropped a joint state.*' + words)
            bench.wait_message('joint states', f'.*{words}.*')
            bench.driver.go_on()
            bench.wait_running()
        bench.driver.change = altered(name=NAMES[:1], position=Q[:1], velocity=[])
        line = bench.node.wait_for_log('No joint state is complete')
        assert "no new samples of ['joint2']" in line
        assert 'set the parameter joints' in line
        bench.wait_message('joint states', r".*\['joint2'\].*")
        client.forget(NS)
