# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`ros2 dynamics task_space`, `inverse --derivatives` and `retime`.

Output, JSON, files in and out, and bad arguments.
"""

from collections.abc import Iterator
import json
from pathlib import Path
import re

import numpy as np
import pytest
from robot_dynamics.model.derivatives import ArmDerivatives
from robot_dynamics.task_space import TaskSpace
from robot_dynamics.trajectories import (
    efforts_along,
    make_trajectory,
    read_trajectory,
    retime,
    write_trajectory,
)
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from ros_harness import DYNAMICS, NodeProcess, running, SIMULATED_ARM, UNHURRIED
from simulated_arms import default_dynamics
from verb_bench import assert_refused

DYNAMICS_OF = default_dynamics()
ARM = DYNAMICS_OF.arm
Q, V = [0.785398, 0.523599], [0.5, 0.3]


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with running(NodeProcess(DYNAMICS, UNHURRIED), NodeProcess(SIMULATED_ARM, {'rate': 50.0})):
        yield


def test_json_is_that_of_the_library(ask):
    status, out, _ = ask(
        'task_space', 'link2', *Q, '-v', *V, '--point', 0.1, 0, 0.8, '--reference', 'local',
        '--json')
    assert status == 0
    data = json.loads(out)
    expected = TaskSpace(ARM, 'link2', (0.1, 0.0, 0.8), 'local').at(Q, V)
    for name in ('translation', 'jacobian', 'bias_acceleration', 'inertia', 'inverse_inertia',
                 'dynamic_inverse', 'gravity_force', 'coriolis_force', 'rank',
                 'translation_singular_values', 'rotation_manipulability'):
        np.testing.assert_allclose(data[name], getattr(expected, name), atol=1e-9)
    assert np.shape(data['lost_directions']) == (4, 6)
    assert data['position_margin'] == [None, None]
    assert 'Infinity' not in out


def test_tables_have_units_and_the_lost_directions(ask):
    status, out, _ = ask('task_space', 'tool0', *Q, '--velocity', *V)
    assert status == 0
    assert 'position (1.4798, 0.0000, 0.9142) m' in out
    assert 'Inertia Λ [kg, kg·m, kg·m²], the pseudo-inverse of Λ⁻¹' in out
    assert re.search(r'joint2 +no limit\n', out)
    assert 'Rank 2 of 6. Lost directions' in out


def test_without_a_position_it_is_the_measured_one(ask):
    status, out, _ = ask('task_space', 'tool0', '--json')
    assert status == 0
    assert json.loads(out)['translation'] == pytest.approx([0.0, 0.0, 1.8], abs=1e-3)


def test_derivatives(ask):
    status, out, _ = ask('inverse', *Q, '--velocity', *V, '--derivatives', '--json')
    data, by = json.loads(out), ArmDerivatives(ARM).inverse_dynamics(Q, V, [0.0, 0.0])
    assert status == 0
    for name in ('position', 'velocity', 'acceleration'):
        np.testing.assert_allclose(data[f'effort_{name}_derivative'], getattr(by, name), atol=1e-9)
    text = ask('inverse', *Q, '--derivatives')[1]
    assert 'Derivative of the efforts by position\n' in text
    assert 'effort_position_derivative' not in json.loads(ask('inverse', *Q, '--json')[1])


@pytest.mark.parametrize(('words', 'reason'), [
    (['tool1', *Q], "frame is 'tool1', expected one of the links ['base_link', 'link1'"),
    (['tool0', *Q, '--reference', 'world'], "reference is 'world', expected one of"),
])
def test_bad_arguments_are_rejected_by_name(ask, words, reason):
    assert_refused(ask, ['task_space', *words], reason)


# --- retime --------------------------------------------------------------------------------------

@pytest.fixture
def motion(tmp_path: Path) -> Path:
    path = tmp_path / 'motion.yaml'
    write_trajectory(path, quintic_point_to_point(ARM.joint_names, [0.0, 0.0], [1.0, 0.5], 2.0))
    return path


def test_the_fastest_timing_is_written(ask, motion, tmp_path):
    output = tmp_path / 'faster.yaml'
    status, out, err = ask('retime', motion, '--output', output, '--efforts-may-jump')
    assert (status, err) == (0, '')
    expected = retime(DYNAMICS_OF, read_trajectory(motion, ARM.joint_names))
    result = read_trajectory(output, ARM.joint_names)
    assert result.duration == pytest.approx(expected.duration)
    assert efforts_along(DYNAMICS_OF, result).worst_ratio < 1.0 + 1e-5
    first, *_, last = out.splitlines()
    assert first == f'/dynamics: {expected.summary}'
    assert last == f'{len(result.points)} points are written to {output}'
    assert 'effort' in out


@pytest.mark.parametrize(('words', 'message'), [
    (('--method', 'quick'), "method is 'quick', expected one of ['fastest', 'slow_down']"),
    (('--corner-tolerance', '-1'), 'corner_tolerance is -1'),
])
def test_bad_arguments_of_retime_are_rejected_by_name(ask, motion, words, message):
    assert_refused(ask, ['retime', motion, *words], message)


def test_bad_files_are_rejected_by_name(ask, tmp_path):
    assert_refused(ask, ['retime', tmp_path / 'absent.yaml'], 'cannot be read')
    corner = tmp_path / 'corner.yaml'
    write_trajectory(corner, make_trajectory(ARM.joint_names, [0, 1, 2], [[0, 0], [1, 0], [1, 1]]))
    assert_refused(ask, ['retime', corner], 'points[1].positions is a corner')
    status, _, err = ask('retime', corner, '--output', '/proc/absent/faster.yaml')
    assert (status, 'cannot write /proc/absent' in err) == (1, True)
    assert ask('retime', corner, '--corner-tolerance', '0.05')[0] == 0
