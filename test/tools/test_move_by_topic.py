# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics move` where the action is missing: on the side of the tool, or of the node."""

import json
import os
from pathlib import Path
import subprocess

from children import run, TIMEOUT
import numpy as np
import pytest
from robot_dynamics.tools.ros2_dynamics.client import DynamicsClient
from ros_harness import DYNAMICS, NodeProcess, running, SIMULATED_ARM
from verb_bench import PROGRAM


@pytest.fixture
def without_control_msgs(tmp_path: Path) -> dict[str, str]:
    """Return an environment in which `control_msgs` cannot be imported."""
    hidden = tmp_path / 'control_msgs'
    hidden.mkdir()
    (hidden / '__init__.py').write_text('raise ImportError("not installed")\n', 'utf-8')
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(
        (str(tmp_path), os.environ.get('PYTHONPATH', '')))}


@pytest.mark.parametrize('side', ['tool', 'node'])
def test_move_without_the_action(without_control_msgs, ask, side):
    namespace = f'/without_{side}'
    node = NodeProcess(
        DYNAMICS, namespace=namespace,
        environment=without_control_msgs if side == 'node' else None)
    arm = NodeProcess(SIMULATED_ARM, {
        'rate': 100.0, 'lock_step': True, 'real_time_factor': 1.0}, namespace=namespace)
    with running(node, arm), DynamicsClient(f'{namespace}/dynamics', TIMEOUT) as client:
        def move(*words: str) -> tuple[int, str, str]:
            if side == 'node':
                return ask('move', *words, client=client)
            done = run(
                [*PROGRAM, 'move', *words, '--node', f'{namespace}/dynamics', '--timeout',
                 str(TIMEOUT)], env=without_control_msgs, text=True, stdout=subprocess.PIPE,
                stderr=subprocess.PIPE)
            return done.returncode, done.stdout, done.stderr

        status, out, err = move('0.5', '0.3', '--duration', '1', '--json')
        assert status == 0, err
        np.testing.assert_allclose(json.loads(out)['position'], [0.5, 0.3], atol=5e-3)
        assert ask('command', 'gravity_compensation', client=client)[0] == 0
        status, _, err = move('0.1', '0.1')
    assert status == 1
    assert 'rejected the goal: ' in err
