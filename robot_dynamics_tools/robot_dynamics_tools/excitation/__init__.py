# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Excitation trajectories for identification, and the motion of the demo."""

from robot_dynamics_tools.excitation.demo_motion import make_reference_motion
from robot_dynamics_tools.excitation.excitation import find_excitation

__all__ = ['find_excitation', 'make_reference_motion']
