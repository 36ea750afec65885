# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Backlash in the simulated arm: gap, impacts, energy, an exact solution, convergence order."""

import numpy as np
from optional_library import library
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from simulated_arms import one_link, released, rubbing

CONTACT_TIME = 2e-4
"""[s] within which the contact force must separate teeth that bounce."""
SLOW = 1e-3
"""Velocity [rad/s] below which the contact is kept."""


class ExactJoint:
    """
    A joint of inertia M [kg·m²] with friction F [N·m·s/rad], and its motor J on the joint side.

    Another integrator, with events at contact and separation, solves q, q̇, θ, θ̇ with tight
    tolerances: J θ̈ = τ and M q̈ = −F q̇ apart, (M + J) q̈ = τ − F q̇ together.
    """

    def __init__(self, F: float, half_gap: float, restitution: float) -> None:
        self._F, self._b, self._e = F, half_gap, restitution
        self.state = np.zeros(4)
        self._side = 0.0
        """Side of the contact, 0 without contact."""
        self.impacts = 0
        self._solve_ivp = library('scipy.integrate').solve_ivp

    def step(self, tau: float, h: float) -> None:
        """Advance by h [s] with a constant motor effort."""
        def slope(_: float, x: FloatArray) -> list[float]:
            _, v, _, omega = x
            together = (tau - self._F * v) / (M + J)
            a, alpha = (together, together) if self._side else (-self._F * v / M, tau / J)
            return [v, a, omega, alpha]

        def event(_: float, x: FloatArray) -> float:  # the contact torque, or the free gap
            if self._side:
                return float(self._side * (tau - J * slope(0.0, x)[1]))
            return float(self._b - abs(x[2] - x[0]))

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        while h > 1e-12:
            if self._side and event(0.0, self.state) < 0.0:
                self._side = 0.0
            found = self._solve_ivp(
                slope, (0.0, h), self.state, 'DOP853', events=event, rtol=1e-12, atol=1e-14,
                max_step=1e-4 if self._e else h)
            h, self.state = h - found.t[-1], found.y[:, -1]
            if found.status == 1:
                self._side = 0.0 if self._side else self._reach_contact(tau)

    def _reach_contact(self, tau: float) -> float:
        """Return the side of the contact after an impact, 0 if the teeth bounce."""
        q, v, theta, omega = self.state
        side, w, m = np.sign(theta - q), omega - v, M * J / (M + J)
        press = side * (tau + J * self._F * v / M)
        bounces = abs(w) >= SLOW and 2.0 * self._e * abs(w) * J >= press * CONTACT_TIME
        e = self._e if bounces else 0.0
        v, omega = v + (1.0 + e) * m * w / M, omega - (1.0 + e) * m * w / J
        self.state = np.array([q, v, q + side * self._b, omega])
        self.impacts += 1
        return 0.0 if e else float(side)


M, J = 0.6, 0.2
"""Inertia of the one link, and of its motor on the joint side [kg·m²]."""
GAP = 0.1
"""[rad]"""


def geared(arm: ArmModel, **changes: list[float]) -> ArmModel:
    return arm.with_actuators(make_actuators(arm.joint_names, **{
        'torque_constant': [0.05], 'gear_ratio': [100.0], 'rotor_inertia': [J / 1e4],
        'backlash': [GAP], **changes}))


def links(n: int, gravity: float = 9.81) -> ArmModel:
    """Return a planar arm of up to three links, without motors and friction."""
    masses, lengths = [5.0, 3.0, 1.0][:n], [1.0, 0.8, 0.5][:n]
    return load_arm(
        planar_arm_urdf(masses, lengths, [0.5, 0.4, 0.2][:n], [0.1, 0.05, 0.01][:n]),
        gravity=(0.0, 0.0, -gravity))


def motor_offset(simulation: ArmSimulation) -> FloatArray:
    """Return θ − q (n,)."""
    return simulation.motor_state.position - simulation.q


