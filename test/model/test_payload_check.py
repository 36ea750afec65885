# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The check that an arm can carry a payload, and that a payload is plausible."""

from dataclasses import replace

import numpy as np
from one_joint_arm import arm_of
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.payload_check import check_payloads, holdable_mass, reach
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf


def slide_urdf(axis: str = '0 0 1') -> str:
    return f"""<robot name="slide"><link name="base"/><link name="carriage"><inertial>
        <mass value="1.0"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
        </inertial></link><joint name="lift" type="prismatic"><parent link="base"/>
        <child link="carriage"/><origin xyz="0.5 0 0"/><axis xyz="{axis}"/>
        <limit lower="-1.0" upper="2.0" velocity="1.0" effort="50.0"/></joint></robot>"""


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
    assert np.mean(held) == pytest.approx(0.01, rel=0.3)


def test_a_slide_holds_what_its_effort_limit_lifts():
    slide = load_arm(slide_urdf())
    assert holdable_mass(slide, make_payload('carriage', 1.0)) == pytest.approx(50.0 / 9.81 - 1.0)
    assert reach(slide) == pytest.approx(2.5)  # with its travel
    sideways = load_arm(slide_urdf(axis='1 0 0'))  # no joint feels gravity
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


def test_a_centre_of_mass_is_within_a_multiple_of_the_reach(arm):
    """Twice the reach of 1.8 m; a metre for a link without extent."""
    turntable = load_arm(arm_of())
    for model, link, limit in ((arm, 'tool0', 3.6), (turntable, 'arm', 1.0)):
        for angle in np.linspace(0.0, 6.0, 7):
            com = limit * np.array([np.cos(angle), 0.0, np.sin(angle)])
            check_payloads(model, [make_payload(link, 1e-3, 0.99 * com)])
            with pytest.raises(InvalidInputError, match=f"m from the origin of '{link}'"):
                check_payloads(model, [make_payload(link, 1e-3, 1.01 * com)])


@pytest.mark.parametrize('name', ['kinova', 'panda', 'so100', 'talos_left_arm', 'ur5'])
def test_arms_carry_a_kilogram_at_most_a_reach_away(name):
    arm = load_arm(robot_urdf(name))
    assert 0.2 < reach(arm) < 3.0
    link = arm.link_names[-1]
    most = holdable_mass(arm, make_payload(link, 1.0))
    assert most > 0.1
    check_payloads(arm, [make_payload(link, min(0.5 * most, 1.0))])
