# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Forward dynamics in time: integration, backlash contacts, motors, the simulated arm."""

from robot_dynamics.simulation.arm_simulation import ArmSimulation, ArmState
from robot_dynamics.simulation.plant import SimulatedRobot

__all__ = [
    'ArmSimulation',
    'ArmState',
    'SimulatedRobot',
]
