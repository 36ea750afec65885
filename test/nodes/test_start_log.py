# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a user reads when another model is loaded, and when joint states are dropped."""


from fault_bench import fault_bench, NAMES, Q
from fault_stimuli import altered, follow, shifted
from robot_dynamics.planar.urdf import default_arm_urdf

NS = '/start_log'


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
