# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings that contradict the arm: each tool names the likely cause."""

import re

from arm_motions import fourier_motion, moves_with_pauses
from identification_bench import changed_arm, lugre_friction, rigid_effort, series_of
import numpy as np
import pytest
from recordings import encoded, KnownMotion, needs_ur10, UR10, write_recording
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.contradictions import find_contradictions
from robot_dynamics_tools.analysis.motion_filter import filter_motion
from robot_dynamics_tools.identification.bag_identification import (
    IdentificationSettings,
    read_motion,
)
from robot_dynamics_tools.payload_estimation.recordings import estimate_from_bags
from robots import JOINTS, robot_urdf

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
    bag = recorded(tmp_path / 'bag', **change)
    with pytest.raises(RecordingError, match=words):
        read_for_arm(bag, SETTINGS)
    if list(change) == ['tau']:  # currents have no limit
        read = read_for_arm(bag, AnalysisSettings(urdf=URDF, effort_is_current=True))
        assert len(read.series.stamps_ns) == len(MOTION.stamps_ns)


# --- causes that a fit names ---------------------------------------------------------------------

ARM = load_arm(URDF)
STATES = fourier_motion(ARM, 100.0, 20.0)
TRUE = changed_arm(ARM, 0.15)
FRICTION = 0.02 * ARM.limits.effort
NOISE = 0.004 * ARM.limits.effort * np.random.default_rng(0).normal(size=STATES.q.shape)
SIGNS = np.where(np.arange(6) == 2, -1.0, 1.0)
OFFSET = np.radians(2.0) * (np.arange(6) == 1)
LOAD = make_payload('tool0', 1.0, (0.0, 0.0, 0.05))


def effort_of(arm=TRUE, states=STATES):
    return rigid_effort(arm, states, 0.005 * ARM.limits.effort) + FRICTION * (
        0.5 * states.v + np.tanh(states.v / 0.03))


def filtered(effort, states=STATES):
    return filter_motion(series_of(ARM, states, effort + NOISE))


AT_REST = STATES._replace(v=0.0 * STATES.v, a=0.0 * STATES.a)
LOADED = np.where(
    STATES.times[:, np.newaxis] > 10.0, effort_of(TRUE.with_payloads([LOAD])), effort_of())
CONSTANTS = np.random.default_rng(0).uniform(0.7, 1.4, 6)
CASES = [
    ('opposite sign at elbow_joint', SIGNS * effort_of(), STATES),
    ('opposite sign at all joints', -effort_of(), STATES),
    ('lacks gravity', effort_of() - rigid_effort(TRUE, AT_REST), STATES),
    ('base is tilted by 1[4-6]', effort_of(TRUE.with_gravity((-2.54, 0.0, -9.48))), STATES),
    ('base is tilted by (8[6-9]|9[0-4])', effort_of(TRUE.with_gravity((0.0, 9.81, 0.0))), STATES),
    (r'changes by \+[\d.]+ kg after about (8|9|1[0-2])', LOADED, STATES),
    (r'shoulder_lift_joint is \+[12]\.?\d* ° too large', effort_of(),
     STATES._replace(q=STATES.q + OFFSET)),
    ('effort in mA', 60.0 * CONSTANTS * effort_of(), STATES)]


@pytest.mark.parametrize(('words', 'effort', 'states'), CASES)
def test_a_cause_is_named(words, effort, states):
    delay, (cause,) = find_contradictions(ARM, filtered(effort, states))
    assert not delay
    assert re.search(words, cause)


def planar_causes(seed, tilted, has_gravity=True):
    """Return the causes for the default arm, whose masses differ from the URDF by 25 %."""
    arm = load_arm(default_arm_urdf())
    states, true = fourier_motion(arm, 100.0, 20.0, seed), changed_arm(arm, 0.25, seed)
    if tilted:
        true = true.with_gravity((-3.35, 0.0, -9.22))
    limit = arm.limits.effort
    effort = rigid_effort(true, states, 0.005 * limit) + 0.02 * limit * np.tanh(states.v / 0.03)
    if not has_gravity:
        effort -= rigid_effort(true, states._replace(v=0.0 * states.v, a=0.0 * states.a))
    noise = 0.004 * limit * np.random.default_rng(seed).normal(size=effort.shape)
    return find_contradictions(arm, filter_motion(series_of(arm, states, effort + noise)))[1]


