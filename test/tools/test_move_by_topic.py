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
def test_move_without_the_action(without_control_msgs, side):
    namespace = f'/without_{side}'
    node = NodeProcess(
        DYNAMICS, {'condition_references': True}, namespace=namespace,
        environment=without_control_msgs if side == 'node' else None)
    with running(node, NodeProcess(SIMULATED_ARM, {'rate': 200.0}, namespace=namespace)):
        def verb(*words: str) -> 'subprocess.CompletedProcess[str]':
            return run(
                [*PROGRAM, *words, '--node', f'{namespace}/dynamics', '--timeout',
                 str(TIMEOUT)],
                env=without_control_msgs if side == 'tool' else None, text=True,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE)

        done = verb('move', '0.5', '0.3', '--duration', '1', '--json')
        assert done.returncode == 0, done.stderr
        np.testing.assert_allclose(json.loads(done.stdout)['position'], [0.5, 0.3], atol=5e-3)
        assert verb('command', 'gravity_compensation').returncode == 0
        refused = verb('move', '0.1', '0.1')
    assert refused.returncode == 1
    assert 'rejected the goal: ' in refused.stderr
