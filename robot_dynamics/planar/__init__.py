# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
