# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Arms without friction, and motions, for the tests of the control loop."""

from functools import cache

from lock_step_loop import directions, LockStep, middle, smooth_arm, Trace
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model import ArmModel, make_payload

Q = np.array([0.8, 0.5])
AT_REST = 1e-3
"""[rad/s]"""


@cache
def arm_named(name: str) -> ArmModel:
    return smooth_arm(name)


def place(name: str) -> FloatArray:
    return Q if name == 'default' else middle(arm_named(name))


def loaded(mass: float, name: str = 'default', link: str = 'tool0') -> ArmModel:
    return arm_named(name).with_payloads([make_payload(link, mass)])


def in_motion(name: str = 'default', **more: float) -> LockStep:
    """Return an arm in a motion of all joints at about half of their velocity limits."""
    one = LockStep(arm_named(name), q=place(name), **more)  # type: ignore[arg-type]
    one.run(0.1)
    one.follow(one.q + directions(len(one.q)))
    assert one.run(0.5).speed[-1] > 0.5
    return one


def rests(trace: Trace) -> bool:
    return bool(trace.last(0.3).speed.max() < AT_REST)


def with_command(one: LockStep, command: str) -> None:
    """Set `command` as the node does, with unchanged other options."""
    options, supervisor = one.loop.controller.options, one.loop.supervisor
    one.loop.set_options(
        ControllerOptions(**{**vars(options), 'command': command}),
        supervisor.limiter.limits, supervisor.options)
