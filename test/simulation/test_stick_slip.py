# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stick-slip of the running simulated arm, measured in its recording."""

import numpy as np
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.recordings.reader import JointSeries
from simulated_arms import released
from stick_slip import (
    COULOMB,
    DURATION,
    pulled_to,
    RATE,
    read_stick_slip,
    record_stick_slip,
    STATIC,
    STIFFNESS,
    STRIBECK_VELOCITY,
    URDF,
)

pytest.importorskip('rosbags')


@pytest.fixture(scope='module')
def series(tmp_path_factory: pytest.TempPathFactory) -> JointSeries:
    return read_stick_slip(record_stick_slip(tmp_path_factory.mktemp('bag')))


def departures(series: JointSeries) -> np.ndarray:
    """Return the samples at which the joint has just left a position where it stuck."""
    moves = np.diff(series.position[:, 0]) != 0.0
    return np.flatnonzero(moves[1:] & ~moves[:-1]) + 2


def test_the_recording_is_whole(series):
    assert len(series.stamps_ns) == round(DURATION * RATE)
    assert set(np.diff(series.stamps_ns)) == {round(1e9 / RATE)}


def test_each_break_away_is_at_the_static_friction(series):
    effort = series.effort[departures(series), 0]
    print(f'{len(effort)} break-aways, at {effort} N·m')
    assert np.abs(effort) == pytest.approx(np.full(len(effort), STATIC), rel=0.01)
    assert (np.abs(effort) >= STATIC).all()  # no earlier break-away
    assert (effort > 0.0).sum() >= 3  # in the positive direction
    assert (effort < 0.0).sum() >= 2  # in the negative direction


def test_the_effort_is_that_of_the_spring(series):
    end = np.array([pulled_to(stamp / 1e9) for stamp in series.stamps_ns[:-1]])
    torque = STIFFNESS * (end - series.position[:-1, 0])
    assert series.effort[1:, 0] == pytest.approx(torque, abs=1e-12)


def test_the_recorded_motion_is_the_librarys(series):
    arm = load_arm(URDF, gravity=(0.0, 0.0, 0.0))
    simulation = released(arm.with_friction(make_friction(
        arm.joint_names, coulomb=[COULOMB], static=[STATIC],
        stribeck_velocity=[STRIBECK_VELOCITY])))
    states = np.array([simulation.step(effort, 1.0 / RATE) for effort in series.effort[1:]])
    assert np.array_equal(np.stack((series.position, series.velocity), axis=1)[1:], states)
