# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A robot without a screen: both nodes run where the libraries of the tools are missing."""

import os
import sys

from absent_libraries import environment_without
import children
from closed_loop import receiving
import pytest
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import DYNAMICS, NodeProcess, running, SIMULATED_ARM, UNHURRIED

OF_TOOLS = ('matplotlib', 'scipy', 'PIL', 'rosbags', 'viser', 'trimesh', 'xacro', 'launch')
TRY = """
import sys
for name in sys.argv[1:]:
    try:
        __import__(name)
    except ModuleNotFoundError as error:
        print(error)
"""


@pytest.fixture(scope='module')
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return an environment without these libraries, which is tried first."""
    variables = environment_without(tmp_path_factory.mktemp('site'), OF_TOOLS)
    tried = children.run(
        [sys.executable, '-c', TRY, *OF_TOOLS], capture_output=True, text=True,
        env={**os.environ, **variables})
    assert tried.stdout.splitlines() == [f'No module named {name!r}' for name in OF_TOOLS]
    return variables


def test_both_nodes_close_the_loop(client, environment):
    nodes = [NodeProcess(DYNAMICS, UNHURRIED, environment=environment),
             NodeProcess(SIMULATED_ARM, {'initial_position': [0.5, 0.2]}, environment=environment)]
    with running(*nodes), receiving(client, '', 'effort_command', 'joint_states') as (
            efforts, states):
        effort = efforts.wait_for(lambda message: len(message.effort) == 2)
        state = states.wait_for(lambda message: any(message.effort))  # the brakes are released
        response = client.call(
            InverseDynamics, '/dynamics/inverse_dynamics',
            InverseDynamics.Request(position=[0.785398, 0.523599]))
    assert list(effort.name) == list(state.name) == ['joint1', 'joint2']
    assert response.success, response.message
    assert list(response.effort) == pytest.approx([-49.5228, -11.3709], abs=1e-3)
