# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Marks of a 3-D view at an arm: arcs at joints, the ellipsoid of a link, payloads."""

from controller_bench import ARM
import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics_tools.pictures.arm_marks import ArmMarks, effort_line, effort_scale, JointPlace
from robots import robot_urdf

AXIS = np.array([1.0, 2.0, -2.0]) / 3.0
PLACE = JointPlace(np.array([0.3, -0.2, 0.5]), AXIS, False)


def turns(line, place):
    """Return the angles of a line from point to point, right-handed about the axis."""
    arms = line - place.origin
    return [np.arctan2(np.cross(a, b) @ place.axis, a @ b) for a, b in zip(arms, arms[1:])]


@pytest.mark.parametrize('ratio', [0.01, 0.3, -1.1])
def test_an_arc_is_about_the_axis_as_long_as_its_ratio(ratio):
    arc = effort_line(PLACE, ratio, 0.2)[:-3]  # without the arrow head
    arms = arc - PLACE.origin
    npt.assert_allclose(arms @ AXIS, 0.0, atol=1e-12)
    npt.assert_allclose(np.linalg.norm(arms, axis=1), 0.2)
    assert sum(turns(arc, PLACE)) == pytest.approx(ratio * 1.5 * np.pi)
    arc = effort_line(PLACE, 50.0, 0.2)[:-3]  # does not wind up
    assert sum(turns(arc, PLACE)) == pytest.approx(1.2 * 1.5 * np.pi)


@pytest.mark.parametrize('ratio', [0.5, -0.5])
def test_the_line_of_a_joint_that_slides_is_along_it(ratio):
    line = effort_line(PLACE._replace(slides=True), ratio, 0.2)
    npt.assert_allclose(line[1] - line[0], 3.0 * 0.2 * ratio * AXIS, atol=1e-12)


def test_efforts_without_a_limit_are_ratios_to_the_largest():
    scale = effort_scale(np.array([-8.0, 2.0, 1.0]), np.array([np.inf, 10.0, 0.0]))
    npt.assert_array_equal(scale, [8.0, 10.0, 8.0])
    npt.assert_array_equal(effort_scale(np.zeros(2), np.full(2, np.inf)), [1.0, 1.0])


def test_joints_of_the_planar_arm_are_where_trigonometry_puts_them():
    marks, q = ArmMarks(ARM), np.array([0.7, 0.4])
    marks.move(q)
    base, elbow = marks.joints()
    origin = base.origin + [np.sin(0.7), 0.0, np.cos(0.7)]  # links of 1 m and 0.8 m, from upright
    npt.assert_allclose(elbow.origin, origin, atol=1e-12)
    npt.assert_allclose(
        marks.pose()[0], origin + 0.8 * np.array([np.sin(1.1), 0.0, np.cos(1.1)]), atol=1e-12)
    for place in (base, elbow):
        npt.assert_allclose(place.axis, [0.0, 1.0, 0.0], atol=1e-12)
        assert not place.slides
    assert marks.reach == pytest.approx(1.8)
    assert marks.weight == pytest.approx(8.0 * 9.81)


@pytest.mark.parametrize('name', ['ur10', 'panda'])
def test_axes_are_what_turns_the_tool(name):
    """The tool moves by axis × (tool − origin) or along the axis: columns of J by differences."""
    arm = load_arm(robot_urdf(name))
    marks, step = ArmMarks(arm), 1e-6
    q = np.clip(np.linspace(0.3, 1.2, arm.joint_count), arm.limits.lower, arm.limits.upper)
    marks.move(q)
    places, tool = marks.joints(), marks.pose()[0]
    for i, place in enumerate(places):
        moved = q.copy()
        moved[i] += step
        marks.move(moved)
        found = (marks.pose()[0] - tool) / step
        expected = place.axis if place.slides else np.cross(place.axis, tool - place.origin)
        if i < 6:  # fingers do not all move the last link
            npt.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize(('name', 'link'), [
    ('ur10', 'forearm_link'), ('panda', ''), ('default', '')])
def test_the_link_moves_within_its_ellipsoid(name, link):
    """Its velocities by differences, at joint velocities with the norm 1, touch the surface."""
    arm = load_arm(robot_urdf(name))
    marks, rng, step = ArmMarks(arm, link), np.random.default_rng(1), 1e-6
    q = 0.5 * np.clip(rng.normal(size=arm.joint_count), arm.limits.lower, arm.limits.upper)

    def origin(q):
        marks.move(q)
        return marks.pose()[0]

    J = np.column_stack([
        (origin(q + step * unit) - origin(q - step * unit)) / (2.0 * step)
        for unit in np.eye(arm.joint_count)])
    marks.move(q)
    half_axes, U = marks.manipulability()
    npt.assert_allclose(U @ U.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(U) == pytest.approx(1.0)
    for axis, length in zip(U.T, half_axes):
        assert np.linalg.norm(J.T @ axis) == pytest.approx(length, abs=1e-7)
    npt.assert_allclose(U @ np.diag(half_axes**2) @ U.T, J @ J.T, atol=1e-7)


def test_a_payload_is_a_ball_of_its_mass_at_its_centre_of_mass():
    assert ArmMarks(ARM).payloads() == []
    loaded = ARM.with_payloads([make_payload('tool0', 2.0, (0.0, 0.0, 0.1))])
    marks = ArmMarks(loaded)
    marks.move(np.array([0.5, 0.0]))
    ((centre, radius),) = marks.payloads()
    npt.assert_allclose(
        centre, marks.joints()[0].origin + 1.9 * np.array([np.sin(0.5), 0.0, np.cos(0.5)]),
        atol=1e-12)
    assert radius**3 * 4.0 / 3.0 * np.pi * 2000.0 == pytest.approx(2.0)
