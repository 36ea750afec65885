# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics retime`: files in and out, the printed summary, and bad arguments."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from robot_dynamics.trajectories import (
    efforts_along,
    make_trajectory,
    read_trajectory,
    retime,
    write_trajectory,
)
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from ros_harness import DYNAMICS, NodeProcess
from simulated_arms import default_dynamics
from verb_bench import assert_refused

NAMES = ('joint1', 'joint2')
ARM = default_dynamics()


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with NodeProcess(DYNAMICS):
        yield


@pytest.fixture
def motion(tmp_path: Path) -> Path:
    path = tmp_path / 'motion.yaml'
    write_trajectory(path, quintic_point_to_point(NAMES, [0.0, 0.0], [1.0, 0.5], 2.0))
    return path


def test_the_fastest_timing_is_written(ask, motion, tmp_path):
    output = tmp_path / 'faster.yaml'
    status, out, err = ask('retime', motion, '--output', output, '--efforts-may-jump')
    assert (status, err) == (0, '')
    expected = retime(ARM, read_trajectory(motion, NAMES))
    result = read_trajectory(output, NAMES)
    assert result.duration == pytest.approx(expected.duration)
    assert efforts_along(ARM, result).worst_ratio < 1.0 + 1e-5
    first, *_, last = out.splitlines()
    assert first == f'/dynamics: {expected.summary}'
    assert last == f'{len(result.points)} points are written to {output}'
    assert 'effort' in out


@pytest.mark.parametrize(('words', 'message'), [
    (('--method', 'quick'), "method is 'quick', expected one of ['fastest', 'slow_down']"),
    (('--corner-tolerance', '-1'), 'corner_tolerance is -1'),
    (('--output', '/absent/faster.yaml'), "--output '/absent/faster.yaml' cannot be written"),
])
def test_bad_arguments_are_rejected_by_name(ask, motion, words, message):
    assert_refused(ask, ['retime', motion, *words], message)


def test_bad_files_are_rejected_by_name(ask, tmp_path):
    assert_refused(ask, ['retime', tmp_path / 'absent.yaml'], 'cannot be read')
    corner = tmp_path / 'corner.yaml'
    write_trajectory(corner, make_trajectory(NAMES, [0, 1, 2], [[0, 0], [1, 0], [1, 1]]))
    assert_refused(ask, ['retime', corner], 'points[1].positions is a corner')
    assert ask('retime', corner, '--corner-tolerance', '0.05')[0] == 0
