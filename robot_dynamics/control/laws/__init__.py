# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Control laws: computed torque, impedances, gravity compensation, and those of users."""

from robot_dynamics.control.laws.cartesian import Cartesian, make_cartesian
from robot_dynamics.control.laws.cartesian_impedance import CartesianImpedance
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import (
    ControlLaw,
    GravityCompensation,
    LawInput,
    LawOutput,
)
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Gains, make_gains
from robot_dynamics.control.laws.guiding import Guiding, make_guiding
from robot_dynamics.control.laws.hand_guiding import HandGuiding
from robot_dynamics.control.laws.impedance import Impedance, make_impedance
from robot_dynamics.control.laws.joint_impedance import JointImpedance

__all__ = [
    'Cartesian',
    'CartesianImpedance',
    'ComputedTorque',
    'ControlLaw',
    'ErrorFeedback',
    'Gains',
    'GravityCompensation',
    'Guiding',
    'HandGuiding',
    'Impedance',
    'JointImpedance',
    'LawInput',
    'LawOutput',
    'make_cartesian',
    'make_gains',
    'make_guiding',
    'make_impedance',
]
