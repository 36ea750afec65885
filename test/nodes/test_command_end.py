# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""How far an arm with brakes moves at the end of the command: the table of docs/safety.md."""

import os
import re
import signal

from closed_loop import NAMES, START
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from ros_harness import DYNAMICS, NO_SHARED_MEMORY, NodeProcess, SIMULATED_ARM, UNHURRIED
from sensor_msgs.msg import JointState

DEACTIVATE = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
ENDS = {
    'deactivation': lambda client, _: client.call(
        ChangeState, '/ends/dynamics/change_state', DEACTIVATE),
    'command: none': lambda client, _: client.set_parameters(
        '/ends/dynamics', {'command': 'none'}),
    **{one.name: lambda _, pid, one=one: os.kill(pid, one) for one in (
        signal.SIGTERM, signal.SIGKILL)}}


@pytest.mark.parametrize(('end', 'action'), [
    *((end, 'hold_then_silence') for end in ENDS), ('SIGTERM', 'ramp_to_zero')])
def test_brakes_hold_the_arm_unless_the_command_ramps_to_zero(client, end, action):
    node = NodeProcess(
        DYNAMICS, {**UNHURRIED, 'joints': NAMES, 'end_action': action}, namespace='/ends',
        environment=NO_SHARED_MEMORY)
    with client.collect(JointState, '/ends/joint_states') as states, NodeProcess(
            SIMULATED_ARM, {'initial_position': START}, namespace='/ends') as arm:
        node.start()
        try:
            states.wait_for(lambda state: any(state.effort))
            states.clear()
            before = np.array(states.wait_count(100)[-1].position)
            ENDS[end](client, node.pid)
            line = arm.wait_for_log(
                r'\[WARN\].*No valid effort for [\d.]+ s \(command_timeout\), since the joint '
                r'state of [\d.]+ s: the brakes hold the arm where it is, until the next effort')
            assert float(re.search(r'for ([\d.]+) s', line)[1]) >= 0.2
            states.clear()
            moved = np.abs(states.wait_count(10)[-1].position - before).max()
        finally:
            node.kill()
            client.forget('/ends')
    if action == 'ramp_to_zero':
        assert moved > 0.3
    else:
        assert moved < 1e-3
