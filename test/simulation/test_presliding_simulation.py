# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Dry friction of the simulated arm that yields over the presliding distance before it slides."""

from functools import cache, partial
from typing import Any

from controller_bench import ARM
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robots import arm_without_gripper
from simulated_arms import block, released, rubbing

panda = cache(partial(arm_without_gripper, 'panda'))
POSE = np.array([0.3, -0.4, 0.2, -1.8, 0.5, 1.6, 0.4])
DAMPING_RATIO = 0.2
"""Of a joint that vibrates within its presliding distance."""


ranges = {
    'mass': st.floats(-4.0, 1.0).map(lambda x: 10.0**x),
    'coulomb': st.floats(-2.0, 1.7).map(lambda x: 10.0**x),
    'distance': st.floats(-5.0, -1.7).map(lambda x: 10.0**x)}


# --- one joint: the laws -------------------------------------------------------------------------

@settings(max_examples=20, deadline=None)
@given(**ranges, part=st.floats(-0.02, 0.02), angle=st.floats(1.0, 300.0))
def test_a_joint_that_sticks_is_a_damped_spring(mass, coulomb, distance, part, angle):
    """Under a step of effort: exact at steps of `angle`/ω, at rest at the effort × d / F_c."""
    rate = np.sqrt(coulomb / distance / mass)
    h, steps = angle / rate, int(np.ceil(120.0 / angle))
    simulation = released(
        block(mass, coulomb=[coulomb], presliding_distance=[distance]), max_step=h)
    damped = rate * np.sqrt(1.0 - DAMPING_RATIO**2)
    for k in range(1, steps + 1):
        simulation.step(np.array([part * coulomb]), h)
        decay = np.exp(-DAMPING_RATIO * rate * k * h)
        expected = part * (1.0 - decay * (
            np.cos(damped * k * h) + DAMPING_RATIO * rate / damped * np.sin(damped * k * h)))
        assert simulation.q[0] == pytest.approx(expected * distance, abs=2e-5 * distance)
        assert simulation.presliding_state == pytest.approx([expected], abs=2e-5)
    assert simulation.q[0] * coulomb / distance == pytest.approx(
        part * coulomb, abs=1e-6 * coulomb)


@pytest.mark.parametrize(('F_s', 'distance'), [(4.0, 0.02), (6.0, 1e-5)])
def test_it_breaks_away_at_its_static_friction(F_s, distance):
    simulation = released(block(
        0.05, coulomb=[4.0], static=[F_s], stribeck_velocity=[1e-3],
        presliding_distance=[distance]))
    for part in np.linspace(0.0, 0.99, 200):
        state = simulation.step(np.array([part * F_s]), 2e-3)
        assert abs(state.position[0]) <= distance
        assert simulation.presliding_state == pytest.approx([part], abs=0.05)
    for _ in range(100):
        state = simulation.step(np.array([1.01 * F_s]), 2e-3)
    assert simulation.presliding_state == [1.0]
    v = state.velocity[0]
    state = simulation.step(np.array([1.01 * F_s]), 2e-3)
    assert state.velocity[0] - v == pytest.approx((1.01 * F_s - 4.0) / 0.05 * 2e-3, rel=1e-9)


def test_it_does_not_creep_under_a_vibrating_load():
    simulation = released(block(0.1, coulomb=[2.0], presliding_distance=[1e-3]))
    positions = [simulation.step(
        np.array([1.2 + 0.6 * np.sin(0.1 * k)]), 2e-3).position[0] for k in range(2000)]
    assert np.ptp(positions[1000:]) > 5e-4
    assert max(positions[-500:]) == pytest.approx(max(positions[1000:1500]), abs=1e-7)


def test_the_offset_between_the_directions_remains():
    """F_c + F_o = 2.5 N forward, 1.5 N backward, also for the break-away."""
    arm = block(0.1, coulomb=[2.0], offset=[0.5], presliding_distance=[1e-3])
    for effort, z in ((2.49, 0.995), (2.51, 1.0), (-1.49, -0.995), (-1.51, -1.0), (0.0, -0.25)):
        simulation = released(arm)
        for part in [*np.linspace(0.0, 1.0, 250), *np.ones(200)]:
            simulation.step(np.array([part * effort]), 2e-3)
        assert simulation.presliding_state == pytest.approx([z], abs=1e-4)
        assert (abs(simulation.v[0]) > 1e-3) == (abs(z) == 1.0)


# --- arms ----------------------------------------------------------------------------------------

