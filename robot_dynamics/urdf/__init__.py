# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""URDF documents: reading, validation, inertias and meshes."""

from robot_dynamics.urdf.description_file import read_description
from robot_dynamics.urdf.parser import parse_urdf, UrdfJoint, UrdfRobot

__all__ = [
    'parse_urdf',
    'read_description',
    'UrdfJoint',
    'UrdfRobot',
]
