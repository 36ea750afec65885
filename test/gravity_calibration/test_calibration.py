# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The laws of the calibration of gravity, on holds without noise."""

from dataclasses import replace

from calibration_bench import exact_drives, load_on, poses_of, TOOL_LINKS
from identification_bench import changed_arm, with_inertial_parameters
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.gravity_calibration.calibration import calibrate_holds, ScaleReference
from robot_dynamics.gravity_calibration.gravity_model import (
    gravity_parameters,
    gravity_regressor,
    link_columns,
)
from robot_dynamics.gravity_calibration.scale_fit import (
    effort_jacobian,
    model_effort,
    Observations,
)
from robot_dynamics.gravity_calibration.tool_estimate import Tool
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import inertial_parameters
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import arm_without_gripper

EXACT = 1e-9


@pytest.fixture(params=TOOL_LINKS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def assert_exact(found, drives) -> None:
    """Compare scale and offset where the scale is observable: not at a vertical first axis."""
    seen = found.is_observable
    assert seen.sum() >= len(seen) - 1
    np.testing.assert_allclose(found.scale[seen], drives.scale[seen], rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(found.offset[seen], drives.offset[seen], rtol=0.0, atol=EXACT)
    assert (found.scale[~seen] == 1.0).all()


def assert_same_tool(found, tool) -> None:
    """Compare what is observable: a planar arm does not determine a moment along its axes."""
    truth = np.array([tool.mass, *(tool.mass * tool.com)])
    seen = np.isfinite(found.tool.deviations)
    assert seen.sum() >= 3
    np.testing.assert_allclose(found.tool.values[seen], truth[seen], rtol=0.0, atol=EXACT)


@pytest.mark.parametrize('given', [None, 1.5])
def test_a_known_weight_gives_exact_scales_offsets_and_tool(name, given):
    arm = arm_without_gripper(name)
    drives, q = exact_drives(arm), poses_of(arm)
    tool, weight = load_on(name, 1.5), load_on(name, 2.0, (0.1, 0.0, 0.05))
    found = calibrate_holds(
        arm, drives.holds(q, arm.with_payloads([tool])),
        drives.holds(q, arm.with_payloads([tool, weight])), weight, Tool(tool.link, given))
    assert found.reference is ScaleReference.WEIGHT
    assert_exact(found, drives)
    assert_same_tool(found, tool)
    assert (found.tool.deviations[0] == 0.0) == (given is not None)


def test_a_known_tool_gives_exact_scales_offsets_and_moments(name):
    arm = arm_without_gripper(name)
    drives, tool = exact_drives(arm), load_on(name, 1.5)
    found = calibrate_holds(
        arm, drives.holds(poses_of(arm), arm.with_payloads([tool])), tool=Tool(tool.link, 1.5))
    assert found.reference is ScaleReference.TOOL
    assert_exact(found, drives)
    assert_same_tool(found, tool)
    assert found.tool.deviations[0] == 0.0


def test_without_a_reference_scale_and_mass_are_confounded():
    """All masses that are 1.1 times those of the URDF divide the scales by 1.1, exactly."""
    arm = arm_without_gripper('xarm7')
    drives = exact_drives(arm)
    heavier = with_inertial_parameters(arm, 1.1 * inertial_parameters(arm))
    found = calibrate_holds(arm, drives.holds(poses_of(arm), heavier))
    assert found.reference is ScaleReference.URDF
    assert_exact(found, replace(drives, scale=drives.scale / 1.1))


def test_a_known_weight_makes_scales_independent_of_masses_of_the_urdf():
    arm = arm_without_gripper('xarm7')
    drives, q, weight = exact_drives(arm), poses_of(arm), load_on('xarm7', 2.0, (0.1, 0.0, 0.05))
    found = calibrate_holds(
        changed_arm(arm, 0.3), drives.holds(q), drives.holds(q, arm.with_payloads([weight])),
        weight)
    assert_exact(found, drives)


def test_the_poses_with_the_weight_may_be_others():
    arm = arm_without_gripper('xarm7')
    drives, q, weight = exact_drives(arm), poses_of(arm, 20), load_on('xarm7', 2.0)
    found = calibrate_holds(
        arm, drives.holds(q[:10]), drives.holds(q[10:], arm.with_payloads([weight])), weight)
    assert_exact(found, drives)


def test_a_tilted_base_makes_the_first_scale_observable():
    arm = arm_without_gripper('ur10').with_gravity((3.0, 0.0, -9.0))
    drives, tool = exact_drives(arm), load_on('ur10', 1.5)
    found = calibrate_holds(
        arm, drives.holds(poses_of(arm), arm.with_payloads([tool])), tool=Tool(tool.link, 1.5))
    assert found.is_observable.all()
    assert_exact(found, drives)


def test_the_first_joint_of_an_upright_arm_has_an_offset_and_no_scale():
    arm = arm_without_gripper('xarm7')
    drives = exact_drives(arm)
    found = calibrate_holds(arm, drives.holds(poses_of(arm)))
    assert found.is_observable.tolist() == [False] + 6 * [True]
    assert (found.scale[0], found.scale_interval[0]) == (1.0, np.inf)
    assert abs(found.offset[0] - drives.offset[0]) < EXACT


def test_a_joint_that_came_from_one_side_only_is_left_as_it_is():
    arm = arm_without_gripper('xarm7')
    drives = exact_drives(arm)
    holds = [hold._replace(approach=np.where(np.arange(7) == 3, 1, hold.approach))
             for hold in drives.holds(poses_of(arm))]
    found = calibrate_holds(arm, holds)
    assert found.pose_count.tolist() == [12, 12, 12, 0, 12, 12, 12]
    assert (found.scale[3], found.offset[3]) == (1.0, 0.0)
    assert np.isinf([found.scale_interval[3], found.offset_interval[3]]).all()
    others = np.array([1, 2, 4, 5, 6])
    np.testing.assert_allclose(found.scale[others], drives.scale[others], atol=EXACT)


def test_the_jacobian_is_the_derivative_of_the_model():
    rng = np.random.default_rng(0)
    P, n, count = 3, 4, 5
    seen = Observations(
        np.zeros((P, n)), rng.normal(size=(P, n)), rng.normal(size=(P, n, count)),
        np.ones((P, n), dtype=np.bool_))
    x = rng.normal(size=2 * n + count)

    def model(values):
        return model_effort(values[:n], values[n:2 * n], values[2 * n:], seen)

    J, h = effort_jacobian(x[:n], x[2 * n:], seen), 1e-6
    for i, step in enumerate(h * np.eye(len(x))):
        numeric = (model(x + step) - model(x - step)) / (2.0 * h)
        np.testing.assert_allclose(J[:, :, i], numeric, atol=1e-8)


def test_the_regressor_gives_gravity_and_the_load_of_a_link(name):
    arm, load = arm_without_gripper(name), load_on(name, 1.5)
    q = poses_of(arm, 8)
    Y, T, phi = gravity_regressor(arm, q), link_columns(arm, load.link), gravity_parameters(arm)
    np.testing.assert_allclose(Y @ phi, RigidBody(arm).gravity_batch(q), atol=1e-10)
    with_load = RigidBody(arm.with_payloads([load])).gravity_batch(q)
    np.testing.assert_allclose(
        Y @ (phi + T @ np.array([1.5, *(1.5 * load.com)])), with_load, atol=1e-10)


@pytest.mark.parametrize(('change', 'message'), [
    ({'count': 3}, r'6 holds without weight have 3 poses that a joint approached from both '
                   r'sides, expected at least 4'),
    ({'gravity': (0.0, 9.81, 0.0)}, r'no effort scale is observable: the gravity torque in the '
                                    r'poses varies by \[0\.0, 0\.0\] N·m'),
    ({'tool': Tool('tool0')}, 'the mass of the tool is not given'),
    ({'tool': Tool('hand', 1.0)}, "link is 'hand', expected one of the links"),
    ({'weight': make_payload('tool0', 1.0)}, 'there are 0 holds with a weight'),
])
def test_what_cannot_be_calibrated_is_refused(change, message):
    arm = load_arm(default_arm_urdf(), gravity=change.get('gravity', (0.0, 0.0, -9.81)))
    q = poses_of(load_arm(default_arm_urdf()))[:change.get('count', 12)]
    with pytest.raises(InvalidInputError, match=message):
        calibrate_holds(
            arm, exact_drives(arm).holds(q), weight=change.get('weight'), tool=change.get('tool'))


def test_a_weight_on_the_base_is_refused():
    arm = load_arm(default_arm_urdf())
    holds = exact_drives(arm).holds(poses_of(arm))
    with pytest.raises(InvalidInputError, match="'base_link', which is fixed to the base"):
        calibrate_holds(arm, holds, holds, make_payload('base_link', 1.0))
