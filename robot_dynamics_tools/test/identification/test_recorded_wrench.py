# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The intervals of the external wrench, judged on a recording of a real UR10."""

from pathlib import Path

import numpy as np
import pytest
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.commands.identify import main as identify
from robot_dynamics_tools.monitoring.external_wrench import ExternalWrenchEstimator
from robots import robot_urdf

UR10 = Path(__file__).parents[2] / '../shared/data/ur10'
COVERED = 1.96


# ------------------------------------------------------------------------------ coverage


@pytest.mark.soak
def test_the_deviation_covers_the_residual_of_a_real_ur10(tmp_path):
    """Identified from the first 60 % of the recording, without a contact: judged on the rest."""
    if not UR10.exists():
        pytest.skip(f'the recording of a real UR10 is not at {UR10}')
    urdf = tmp_path / 'ur10.urdf'
    urdf.write_text(robot_urdf('ur10'))
    assert identify([str(UR10), '--urdf', str(urdf), '--output', str(tmp_path / 'out')]) == 0
    parameters = read_parameter_file(tmp_path / 'out' / 'identified.yaml')
    recording = read_for_arm(UR10, AnalysisSettings(
        str(parameters['robot_description']), parameters=parameters))
    dynamics, series = ArmDynamics(recording.arm), recording.series
    observer = ExternalEffort(dynamics, 10.0)
    estimator = ExternalWrenchEstimator(dynamics, observer, 'tool0')
    found, drive = [], recording.arm.given_drive
    for dt, q, v, effort in zip(
            np.diff(series.times, prepend=0.0), series.position, series.velocity, series.effort):
        if observer.update(dt, q, v, drive.torque(effort)) is not None:
            found.append(estimator.update(dt))
    judged = [one for one in found[int(0.6 * len(found)):] if one is not None]
    z = np.array([one.wrench / np.sqrt(np.diag(one.covariance)) for one in judged])
    covered = np.mean(np.abs(z) < COVERED, axis=0)
    print('components within the intervals, in %:', (100.0 * covered).round(1))
    assert covered.min() >= 0.95
    assert np.sqrt(np.mean(z**2, axis=0)).min() > 0.3