def test_a_tilted_base_of_a_planar_arm_is_no_other_unit():
    assert not any('mA' in cause for cause in planar_causes(0, tilted=True))
    (cause,) = planar_causes(1, tilted=True)  # cannot be distinguished
    assert 'position of joint1' in cause
    assert 'or a tilted base' in cause


def test_a_third_of_gravity_is_none():
    (cause,) = planar_causes(1, tilted=False, has_gravity=False)
    assert 'lacks gravity' in cause


def test_positions_and_velocities_in_degrees_contradict_the_effort_of_joints_without_limits():
    arm = load_arm(default_arm_urdf())
    states = fourier_motion(arm, 100.0, 20.0)
    effort = rigid_effort(arm, states) + 2.0 * np.tanh(states.v / 0.03)
    in_degrees = states._replace(q=np.degrees(states.q), v=np.degrees(states.v))
    with pytest.raises(RecordingError, match='positions and velocities in degrees'):
        find_contradictions(arm, filter_motion(series_of(arm, in_degrees, effort)))
    many_turns = states._replace(q=20.0 * states.q, v=20.0 * states.v, a=20.0 * states.a)
    effort = rigid_effort(arm, many_turns) + 2.0 * np.tanh(many_turns.v / 0.03)
    assert find_contradictions(arm, filter_motion(series_of(arm, many_turns, effort))) == (0.0, ())


def test_a_delay_is_found_and_removed():
    seconds = 0.2
    effort = np.stack([np.interp(STATES.times - seconds, STATES.times, column)
                       for column in effort_of().T], axis=1)
    motion = filtered(effort)
    delay, causes = find_contradictions(ARM, motion)
    assert delay == pytest.approx(seconds, abs=2e-3)
    assert not causes
    moved = motion.without_delay(delay)
    assert find_contradictions(ARM, moved) == (0.0, ())
    assert moved.times[-1] == pytest.approx(motion.times[-1] - seconds, abs=0.011)


@pytest.mark.parametrize(('robot', 'moves'), [
    ('default', fourier_motion), ('panda', moves_with_pauses)])
def test_a_clean_recording_of_another_friction_has_no_cause(robot, moves):
    arm = load_arm(robot_urdf(robot), JOINTS.get(robot, ()))
    states = moves(arm, 100.0, 20.0, 3)
    effort = rigid_effort(changed_arm(arm, 0.15, 1), states, 0.1) + lugre_friction(states)
    noise = 0.1 * np.random.default_rng(0).normal(size=effort.shape)
    assert find_contradictions(
        arm, filter_motion(series_of(arm, states, effort + noise))) == (0.0, ())


@needs_ur10
def test_the_recording_of_a_real_arm_has_no_cause():
    read = read_for_arm(UR10, SETTINGS)
    assert find_contradictions(read.arm, filter_motion(read.series)) == (0.0, ())


def test_rest_and_a_joint_without_effort_are_named(tmp_path):
    settings = IdentificationSettings(SETTINGS, 0.6)
    still = recorded(tmp_path / 'still', q=0.0 * MOTION.q, v=0.0 * MOTION.v)
    with pytest.raises(RecordingError, match='is at rest'):
        read_motion(still, settings)
    tau = MOTION.tau.copy()
    tau[:, 4] = np.nan
    with pytest.raises(RecordingError, match='no finite number: effort of wrist_2_joint'):
        read_motion(recorded(tmp_path / 'nan', tau=tau), settings)
    with pytest.raises(RecordingError, match='no finite number: effort of wrist_2_joint'):
        estimate_from_bags([tmp_path / 'nan'], 'tool0', SETTINGS)