def closing(simulation: ArmSimulation) -> FloatArray:
    """Return w = θ̇ − q̇ (n,)."""
    return simulation.motor_state.velocity - simulation.v


# --- the gap -------------------------------------------------------------------------------------

@pytest.mark.parametrize(('n', 'restitution'), [
    (2, 0.5), pytest.param(3, 0.0, marks=pytest.mark.soak)])
def test_motor_and_joint_are_never_further_apart_than_half_the_gap(n, restitution):
    gaps = np.array([0.02, 0.05, 0.01])[:n]
    arm = geared(
        rubbing(links(n), viscous=[0.3], coulomb=[0.4], static=[0.6], stribeck_velocity=[0.05]),
        backlash=gaps.tolist(), restitution=[restitution])
    simulation = released(arm, np.full(n, 0.3))
    random = np.random.default_rng(n)
    furthest, crossings = np.zeros(n), np.zeros(n)
    side = np.sign(motor_offset(simulation))
    for _ in range(80):
        weight = ArmDynamics(arm).rigid_body.gravity(simulation.q)
        tau = weight + random.normal(0.0, [60.0, 30.0, 8.0][:n])
        for _ in range(5):
            simulation.step(tau, 2e-3)
            distance = motor_offset(simulation)
            furthest = np.maximum(furthest, np.abs(distance))
            crossings += side * distance < 0.0
            side = np.sign(distance)
    assert (furthest <= 0.5 * gaps + 1e-10).all(), furthest - 0.5 * gaps
    assert (furthest > 0.49 * gaps).all(), furthest
    assert (crossings > 5).all(), crossings


def test_a_released_arm_rests_on_its_gears():
    arm, at_rest = geared(links(3), backlash=[0.02]), np.array([0.4, -0.7, 0.5])
    simulation = released(arm, at_rest)
    weight = ArmDynamics(arm).rigid_body.gravity(at_rest)
    assert motor_offset(simulation) == pytest.approx(np.sign(weight) * 0.01)
    for _ in range(100):
        simulation.step(weight, 1e-3)
    assert simulation.q == pytest.approx(at_rest, abs=1e-12)
    assert simulation.motor_state.position == pytest.approx(
        at_rest + np.sign(weight) * 0.01, abs=1e-12)


# --- impacts -------------------------------------------------------------------------------------

def test_an_impact_keeps_the_momentum_of_all_joints():
    """M v + J ω (2,) over microseconds in which one of two joints hits its motor."""
    bare = links(2, gravity=0.0)
    simulation = released(
        geared(bare, restitution=[0.7], backlash=[0.05]), (0.2, 0.9), (1.0, -2.5))
    body = ArmDynamics(bare).rigid_body

    def momentum() -> FloatArray:
        return np.asarray(body.mass_matrix(simulation.q) @ simulation.v
                          + J * simulation.motor_state.velocity)

    impacts, h = 0, 2e-6
    while impacts < 2:
        v, w, before = simulation.v.copy(), closing(simulation), momentum()
        distance = 0.025 - np.abs(motor_offset(simulation))
        near = (distance < 2.0 * np.abs(w) * 1e-4 + 1e-9).any()
        simulation.step(np.zeros(2), h if near else 1e-4)
        if near and (np.abs(closing(simulation) - w) > 0.01).any():
            impacts += 1
            assert np.abs(simulation.v - v).max() > 0.005  # the impact changed the velocity
            assert momentum() == pytest.approx(before, abs=20.0 * h)  # ∂T/∂q acts during the step


# --- energy --------------------------------------------------------------------------------------

