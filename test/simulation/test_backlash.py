# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Backlash in the simulated arm: gap, impacts, energy, an exact solution, convergence order."""

from collections.abc import Callable

import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from scipy.optimize import brentq
from simulated_arms import released

CONTACT_TIME = 2e-4
"""[s] within which the contact force must separate teeth that bounce."""
SLOW = 1e-3
"""Velocity [rad/s] below which the contact is kept."""


class ExactJoint:
    """
    The exact solution in segments: between events, exponentials and parabolas.

    A joint of inertia M [kg·m²] with friction F [N·m·s/rad], and its motor J on the joint side.

    Without contact, J θ̈ = τ and M q̈ = −F q̇; in contact, (M + J) q̈ = τ − F q̇.
    """

    def __init__(self, M: float, J: float, F: float, half_gap: float, restitution: float) -> None:
        self._M, self._J, self._F, self._b, self._e = M, J, F, half_gap, restitution
        self.q = self.v = self.theta = self.omega = 0.0
        self._side = 0.0
        """Side of the contact, 0 without contact."""
        self.impacts = self.separations = 0

    def step(self, tau: float, h: float) -> None:
        """Advance by h [s] with a constant motor effort."""
        while h > 0.0:
            h -= self._together(tau, h) if self._side else self._apart(tau, h)

    def _coast(self, tau: float, inertia: float, t: float) -> tuple[float, float]:
        """Return position and velocity of the joint after t [s]."""
        rate = self._F / inertia
        decay, last = np.exp(-rate * t), tau / self._F
        return (self.q + last * t + (self.v - last) * (1.0 - decay) / rate,
                last + (self.v - last) * decay)

    def _push(self, tau: float, v: float) -> float:
        """Return the contact torque [N·m]."""
        return self._side * (tau - self._J * (tau - self._F * v) / (self._M + self._J))

    def _together(self, tau: float, h: float) -> float:
        """Return the time until separation, at most h, and advance to it."""
        until, both = 0.0, self._M + self._J
        if self._push(tau, self.v) >= 0.0:
            until = first_below(lambda t: self._push(tau, self._coast(tau, both, t)[1]), h)
            self.q, self.v = self._coast(tau, both, until)
            self.theta, self.omega = self.q + self._side * self._b, self.v
        if until < h:
            self._side, self.separations = 0.0, self.separations + 1
        return until

    def _apart(self, tau: float, h: float) -> float:
        """Return the time until contact, at most h, and advance to it."""
        def motor(t: float) -> float:
            return self.theta + self.omega * t + 0.5 * tau / self._J * t * t

        until = first_below(
            lambda t: self._b - abs(motor(t) - self._coast(0.0, self._M, t)[0]), h)
        (self.q, self.v), self.theta = self._coast(0.0, self._M, until), motor(until)
        self.omega += tau / self._J * until
        if until < h:
            self._reach_contact(tau)
        return until

    def _reach_contact(self, tau: float) -> None:
        self._side, self.impacts = np.sign(self.theta - self.q), self.impacts + 1
        self.theta = self.q + self._side * self._b
        w, m = self.omega - self.v, self._M * self._J / (self._M + self._J)
        press = self._side * (tau + self._J * self._F * self.v / self._M)
        if abs(w) < SLOW or 2.0 * self._e * abs(w) * self._J < press * CONTACT_TIME:
            e = 0.0
        else:
            e = self._e
        self.v += (1.0 + e) * m * w / self._M
        self.omega -= (1.0 + e) * m * w / self._J
        if e == 0.0:
            self.omega = self.v
        else:
            self._side = 0.0


def first_below(f: Callable[[float], float], h: float) -> float:
    """Return the first time in [0, h] at which f becomes negative, or h; f(0) ≥ 0."""
    times = np.linspace(0.0, h, 65)
    below = [k for k in range(1, len(times)) if f(times[k]) < 0.0]
    if not below:
        return h
    early, late = times[below[0] - 1], times[below[0]]
    if early == 0.0:  # starts at the contact: search for the return to it
        early = 1e-9 * late
        if f(early) < 0.0:
            return 0.0
    return float(brentq(f, early, late, xtol=1e-15, rtol=1e-14))


