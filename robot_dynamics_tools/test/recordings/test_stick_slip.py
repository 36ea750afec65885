# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stick-slip of the running simulated arm is that of the library; its recording is complete."""

import numpy as np
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics_tools.recordings.reader import JointSeries
from simulated_arms import released
from stick_slip import (
    COULOMB,
    DURATION,
    RATE,
    read_stick_slip,
    record_stick_slip,
    STATIC,
    STRIBECK_VELOCITY,
    URDF,
)

pytest.importorskip('rosbags')


@pytest.fixture(scope='module')
def series(tmp_path_factory: pytest.TempPathFactory) -> JointSeries:
    return read_stick_slip(record_stick_slip(tmp_path_factory.mktemp('bag')))


def test_the_recording_is_whole_and_has_the_motion_of_the_library(series):
    assert len(series.stamps_ns) == round(DURATION * RATE)
    assert set(np.diff(series.stamps_ns)) == {round(1e9 / RATE)}
    assert (series.velocity == 0.0).sum() > 500  # it sticks
    assert np.ptp(series.position) > 0.5
    arm = load_arm(URDF, gravity=(0.0, 0.0, 0.0))
    simulation = released(arm.with_friction(make_friction(
        arm.joint_names, coulomb=[COULOMB], static=[STATIC],
        stribeck_velocity=[STRIBECK_VELOCITY])))
    states = np.array([simulation.step(effort, 1.0 / RATE) for effort in series.effort[1:]])
    assert np.array_equal(np.stack((series.position, series.velocity), axis=1)[1:], states)
