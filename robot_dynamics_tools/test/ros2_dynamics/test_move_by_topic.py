# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics move` where the action is missing: on the side of the tool, or of the node."""

import json
import os
from pathlib import Path
import sys

from children import TIMEOUT
import numpy as np
import pytest
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from ros_harness import DYNAMICS, NodeProcess, running, SIMULATED_ARM


@pytest.fixture
def without_control_msgs(tmp_path: Path) -> dict[str, str]:
    """Return an environment in which `control_msgs` cannot be imported."""
    hidden = tmp_path / 'control_msgs'
    hidden.mkdir()
    (hidden / '__init__.py').write_text('raise ImportError("not installed")\n', 'utf-8')
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(
        (str(tmp_path), os.environ.get('PYTHONPATH', '')))}


def test_move_without_the_action(without_control_msgs, ask, monkeypatch):
    """By a tool without the messages of the action, then by one whose node does not offer it."""
    node = NodeProcess(
        DYNAMICS, {'lock_step': True}, namespace='/without', environment=without_control_msgs)
    arm = NodeProcess(SIMULATED_ARM, {
        'rate': 100.0, 'lock_step': True, 'real_time_factor': 1.0}, namespace='/without')
    with running(node, arm), DynamicsClient('/without/dynamics', TIMEOUT) as client:
        for goal, absent in ((('0.5', '0.3'), ('control_msgs.action',)), (('0.4', '0.2'), ())):
            with monkeypatch.context() as here:
                for name in absent:
                    here.setitem(sys.modules, name, None)
                status, out, err = ask(
                    'move', *goal, '--duration', '0.5', '--json', client=client)
            assert status == 0, err
            np.testing.assert_allclose(
                json.loads(out)['position'], list(map(float, goal)), atol=5e-3)
        assert ask('command', 'gravity_compensation', client=client)[0] == 0
        status, _, err = ask('move', '0.1', '0.1', client=client)
    assert status == 1
    assert 'rejected the goal: ' in err
