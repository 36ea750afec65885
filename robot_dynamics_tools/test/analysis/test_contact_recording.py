# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Contact levels from a recording without contact, without a node."""

from pathlib import Path

from arm_motions import moves_with_pauses
import numpy as np
from recordings import encoded, START_NS, write_recording
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.commands.learn_contact_levels import main


def record_free_motion(folder: Path) -> None:
    """Write the recording `bag` of 70 s without contact, with noise, and `arm.urdf`."""
    arm = load_arm(default_arm_urdf())
    states = moves_with_pauses(arm, 100.0, 70.0)
    effort = ArmDynamics(arm).inverse_dynamics_batch(states.q, states.v, states.a)
    effort += np.random.default_rng(0).normal(size=effort.shape)
    stamps = START_NS + np.round(1e9 * states.times).astype(np.int64)
    write_recording(folder / 'bag', encoded(stamps, arm.joint_names, states.q, states.v, effort))
    (folder / 'arm.urdf').write_text(default_arm_urdf())


def run(folder: Path, *words: str) -> int:
    """Run the tool on this recording; return its exit status."""
    return main([str(folder / 'bag'), '--urdf', str(folder / 'arm.urdf'), *words])


def test_the_tool_writes_a_parameter_file(tmp_path, capsys):
    record_free_motion(tmp_path)
    path = tmp_path / 'levels.yaml'
    assert run(tmp_path, '-o', str(path)) == 0
    printed = capsys.readouterr().out
    assert 'extrapolated from 70 s' in printed
    assert '1 per hour is an upper bound, with slightly higher levels: record 3 h' in printed
    assert 'extrapolated' in path.read_text(encoding='utf-8')
    parameters = read_parameter_file(path)
    assert parameters['joints'] == ['joint1', 'joint2']
    assert 1.0 < min(parameters['contact.effort']) < max(parameters['contact.effort']) < 10.0
    assert run(tmp_path, '-o', str(path)) == 2  # the file exists
    assert run(tmp_path, '--alarms-per-hour', '0') == 2
    assert 'alarms_per_hour is 0, expected a number > 0' in capsys.readouterr().err
