# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The planar arm derived by hand, for teaching: Lagrange, Newton-Euler, and its URDF."""

from robot_dynamics.planar.chain import newton_euler, NewtonEulerPass, PlanarChain
from robot_dynamics.planar.two_link import (
    christoffel_symbols,
    coriolis_matrix,
    coriolis_vector,
    Energies,
    energies,
    forward_dynamics,
    forward_kinematics,
    gravity_vector,
    inverse_dynamics,
    kinetic_energy,
    mass_matrix,
    nonlinear_terms,
    PlanarPositions,
    PlanarTwoLink,
    potential_energy,
)
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf

__all__ = [
    'christoffel_symbols',
    'coriolis_matrix',
    'coriolis_vector',
    'default_arm_urdf',
    'energies',
    'Energies',
    'forward_dynamics',
    'forward_kinematics',
    'gravity_vector',
    'inverse_dynamics',
    'kinetic_energy',
    'mass_matrix',
    'newton_euler',
    'NewtonEulerPass',
    'nonlinear_terms',
    'planar_arm_urdf',
    'PlanarChain',
    'PlanarPositions',
    'PlanarTwoLink',
    'potential_energy',
]