def test_no_energy_comes_or_goes():
    """Two links with every kind of friction, motors with inductance, and backlash."""
    arm = geared(
        rubbing(links(2), viscous=[1.0, 0.4], coulomb=[2.0, 0.8], static=[3.0, 1.2],
                stribeck_velocity=[0.05]),
        backlash=[0.02, 0.03], restitution=[0.5], resistance=[0.8], inductance=[4e-4],
        voltage_limit=[48.0], efficiency=[0.8])
    simulation = released(arm, (0.5, -0.4))
    start, energies, work, total = sum(simulation.energy), [], 0.0, 0.0
    for k in range(1000):
        t = 2e-3 * k
        goal = np.array([0.5 + 0.4 * np.sin(3.0 * t), -0.4 - 0.5 * np.sin(5.0 * t)])
        simulation.step(200.0 * (goal - simulation.q) - 15.0 * simulation.v, 2e-3)
        energies.append(sum(simulation.energy))
        total += abs(simulation.work - work)
        work = simulation.work
    scale = total + simulation.heat + np.ptp(energies)
    error = energies[-1] - start - simulation.work + simulation.heat
    print(f'work {work:.4f}, heat {simulation.heat:.4f}, scale {scale:.4f}, error {error:.3g} J')
    assert np.ptp(energies) > 10.0
    assert simulation.heat > 10.0
    assert abs(error) < 1e-6 * scale


# --- comparison with solutions in closed form ----------------------------------------------------

@pytest.mark.parametrize(('restitution', 'accuracy'), [(0.0, 1e-10), (0.8, 1e-8)])
def test_a_joint_under_a_servo_moves_as_solved_piece_by_piece(restitution, accuracy):
    """A PD law on the joint, with its effort held for each millisecond, oscillates in the gap."""
    viscous, gap, h = 0.5, 0.02, 1e-3
    simulation = released(geared(
        one_link(viscous), restitution=[restitution], backlash=[gap]))
    exact, worst = ExactJoint(viscous, 0.5 * gap, restitution), 0.0
    for k in range(1200):
        goal = 0.2 * np.sin(2.0 * np.pi * k * h)
        tau = 60.0 * (goal - exact.state[0]) - 3.0 * exact.state[1]
        simulation.step(np.array([tau]), h)
        exact.step(tau, h)
        motor = simulation.motor_state
        worst = max(worst, *np.abs([
            simulation.q[0] - exact.state[0], motor.position[0] - exact.state[2]]))
    print(f'{exact.impacts} impacts, {worst:.3g} rad apart')
    assert exact.impacts >= 4
    assert worst < accuracy


# --- the order of the method ---------------------------------------------------------------------


@pytest.mark.parametrize('restitution', [0.0, 0.5])
def test_events_do_not_cost_the_method_its_order(restitution):
    arm = geared(rubbing(links(2), viscous=[1.0, 0.4]), backlash=[0.02], restitution=[restitution])

    def run(step: float) -> FloatArray:
        simulation = released(arm, (0.4, 0.6), max_step=step)
        side = np.sign(motor_offset(simulation))
        simulation.step(np.array([-15.0, 4.0]), 0.64)
        assert (side * motor_offset(simulation) < 0.0).any()  # contact on the other side
        return np.concatenate([simulation.q, simulation.v])

    exact = run(5e-4)
    errors = np.array([np.abs(run(step) - exact).max() for step in (0.02, 0.01, 0.005)])
    assert (np.log2(errors[:-1] / errors[1:]) > 4.0).all(), errors


# --- rejections ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('changes', 'words'), [
    ({'backlash': [-0.01]}, "actuator.backlash of 'joint1' is -0.01, expected a number >= 0"),
    ({'backlash': [0.1, 0.1]}, 'actuator.backlash has 2 values, expected 1'),
    ({'restitution': [-0.1]}, r"actuator.restitution of 'joint1' is -0.1, expected .* in \[0, 1"),
    ({'restitution': [1.1]}, r"actuator.restitution of 'joint1' is 1.1, expected .* in \[0, 1\]"),
    ({'rotor_inertia': [0.0]},
     "actuator.rotor_inertia of 'joint1' is 0, expected a number > 0 where there is backlash"),
])
def test_invalid_values_are_rejected_by_name(changes, words):
    with pytest.raises(InvalidInputError, match=words):
        geared(one_link(), **changes)
