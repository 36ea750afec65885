# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`command: joint_impedance` on running nodes: it holds, moves and gives way."""

from closed_loop import closed_loop, NAMES, send, START
from disturbances import set_payload
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm, make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import DYNAMICS, log_of_failed_start, LONG, NodeProcess
from sensor_msgs.msg import JointState

STIFFNESS = [100.0, 40.0]
"""[N·m/rad], so soft that no mode of the default arm is too fast."""
LAW = {'command': 'joint_impedance', 'impedance.stiffness': STIFFNESS,
       'condition_references': True, 'scale_gains': True, 'joints': NAMES}


def test_it_moves_exactly_and_an_unknown_load_sags_by_its_torque_over_the_stiffness(client):
    arm = load_arm(default_arm_urdf())
    load = make_payload('tool0', 0.5)
    loaded = arm.with_payloads([load])
    goal = [START[0] - 0.4, START[1] + 0.3]
    with client.collect(JointState, '/impedance/joint_states') as states, \
            closed_loop('/impedance', LAW, rate=500.0):
        states.wait_count(200)
        assert states.messages[-1].position == pytest.approx(START, abs=1e-5)
        send(client, '/impedance', (1.0, goal))
        states.wait_for(lambda m: np.abs(np.subtract(m.position, goal)).max() < 1e-3, LONG)
        set_payload(client, '/impedance/simulated_arm', load)

        def rests_below(m: JointState) -> bool:
            g = [ArmDynamics(each).rigid_body.gravity(np.array(m.position))
                 for each in (loaded, arm)]
            sag = (g[0] - g[1]) / STIFFNESS
            return bool(np.allclose(np.subtract(goal, m.position), sag, rtol=0.02, atol=1e-4)
                        and np.abs(sag).min() > 0.01 and np.abs(m.velocity).max() < 1e-3)
        states.wait_for(rests_below, LONG)


def test_a_wrong_stiffness_is_refused_at_the_start_and_at_run_time(client):
    with NodeProcess(DYNAMICS, {'joints': NAMES}, namespace='/stiff') as node:
        for name, value in (('impedance.stiffness', [1.0, 2.0, 3.0]),
                            ('impedance.damping_ratio', [-1.0])):
            assert name in client.rejection('/stiff/dynamics', name, value)
        client.set_parameters('/stiff/dynamics', {'command': 'joint_impedance'})
        assert 'Traceback' not in node.log
    assert 'impedance.stiffness has 3' in log_of_failed_start(
        DYNAMICS, {'joints': NAMES, 'impedance.stiffness': [1.0, 2.0, 3.0]}, namespace='/stiff')
