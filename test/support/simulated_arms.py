# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Simulated arms that several modules of tests use."""

from typing import Any

from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation

MASS, LENGTH, COM, INERTIA = 2.0, 1.0, 0.5, 0.1
ABOUT_JOINT = INERTIA + MASS * COM**2
"""Of a link [SI units]: mass, length, distance of the COM, inertia about COM and joint."""


def two_link() -> ArmModel:
    """Return the default arm."""
    return load_arm(default_arm_urdf())


def default_dynamics() -> ArmDynamics:
    """Return the dynamics of the default arm."""
    return ArmDynamics(two_link())


def one_link(viscous: float = 0.0, coulomb: float = 0.0) -> ArmModel:
    """Return an arm of one link without gravity, with this friction [N·m·s/rad, N·m]."""
    return load_arm(
        planar_arm_urdf([MASS], [LENGTH], [COM], [INERTIA], [viscous], [coulomb]),
        gravity=(0.0, 0.0, 0.0))


def released(arm: ArmModel, *start: Any, **more: Any) -> ArmSimulation:
    """Return a simulation with released brakes."""
    simulation = ArmSimulation(arm, *start, **more)
    simulation.release()
    return simulation
