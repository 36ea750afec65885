# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The check that an arm can carry a payload, and that a payload is plausible."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.payload_check import (
    check_payloads,
    HELD_FRACTION,
    holdable_mass,
    LEAST_DISTANCE,
    reach,
    REACH_MULTIPLE,
)
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import ARMS, robot_urdf

laws = settings(deadline=None, derandomize=True, max_examples=20)


def slide_urdf(effort: float = 50.0, axis: str = '0 0 1', travel: float = 2.0) -> str:
    return f"""<robot name="slide"><link name="base"/><link name="carriage"><inertial>
        <mass value="1.0"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
        </inertial></link><joint name="lift" type="prismatic"><parent link="base"/>
        <child link="carriage"/><origin xyz="0.5 0 0"/><axis xyz="{axis}"/>
        <limit lower="-1.0" upper="{travel}" velocity="1.0" effort="{effort}"/></joint></robot>"""


@pytest.fixture(scope='module')
def arm() -> ArmModel:
    """Return the default arm."""
    return load_arm(default_arm_urdf())


def with_effort_limits(arm: ArmModel, effort: list[float]) -> ArmModel:
    return replace(arm, limits=replace(arm.limits, effort=np.array(effort)))


@pytest.mark.parametrize('mass', [100.0, 1e6])
def test_a_mass_that_is_held_nowhere_is_rejected_with_the_numbers(arm, mass):
    load = make_payload('tool0', mass)
    most = holdable_mass(arm, load)
    with pytest.raises(InvalidInputError) as raised:
        check_payloads(arm, [load], ' (remedy)')
    message = str(raised.value)
    assert f"is {mass:g} kg on 'tool0', expected at most {most:.3g} kg" in message
    assert message.endswith('(remedy)')


def test_the_largest_mass_is_held_and_little_more_is_not(arm):
    most = holdable_mass(arm, make_payload('tool0', 1.0))
    check_payloads(arm, [make_payload('tool0', most)])
    with pytest.raises(InvalidInputError, match='expected at most'):
        check_payloads(arm, [make_payload('tool0', 1.01 * most)])
    # the reported share of random poses, compared with an independent count
    rng = np.random.default_rng(1)
    body = RigidBody(arm.with_payloads([make_payload('tool0', most)]))
    held = [bool((np.abs(body.gravity(q)) <= arm.limits.effort).all())
            for q in rng.uniform(-np.pi, np.pi, (20_000, 2))]
    assert np.mean(held) == pytest.approx(HELD_FRACTION, rel=0.3)


def test_a_slide_holds_what_its_effort_limit_lifts():
    slide = load_arm(slide_urdf(effort=50.0))
    assert holdable_mass(slide, make_payload('carriage', 1.0)) == pytest.approx(50.0 / 9.81 - 1.0)


def test_gravity_that_no_joint_feels_limits_no_mass():
    sideways = load_arm(slide_urdf(axis='1 0 0'))
    check_payloads(sideways, [make_payload('carriage', 1e6)])
    assert holdable_mass(sideways, make_payload('carriage', 1.0)) == np.inf


def test_without_effort_limits_any_mass_is_held(arm):
    unlimited = with_effort_limits(arm, [np.inf, np.inf])
    check_payloads(unlimited, [make_payload('tool0', 1e6)])
    assert holdable_mass(unlimited, make_payload('tool0', 1.0)) == np.inf


def test_an_arm_that_cannot_hold_itself_holds_nothing(arm):
    weak = with_effort_limits(arm, [1e-3, 1e-3])
    assert holdable_mass(weak, make_payload('tool0', 1.0)) == 0.0
    with pytest.raises(InvalidInputError, match='expected at most 0 kg'):
        check_payloads(weak, [make_payload('tool0', 0.1)])


def test_loads_are_judged_together(arm):
    most = holdable_mass(arm, make_payload('tool0', 1.0))
    one, other = make_payload('tool0', 0.7 * most), make_payload('link2', 0.7 * most, (0, 0, 0.8))
    check_payloads(arm, [one])
    check_payloads(arm, [other])
    with pytest.raises(InvalidInputError, match="on 'link2', expected at most"):
        check_payloads(arm, [one, other])


@laws
@given(st.floats(0.1, 0.99), st.floats(1.01, 1e4), st.floats(0.0, 2 * np.pi))
def test_a_centre_of_mass_is_within_a_multiple_of_the_reach(inside, outside, angle):
    arm = load_arm(default_arm_urdf())
    limit = REACH_MULTIPLE * reach(arm)
    assert limit == pytest.approx(2 * 1.8)
    direction = np.array([np.cos(angle), 0.0, np.sin(angle)])
    check_payloads(arm, [make_payload('tool0', 1e-3, inside * limit * direction)])
    with pytest.raises(InvalidInputError, match=r"m from the origin of 'tool0', expected at most"):
        check_payloads(arm, [make_payload('tool0', 1e-3, outside * limit * direction)])


def test_the_reach_has_the_travel_of_slides():
    assert reach(load_arm(slide_urdf(travel=2.0))) == pytest.approx(2.5)


def test_a_link_without_extent_permits_a_metre():
    turntable = load_arm(default_arm_urdf().replace('0.8', '0').replace('0.4', '0'))
    assert LEAST_DISTANCE == 1.0
    check_payloads(turntable, [make_payload('link2', 0.1, (0.9, 0, 0))])


@pytest.mark.parametrize('name', ARMS)
def test_arms_carry_a_kilogram_at_most_a_reach_away(name):
    arm = load_arm(robot_urdf(name))
    assert 0.2 < reach(arm) < 3.0
    link = arm.link_names[-1]
    most = holdable_mass(arm, make_payload(link, 1.0))
    assert most > 0.1
    check_payloads(arm, [make_payload(link, min(0.5 * most, 1.0))])