def small_steps(
    arm: ArmModel, q: np.ndarray, efforts: np.ndarray, seconds: float, h: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the law of `bristles` with the midpoint rule in steps of h [s]; return q, z."""
    body, friction = ArmDynamics(arm).rigid_body, arm.friction
    d, F = friction.presliding_distance, friction.coulomb
    q, v, z = q.copy(), np.zeros_like(q), np.zeros_like(q)

    def rates(tau: Any, q: Any, v: Any, z: Any) -> Any:
        M = body.mass_matrix(q)
        sticks = ~((np.abs(z) >= 1.0) & (z * v > 0.0))
        damping = 2.0 * DAMPING_RATIO * np.sqrt(F / d * np.diag(M)) * sticks * np.exp(
            -v * v / (F * d / np.diag(M)))
        effort = tau - body.nonlinear(q, v) - (F * z + (damping + friction.viscous) * v)
        return v, np.linalg.solve(M, effort), np.where(sticks, v / d, 0.0)

    for tau in efforts:
        for _ in range(round(seconds / h)):
            middle = rates(tau, *(x + 0.5 * h * rate for x, rate in zip(
                (q, v, z), rates(tau, q, v, z))))
            q, v, z = (x + h * rate for x, rate in zip((q, v, z), middle))
            z = np.clip(z, -1.0, 1.0)
    return q, z


def test_two_links_move_as_small_steps_of_the_law_say():
    """With stick and slip of both joints, under efforts around gravity compensation."""
    arm = rubbing(ARM, viscous=[0.2, 0.1], coulomb=[4.0, 1.5], presliding_distance=[5e-4, 0.01])
    q = np.array([0.6, -0.8])
    gravity = ArmDynamics(ARM).rigid_body.gravity(q)
    efforts = gravity + np.array([[3.0, 1.0], [7.0, -1.2], [-2.0, 3.0], [-9.0, 0.0], [1.0, 1.0]])
    expected = small_steps(arm, q, efforts, 0.04, 5e-5)
    ends = []
    for max_step in (2e-3, 2e-4):
        simulation = released(arm, q, max_step=max_step)
        for effort in efforts:
            for _ in range(20):
                simulation.step(effort, 2e-3)
        ends.append(simulation.q.copy())
    assert np.abs(simulation.q - q).max() > 0.01
    assert ends[0] == pytest.approx(ends[1], abs=5e-8)
    # the midpoint rule passes slips with an error of first order
    assert simulation.q == pytest.approx(expected[0], abs=1e-4)
    assert simulation.presliding_state == pytest.approx(expected[1], abs=5e-3)


frictions = st.fixed_dictionaries({
    'viscous': st.sampled_from([0.0, 0.01, 1.0]), 'coulomb': ranges['coulomb'],
    'static': st.sampled_from([1.0, 1.6]), 'offset': st.sampled_from([0.0, -0.4, 0.3]),
    'sigmoid': st.sampled_from([0.0, 0.0, 0.5]),
    'load_coefficient': st.sampled_from([0.0, 0.0, 0.1]),
    'presliding_distance': st.one_of(st.just(0.0), ranges['distance'])})


def random_friction(each: list[dict[str, float]]) -> dict[str, list[float]]:
    """Return parameters in which F_s and F_o are multiples of F_c."""
    columns = {name: [one[name] for one in each] for name in each[0]}
    for name in ('static', 'offset'):
        columns[name] = [share * F for share, F in zip(columns[name], columns['coulomb'])]
    return columns


@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_energy_never_grows_without_input(data):
    """K + P with the energy of the bristles, minus the work, over random arms and states."""
    bare, q = data.draw(st.sampled_from([(ARM, np.array([0.4, -0.7])), (panda(), POSE)]))
    n = bare.joint_count
    each = data.draw(st.lists(frictions, min_size=n, max_size=n))
    arm = rubbing(bare, **random_friction(each))
    v = np.array(data.draw(st.lists(
        st.sampled_from([0.0, 0.0, 0.01, -0.3, 1.0]), min_size=n, max_size=n)))
    gravity = ArmDynamics(bare).rigid_body.gravity(q)
    tau = data.draw(st.sampled_from([0.0, 0.9, 1.0])) * gravity
    h = data.draw(st.sampled_from([1e-3, 2e-3, 0.01]))
    simulation = released(arm, q, v)
    left = sum(simulation.energy) - simulation.work
    for _ in range(12):
        simulation.step(tau, h)
        scale = 1.0 + sum(np.abs(simulation.energy)) + abs(simulation.work)
        before, left = left, sum(simulation.energy) - simulation.work
        assert left <= before + 1e-7 * scale
        assert np.abs(simulation.presliding_state).max() <= 1.0


# --- operation -----------------------------------------------------------------------------------

def test_brakes_keep_the_deflection_and_a_reset_relaxes_it():
    q = np.array([0.4, -0.7])
    arm = rubbing(ARM, coulomb=[4.0, 1.5], presliding_distance=[5e-4, 1e-4])
    simulation = released(arm, q)
    effort = ArmDynamics(ARM).rigid_body.gravity(q) + np.array([3.0, -1.0])
    for _ in range(500):
        simulation.step(effort, 2e-3)
    position, z, energy = simulation.q.copy(), simulation.presliding_state, simulation.energy
    assert z == pytest.approx([0.75, -2.0 / 3.0], rel=0.05)
    simulation.brake()
    simulation.wait(0.1)
    assert simulation.presliding_state.tolist() == z.tolist()
    assert simulation.energy[1] == energy[1]
    simulation.release()
    for _ in range(100):
        simulation.step(effort, 2e-3)
    assert simulation.q == pytest.approx(position, abs=1e-7)
    simulation.reset()
    assert simulation.presliding_state.tolist() == [0.0, 0.0]
