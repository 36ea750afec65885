# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Planar chains for the tests: the example of the page, random chains, as a URDF, and rotated."""

import math
from xml.etree import ElementTree

import numpy as np
import numpy.testing as npt
from robot_dynamics.planar import planar_arm_urdf, PlanarChain, PlanarTwoLink

ARM = PlanarTwoLink()
Q = np.array([math.pi / 4, math.pi / 6])
V = np.array([0.5, 0.3])
A = np.array([0.1, 0.2])
"""The worked example of docs/planar_arm.md."""
PRINTED = 5e-9
"""Half of the last of the eight decimals of the example."""


def random_chain(seed, n):
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.2, 1.5, n)
    return PlanarChain(
        rng.uniform(0.5, 5.0, n), lengths, lengths * rng.uniform(0.1, 1.0, n),
        rng.uniform(0.01, 0.5, n))


def urdf_of(chain, **more):
    return planar_arm_urdf(
        chain.masses, chain.lengths, chain.com_distances, chain.inertias, **more)


def assert_close(actual, expected, atol):
    """Compare only by the absolute difference, because `atol` contains the scale of the arm."""
    npt.assert_allclose(actual, expected, rtol=0.0, atol=atol)


def first_derivative(function, step=1e-4):
    """Return the derivative at 0 from four points: their errors cancel to fourth order."""
    near = (function(step) - function(-step)) / (2.0 * step)
    far = (function(2.0 * step) - function(-2.0 * step)) / (4.0 * step)
    return (4.0 * near - far) / 3.0


def on_a_turned_base(urdf, rpy):
    """Return the URDF with the arm on a base that is rotated by these angles [rad]."""
    robot = ElementTree.fromstring(urdf)
    robot.find('joint/origin').set('rpy', ' '.join(str(angle) for angle in rpy))
    return ElementTree.tostring(robot, encoding='unicode')


def with_reversed_joint(urdf, name):
    """Return the URDF with a joint of the opposite positive direction."""
    robot = ElementTree.fromstring(urdf)
    axis = robot.find(f'joint[@name="{name}"]/axis')
    axis.set('xyz', ' '.join(str(-float(value)) for value in axis.get('xyz').split()))
    return ElementTree.tostring(robot, encoding='unicode')
