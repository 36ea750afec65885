# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A control law of your own: a spring and a damper at each joint; `~/push` adds an effort.

    python docs/examples/spring.py

prints an effort. For the node, a package declares the law in its setup.py, and `command:=spring`
selects it:

    entry_points={'robot_dynamics.control_laws': ['spring = my_package.spring:Spring']},
"""

import numpy as np
from robot_dynamics import load_arm
from robot_dynamics.control.laws import ControlLaw, LawParameter, LAWS, LawTopic
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.planar import default_arm_urdf


class Spring(ControlLaw):
    """The law τ = g(q) + K e + D ė + the effort of ~/push."""

    PARAMETERS = (
        LawParameter('spring.stiffness', (200.0,), 'Stiffness [N·m/rad].'),
        LawParameter('spring.damping', (30.0,), 'Damping [N·m·s/rad].'))

    def __init__(self, feedback, options):
        """Take the parameters, arrays (n,)."""
        self.K, self.D = options.parameters.values()
        self.push = 0.0

    def take_push(self, message):
        """Take a message of `~/push`, between two states."""
        self.push = np.array(message.data)

    TOPICS = (LawTopic('~/push', 'std_msgs/msg/Float64MultiArray', take_push),)

    def effort(self, state):
        """Return the effort (n,) of a state; `scale` keeps the loop stable at slow states."""
        e, e_dot, s = state.position_error, state.velocity_error, self.scale
        return state.gravity + s * s * self.K * e + s * self.D * e_dot + self.push

    def closed_loop(self, M):
        """Return M⁻¹K [1/s²] and M⁻¹D [1/s] of the error dynamics ë + M⁻¹D ė + M⁻¹K e = 0."""
        return np.linalg.solve(M, np.diag(self.K)), np.linalg.solve(M, np.diag(self.D))


if __name__ == '__main__':
    LAWS['spring'] = Spring
    loop = ControlLoop.of_arm(
        load_arm(default_arm_urdf()), command='spring', parameters={'spring.stiffness': 100.0})
    print(loop.answer(1_000_000_000, np.array([0.8, 0.5]), np.zeros(2)).effort)  # stamp [ns], q, v
