# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Forward dynamics of joints at rest with dry friction: they stay at rest, or break away."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from simulated_arms import ABOUT_JOINT, one_link, released, rubbing, three_links

laws = settings(deadline=None, derandomize=True, max_examples=40)
ARM = rubbing(three_links(), viscous=0.25, coulomb=4.0, offset=0.2)
"""An arm with all friction except the Stribeck effect."""
PUSH = ExternalWrench('tool0', np.array([0.0, 0.0, 5.0]), np.zeros(3))


def some_state(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a position, a velocity with some zeros, and an effort near the holding effort."""
    random = np.random.default_rng(seed)
    q = random.uniform(-2.0, 2.0, 3)
    v = random.choice((0.0, 0.7, -0.7), 3)
    tau = ArmDynamics(ARM).rigid_body.nonlinear(q, v) + random.uniform(-20.0, 20.0, 3)
    return q, v, tau


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_one_joint_stays_up_to_its_static_friction(sign):
    dynamics = ArmDynamics(rubbing(one_link(), coulomb=[1.0], static=[1.5]))
    rest = np.zeros(1)
    for effort in (0.0, 1.2, 1.4999999):
        assert dynamics.forward_dynamics(rest, rest, np.array([sign * effort])).tolist() == [0.0]
    assert dynamics.forward_dynamics(rest, rest, np.array([sign * 2.1])) == pytest.approx(
        [sign * 0.6 / ABOUT_JOINT])
    # in motion Coulomb friction acts
    assert dynamics.forward_dynamics(rest, np.array([sign]), np.array([sign * 2.1])) == (
        pytest.approx([sign * 1.1 / ABOUT_JOINT]))


@laws
@given(seed=st.integers(0, 2**32 - 1))
def test_it_is_the_first_step_of_the_simulated_arm(seed):
    h = 1e-8
    q, v, tau = some_state(seed)
    a = ArmDynamics(ARM).forward_dynamics(q, v, tau, [PUSH])
    simulation = released(ARM, q, v)
    _, after = simulation.step(tau, h, [PUSH])
    stays = (v == 0.0) & (a == 0.0)
    assert (after[stays] == 0.0).all()
    assert (after[(v == 0.0) & ~stays] != 0.0).all()
    assert (after - v) / h == pytest.approx(a, rel=1e-6, abs=1e-6 * (1.0 + np.abs(a).max()))


@laws
@given(seed=st.integers(0, 2**32 - 1))
def test_inverse_dynamics_differs_by_what_holds_a_joint_at_rest(seed):
    dynamics = ArmDynamics(ARM)
    q, v, tau = some_state(seed)
    a = dynamics.forward_dynamics(q, v, tau)
    held = tau - dynamics.inverse_dynamics(q, v, a)
    static, rest = ARM.friction.static, v == 0.0
    assert held[~rest] == pytest.approx(np.zeros(int((~rest).sum())), abs=1e-9)
    assert (np.abs(held[rest]) <= static[rest] * (1.0 + 1e-9)).all()
    breaks_away = rest & (a != 0.0)
    assert held[breaks_away] == pytest.approx((static * np.sign(a))[breaks_away], rel=1e-9)
