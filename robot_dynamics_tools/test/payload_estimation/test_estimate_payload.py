# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The tool `estimate_payload` on recordings of arms with hidden loads."""

import json
from pathlib import Path

import numpy as np
from payload_bench import hidden_load, holds, measured, Samples
import pytest
from recordings import encoded, START_NS, write_recording
from robot_dynamics_tools.commands.estimate_payload import main
from robots import robot_path

CASE = hidden_load('ur10', seed=11)


def record(path: Path, samples: Samples, effort: np.ndarray | None) -> Path:
    stamps = START_NS + np.round(1e9 * samples.t).astype(np.int64)
    return write_recording(
        path, encoded(stamps, CASE.arm.joint_names, samples.q, samples.v, effort))


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of six holds, approached from both directions."""
    samples = holds(CASE, 6, both_sides=True)
    return record(tmp_path_factory.mktemp('payload') / 'bag', samples, measured(CASE, samples))


def options(link: str = 'tool0') -> list[str]:
    return ['--urdf', str(robot_path('ur10')), '--link', link, '--scale-deviation', '0']


def test_the_load_of_a_recording(bag, capsys):
    # the model of the tool has no friction: that of the URDF
    assert main([str(bag), *options(), '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    truth = CASE.load.body.toDynamicParameters()
    error = np.array(figures['values'][:4]) - truth[:4]
    assert abs(error[0]) < max(0.02 * truth[0], 0.02)
    assert (np.abs(error) < 4.0 * np.array(figures['deviations'][:4])).all()
    assert figures['pairs'] >= 30
    assert figures['holds'] == 12
    assert max(figures['residual_by_effort']) < 0.2
    assert main([str(bag), *options()]) == 0
    text = capsys.readouterr().out
    assert main([str(bag), *options()[:-2], '--json']) == 1  # by default, scales may be wrong
    other = json.loads(capsys.readouterr().out)
    assert other['deviations'][1] > 1.5 * figures['deviations'][1]
    assert 'calibrate_gravity with a known weight' in other['advice'][0]
    for words in ('centre of mass', 'observable', 'friction cancels', 'torque constant', 'mx'):
        assert words in text


def test_the_residual_shows_a_wrong_sign(tmp_path, capsys):
    samples = holds(CASE, 6, both_sides=True)
    effort = measured(CASE, samples) * [1.0, -1.0, 1.0, 1.0, 1.0, 1.0]
    bag = record(tmp_path / 'bag', samples, effort)
    assert main([str(bag), *options()]) == 1  # the load is not observable
    out = capsys.readouterr().out
    assert float(out.split('shoulder_lift_joint ')[1].split()[0]) > 100.0
    assert 'the effort has the opposite sign at shoulder_lift_joint' in out
    assert 'not observable' in out
    assert 'To make parameters observable:' in out


def test_two_recordings_are_one_estimate(bag, tmp_path, capsys):
    samples = holds(CASE._replace(seed=12), 2, both_sides=True)
    other = record(tmp_path / 'bag', samples, measured(CASE._replace(seed=12), samples))
    assert main([str(bag), str(other), *options(), '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert len(figures['recordings']) == 2
    assert figures['holds'] == 12 + 4
    assert figures['values'][0] == pytest.approx(
        CASE.load.mass, abs=4.0 * figures['deviations'][0])


def test_mistakes_are_reported_in_one_line(bag, tmp_path, capsys):
    bare = record(tmp_path / 'bare', holds(CASE, 1, both_sides=False), None)
    for arguments, words in (
            ([str(bag), *options('hand')], "link is 'hand', expected one of the links"),
            ([str(bare), *options()], 'the recording has no effort'),
            ([str(bag), *options(), '--cutoff', '90'], 'cutoff is 90 Hz, expected at most'),
            ([str(tmp_path / 'nowhere'), *options()], 'does not exist')):
        assert main(arguments) == 2
        assert words in capsys.readouterr().err