M, J = 0.6, 0.2
"""Inertia of the one link, and of its motor on the joint side [kg·m²]."""
GAP = 0.1
"""[rad]"""


def geared(arm: ArmModel, **changes: list[float]) -> ArmModel:
    return arm.with_actuators(make_actuators(arm.joint_names, **{
        'torque_constant': [0.05], 'gear_ratio': [100.0], 'rotor_inertia': [J / 1e4],
        'backlash': [GAP], **changes}))


def one_link(**changes: list[float]) -> ArmModel:
    arm = load_arm(planar_arm_urdf([2.0], [1.0], [0.5], [0.1]), gravity=(0.0, 0.0, 0.0))
    return geared(arm, **changes)


def links(n: int, gravity: float = 9.81) -> ArmModel:
    """Return a planar arm of up to three links, without motors and friction."""
    masses, lengths = [5.0, 3.0, 1.0][:n], [1.0, 0.8, 0.5][:n]
    return load_arm(
        planar_arm_urdf(masses, lengths, [0.5, 0.4, 0.2][:n], [0.1, 0.05, 0.01][:n]),
        gravity=(0.0, 0.0, -gravity))


def rubbing(arm: ArmModel, **friction: list[float]) -> ArmModel:
    return arm.with_friction(make_friction(arm.joint_names, **friction))


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

@pytest.mark.parametrize('restitution', [0.0, 0.8, 1.0])
def test_teeth_that_meet_keep_momentum_and_lose_what_restitution_says(restitution):
    simulation = released(one_link(restitution=[restitution]))
    simulation.step(np.array([2.0]), 0.05)  # only the motor moves, inside the gap
    assert simulation.v.tolist() == [0.0]
    momentum, energy = J * simulation.motor_state.velocity[0], sum(simulation.energy)
    assert momentum == pytest.approx(2.0 * 0.05)
    m, impacts = M * J / (M + J), 0
    for _ in range(1000):
        before, heat = closing(simulation)[0], simulation.heat
        simulation.step(np.zeros(1), 1e-3)
        after = closing(simulation)[0]
        now = J * simulation.motor_state.velocity[0] + M * simulation.v[0]
        assert now == pytest.approx(momentum, abs=1e-9)
        if after == before:
            assert simulation.heat == heat
            continue
        impacts += 1
        lasting = abs(before) > 1e-3  # slower teeth stay in contact
        e = restitution if lasting else 0.0
        assert after == pytest.approx(-e * before, abs=1e-9)
        assert simulation.heat - heat == pytest.approx(
            0.5 * (1.0 - e * e) * m * before**2, abs=1e-12)
    assert impacts >= (1 if restitution == 0.0 else 2)
    assert sum(simulation.energy) + simulation.heat == pytest.approx(energy, abs=1e-12)
    if restitution == 1.0:
        assert simulation.heat == pytest.approx(0.0, abs=1e-15)


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
    simulation = released(rubbing(
        one_link(restitution=[restitution], backlash=[gap]), viscous=[viscous]))
    exact, worst = ExactJoint(M, J, viscous, 0.5 * gap, restitution), 0.0
    for k in range(1200):
        goal = 0.2 * np.sin(2.0 * np.pi * k * h)
        tau = 60.0 * (goal - exact.q) - 3.0 * exact.v
        simulation.step(np.array([tau]), h)
        exact.step(tau, h)
        motor = simulation.motor_state
        worst = max(worst, *np.abs([
            simulation.q[0] - exact.q, motor.position[0] - exact.theta]))
    print(f'{exact.impacts} meetings, {exact.separations} partings, {worst:.3g} rad apart')
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
        one_link(**changes)
