# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of different arms, and of an arm with the URDF of another, are named."""

from pathlib import Path

from arm_motions import fourier_motion
from identification_bench import changed_arm, rigid_effort, series_of
import numpy as np
import pytest
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.regressor import inertial_parameters, random_states
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.contradictions import far_from_urdf, gravity_ratios
from robot_dynamics_tools.analysis.motion_filter import filter_motion, FilteredMotion
from robot_dynamics_tools.identification.pipeline import Identification, identify
from robots import arm_without_gripper, robot_urdf

UR10 = Path(__file__).parents[3] / '../shared/data/ur10'
RATE, DURATION = 125.0, 20.0


def shortened(name: str) -> ArmModel:
    """Return the arm with its first three joints; the others are locked."""
    return load_arm(robot_urdf(name), arm_without_gripper(name).joint_names[:3])


def recorded(name: str, urdf: str, seed: int) -> FilteredMotion:
    """Return a motion of an arm whose masses differ from its URDF, read with another URDF."""
    arm = shortened(name)
    states, limit = fourier_motion(arm, RATE, DURATION, seed), arm.limits.effort
    effort = rigid_effort(changed_arm(arm, 0.15), states, 0.005 * limit) + 0.02 * limit * (
        0.5 * states.v + np.tanh(states.v / 0.03))
    noise = 0.004 * limit * np.random.default_rng(seed).normal(size=effort.shape)
    return filter_motion(series_of(shortened(urdf), states, effort + noise))


def identified(urdf: str, *names: str) -> Identification:
    recordings = [recorded(name, urdf, k) for k, name in enumerate(names)]
    return identify(shortened(urdf), recordings)


def named(found: Identification) -> list[int]:
    """Return the numbers of the recordings that contradict the others."""
    return [k for k, each in enumerate(found.recordings)
            if any('contradicts the other' in cause for cause in each.facts.contradictions)]


@pytest.mark.parametrize(('urdf', 'names', 'odd'), [
    ('ur10', ('ur10', 'ur10', 'ur10'), []), ('ur10', ('ur10', 'ur5', 'ur10'), [1]),
    ('ur10', ('ur5', 'ur10'), [0, 1])])
def test_the_recording_of_another_arm_is_named(urdf, names, odd):
    assert named(identified(urdf, *names)) == odd


@pytest.mark.parametrize(('urdf', 'name', 'is_far'), [
    ('ur5', 'ur10', True), ('ur10', 'ur5', True), ('ur10', 'ur10', False),
    ('panda', 'panda', False), ('default', 'default', False)])
def test_the_urdf_of_another_arm_is_named(urdf, name, is_far):
    (recording,) = identified(urdf, name).recordings
    causes = recording.facts.contradictions
    assert ['another URDF' in cause for cause in causes] == [True] * is_far


@pytest.mark.soak
@pytest.mark.skipif(not UR10.is_dir(), reason='the recording of a UR10 is missing')
@pytest.mark.parametrize(('urdf', 'is_far'), [('ur10', False), ('ur5', True)])
def test_the_urdf_of_another_arm_is_named_for_a_real_arm(urdf, is_far):
    read = read_for_arm(UR10, AnalysisSettings(urdf=robot_urdf(urdf)))
    (recording,) = identify(read.arm, [filter_motion(read.series)]).recordings
    causes = recording.facts.contradictions
    assert ['another URDF' in cause for cause in causes] == [True] * is_far


@pytest.mark.parametrize('factor', [0.3, 1.0, 1.9, 2.1])
def test_the_gravity_ratio_of_heavier_bodies_is_the_ratio_of_their_masses(factor):
    arm = arm_without_gripper('ur10')
    ratios = gravity_ratios(arm, factor * inertial_parameters(arm), random_states(arm, 20)[0])
    # shoulder_pan is vertical, and the last wrist bears nothing
    assert ratios == pytest.approx(np.array([1.0, factor, factor, 1.0, 1.0, 1.0]))
    assert bool(far_from_urdf(arm.joint_names, ratios)) == (not 0.5 <= factor <= 2.0)
