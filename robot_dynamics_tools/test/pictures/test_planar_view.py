# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A planar chain from a URDF: the passes of the recursion."""

import re

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
from planar_chains import on_a_turned_base, random_chain, urdf_of, with_reversed_joint
import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.chain import newton_euler
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.pictures.planar_view import PlanarView
from robots import robot_urdf

cases = st.tuples(st.integers(1, 5), st.integers(0, 2**32 - 1))


def motion(seed, n):
    rng = np.random.default_rng(seed)
    return rng.uniform(-4.0, 4.0, n), rng.normal(0.0, 3.0, n), rng.normal(0.0, 10.0, n)


def assert_same(found, expected):
    for field, one, other in zip(found._fields, found, expected):
        scale = max(np.abs(other).max(), 1.0)
        npt.assert_allclose(one, other, rtol=0.0, atol=1e-11 * scale, err_msg=field)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(cases, *2 * [st.one_of(st.just(0.0), st.floats(-3.0, 3.0))])
def test_passes_are_those_of_the_recursion_written_for_the_plane(case, yaw, lean):
    """In any order of the joints; the base faces any way, and its lean is a shift of joint 1."""
    n, seed = case
    chain, (q, v, a) = random_chain(seed, n), motion(seed, n)
    order = np.random.default_rng(seed).permutation(n)
    arm = load_arm(
        on_a_turned_base(urdf_of(chain), (0.0, lean, yaw)), [f'joint{i + 1}' for i in order])
    shifted = q + lean * (np.arange(n) == 0)
    assert_same(
        PlanarView(arm).passes(q[order], v[order], a[order]), newton_euler(chain, shifted, v, a))


def test_a_joint_that_counts_the_other_way_round():
    chain, (q, v, a) = random_chain(3, 3), motion(3, 3)
    sense = np.array([1.0, -1.0, 1.0])
    arm = load_arm(with_reversed_joint(urdf_of(chain), 'joint2'))
    view = PlanarView(arm)
    assert_same(view.passes(q, v, a), newton_euler(chain, sense * q, sense * v, sense * a))
    moments = sense * view.passes(q, v, a).tau
    npt.assert_allclose(moments, ArmDynamics(arm).inverse_dynamics(q, v, a), rtol=0.0, atol=1e-10)


def test_upright_is_reported():
    assert PlanarView(load_arm(default_arm_urdf())).upright_at_zero
    tilted = on_a_turned_base(default_arm_urdf(), (0.0, 0.3, 0.0))
    assert not PlanarView(load_arm(tilted)).upright_at_zero


def test_a_chain_in_a_horizontal_plane_has_no_weight_in_it():
    flat = load_arm(on_a_turned_base(default_arm_urdf(), (np.pi / 2.0, 0.0, 0.0)))
    view = PlanarView(flat)
    npt.assert_allclose(view.weight(0), 0.0, atol=1e-12)
    now = view.passes(np.array([0.3, 0.4]), np.zeros(2), np.zeros(2))
    npt.assert_allclose(now.force, 0.0, atol=1e-12)
    npt.assert_allclose(view.reach(), 1.8)


@pytest.mark.parametrize(('robot', 'joints', 'message'), [
    ('ur10', (), "expected joints whose axes are parallel, such as ['shoulder_lift_joint', "
     "'elbow_joint', 'wrist_1_joint', 'wrist_3_joint']"),
    ('panda', ('panda_joint2', 'panda_finger_joint1'), "as ['panda_finger_joint2'] do"),
    ('baxter', ('left_e1', 'left_w1', 'r_gripper_l_finger_joint'), 'mimic'),
    ('talos_full_v2', ('leg_left_4_joint', 'leg_right_4_joint'), 'branch off'),
])
def test_what_is_no_planar_chain_is_refused_by_name(robot, joints, message):
    arm = load_arm(robot_urdf(robot), joints)
    with pytest.raises(ModelError, match=re.escape(message)):
        PlanarView(arm)


def test_a_slide_is_refused():
    urdf = default_arm_urdf().replace('"joint2" type="continuous"', '"joint2" type="prismatic"')
    urdf = urdf.replace('effort="60.0"', 'lower="0" upper="1" effort="60.0"')
    with pytest.raises(ModelError, match=r"joints that turn, which \['joint2'\] do not"):
        PlanarView(load_arm(urdf))
