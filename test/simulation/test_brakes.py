# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Brakes that engage on a moving arm: the arm stops, and its kinetic energy becomes heat."""

import numpy as np
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from simulated_arms import released

START = (0.8, 0.5)
REFLECTED_INERTIA = 0.2
"""Of each motor on its joint [kg·m²]."""


def bare() -> ArmModel:
    return load_arm(default_arm_urdf())


def rubbing() -> ArmModel:
    arm = bare()
    return arm.with_friction(make_friction(
        arm.joint_names, viscous=[1.0, 0.4], coulomb=[2.0, 0.8], static=[3.0, 1.2],
        stribeck_velocity=[0.05]))


def driven(**changes: list[float]) -> ArmModel:
    """Return an arm whose motors have inductance: their current is a state variable."""
    arm = rubbing()
    return arm.with_actuators(make_actuators(arm.joint_names, **{
        'torque_constant': [0.05], 'gear_ratio': [100.0], 'resistance': [0.8],
        'inductance': [4e-4], 'rotor_inertia': [REFLECTED_INERTIA / 1e4], **changes}))


def with_backlash() -> ArmModel:
    return driven(backlash=[0.3], restitution=[0.5])


def moving(arm: ArmModel) -> ArmSimulation:
    """Return an arm that moves down after a fall and a push."""
    simulation = released(arm, START)
    simulation.step(np.array([20.0, -8.0]), 0.1)
    assert np.abs(simulation.v).min() > 0.1
    return simulation


def test_every_joint_and_motor_stops_in_place():
    simulation = moving(with_backlash())
    # a motor within its gap moves on its own
    assert np.abs(simulation.motor_state.velocity - simulation.v).max() > 0.1
    q, theta = simulation.state.position, simulation.motor_state.position
    simulation.brake()
    for _ in range(3):
        assert simulation.braked
        for state, position in ((simulation.state, q), (simulation.motor_state, theta)):
            assert state.position.tolist() == position.tolist()
            assert state.velocity.tolist() == [0.0, 0.0]
        assert simulation.effort.tolist() == [0.0, 0.0]
        simulation.wait(0.1, [ExternalWrench('tool0', np.array([50.0, 0.0, 0.0]), np.zeros(3))])


@pytest.mark.parametrize('make_arm', [rubbing, with_backlash])
def test_the_motion_of_links_and_rotors_becomes_heat(make_arm):
    simulation = moving(make_arm())
    v, omega = simulation.v, simulation.motor_state.velocity
    rotors = REFLECTED_INERTIA if simulation.arm.actuators is not None else 0.0
    links = ArmDynamics(bare()).rigid_body.mass_matrix(simulation.q)
    expected = 0.5 * float(v @ links @ v + rotors * omega @ omega)
    (kinetic, potential), heat, work = simulation.energy, simulation.heat, simulation.work
    simulation.brake()
    assert simulation.heat - heat == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(kinetic, rel=1e-12)
    assert simulation.energy == (0.0, potential)
    assert simulation.work == work


def test_it_continues_like_an_arm_that_starts_there():
    """At rest, with its motors without current and with initial friction states."""
    simulation = moving(driven())
    simulation.brake()
    twin = ArmSimulation(driven(), simulation.q)
    for arm in (simulation, twin):
        arm.release()
        arm.step(np.array([5.0, -2.0]), 0.05)
    assert simulation.q.tolist() == twin.q.tolist()
    assert simulation.v.tolist() == twin.v.tolist()
    assert simulation.effort.tolist() == twin.effort.tolist()


def test_brakes_that_are_closed_already_change_nothing():
    simulation = ArmSimulation(bare(), START, (0.3, -0.2))  # to be released in motion
    simulation.brake()
    assert simulation.heat == 0.0
    assert simulation.v.tolist() == [0.3, -0.2]
    simulation.release()
    simulation.brake()
    heat = simulation.heat
    simulation.brake()
    assert simulation.heat == heat > 0.0
