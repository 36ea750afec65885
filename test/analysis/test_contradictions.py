# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings that contradict the arm: each tool names the likely cause."""

import numpy as np
import pytest
from recordings import encoded, KnownMotion, write_recording
from robot_dynamics.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics.exceptions import RecordingError
from robots import robot_urdf

URDF = robot_urdf('ur10')
MOTION = KnownMotion(urdf=URDF, rest=-0.8)
SETTINGS = AnalysisSettings(urdf=URDF)


def recorded(path, q=MOTION.q, v=MOTION.v, tau=MOTION.tau):
    return write_recording(path, encoded(MOTION.stamps_ns, MOTION.names, q, v, tau))


@pytest.mark.parametrize(('change', 'words'), [
    ({'tau': 100.0 * MOTION.tau}, r'effort beyond 10 times .* shoulder_lift_joint .* in mA'),
    ({'q': np.degrees(MOTION.q), 'v': np.degrees(MOTION.v)}, 'position beyond 2 .* in degrees'),
    ({'q': 0.02 * np.degrees(MOTION.q), 'v': 0.02 * MOTION.v}, 'position in degrees'),
])
def test_a_wrong_unit_is_an_error_with_its_likely_cause(tmp_path, change, words):
    with pytest.raises(RecordingError, match=words):
        read_for_arm(recorded(tmp_path / 'bag', **change), SETTINGS)


def test_currents_have_no_limit_of_the_effort(tmp_path):
    bag = recorded(tmp_path / 'bag', tau=100.0 * MOTION.tau)
    read = read_for_arm(bag, AnalysisSettings(urdf=URDF, effort_is_current=True))
    assert len(read.series.stamps_ns) == len(MOTION.stamps_ns)
