# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Contact levels from a recording without contact, without a node."""

from pathlib import Path

from arm_motions import moves_with_pauses
import numpy as np
from recordings import encoded, START_NS, write_recording
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.monitoring.contact_levels import (
    ContactLevels,
)
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.ros2_dynamics.verbs import make_parser, run


def record_free_motion(folder: Path) -> None:
    """Write the recording `bag` of 70 s without contact, with noise, and `arm.urdf`."""
    arm = load_arm(default_arm_urdf())
    states = moves_with_pauses(arm, 100.0, 70.0)
    effort = ArmDynamics(arm).inverse_dynamics_batch(states.q, states.v, states.a)
    effort += np.random.default_rng(0).normal(size=effort.shape)
    stamps = START_NS + np.round(1e9 * states.times).astype(np.int64)
    write_recording(folder / 'bag', encoded(
        stamps, arm.joint_names, states.q, states.v, effort))
    (folder / 'arm.urdf').write_text(default_arm_urdf())


def run_verb(folder: Path, *words: str) -> int:
    """Run the verb on this recording; return its exit status."""
    return run('learn_contact_levels', make_parser().parse_args([
        'learn_contact_levels', str(folder / 'bag'), '--urdf', str(folder / 'arm.urdf'), *words]))


# --- hours without contact, fast -----------------------------------------------------------------

# The effort of the arm differs from that of the model by masses, friction with presliding, and
# noise. The observer passes this difference through its filter of first order
# (`test_external_effort.py`); that of the rigid bodies, which is smooth, is interpolated.

RATE = 100.0


def alarms(levels: ContactLevels, v: FloatArray, r: FloatArray) -> int:
    """Return the number of contacts, which 0.5 s below the levels end, fast."""
    rows = np.flatnonzero((np.abs(r) > levels.at(v)).any(axis=1))
    return int(np.sum(np.diff(rows) >= 0.5 * RATE - 0.5)) + bool(len(rows))


# ------------------------------------------------------------------------------ false alarms


# ------------------------------------------------------------------------------ the delay


# ------------------------------------------------------------------------------ files, bad input

def test_the_verb_writes_a_parameter_file(tmp_path, capsys):
    """Without a node."""
    record_free_motion(tmp_path)
    path = tmp_path / 'levels.yaml'
    assert run_verb(tmp_path, '-o', str(path)) == 0
    printed = capsys.readouterr().out
    assert 'extrapolated from 70 s' in printed
    assert '1 per hour is an upper bound, with slightly higher levels: record 3 h' in printed
    assert 'extrapolated' in path.read_text(encoding='utf-8')
    parameters = read_parameter_file(path)
    assert parameters['joints'] == ['joint1', 'joint2']
    assert 1.0 < min(parameters['contact.effort']) < max(parameters['contact.effort']) < 10.0
    assert run_verb(tmp_path, '-o', str(path)) == 2  # the file exists
    assert run_verb(tmp_path, '--alarms-per-hour', '0') == 2
    assert 'alarms_per_hour is 0, expected a number > 0' in capsys.readouterr().err
