# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Simulated arms that several modules of tests use."""

from collections.abc import Sequence
from typing import Any

from one_joint_arm import arm_of, inertial
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model import ArmDynamics, ArmModel, load_arm
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


def three_links() -> ArmModel:
    """Return a planar arm of three links, without friction."""
    return load_arm(planar_arm_urdf(
        [4.0, 2.0, 1.0], [0.8, 0.6, 0.4], [0.4, 0.3, 0.2], [0.2, 0.06, 0.02]))


def rubbing(arm: ArmModel, **friction: Any) -> ArmModel:
    return arm.with_friction(make_friction(arm.joint_names, **friction))


def block(mass: float, axis: Sequence[float] = (1.0, 0.0, 0.0), **friction: Any) -> ArmModel:
    """Return a mass [kg] on a rail along an axis, with this friction."""
    return rubbing(load_arm(arm_of(
        inertial(mass, (1.0, 1.0, 1.0)), '<limit lower="-100" upper="100"/>', 'prismatic',
        axis=' '.join(map(str, axis)), geometry='')), **friction)


def released(arm: ArmModel, *start: Any, **more: Any) -> ArmSimulation:
    """Return a simulation with released brakes."""
    simulation = ArmSimulation(arm, *start, **more)
    simulation.release()
    return simulation
