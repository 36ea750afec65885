# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control laws by the values of the parameter `command`, of this package and of others."""

from collections.abc import Mapping
from functools import cache
from importlib import metadata
from typing import Any

from robot_dynamics.control.laws.cartesian_impedance import CartesianImpedance
from robot_dynamics.control.laws.computed_torque import ComputedTorque
from robot_dynamics.control.laws.control_law import ControlLaw, GravityCompensation
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.hand_guiding import HandGuiding
from robot_dynamics.control.laws.joint_impedance import JointImpedance
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel

LAWS: dict[str, type[ControlLaw]] = {
    'cartesian_impedance': CartesianImpedance,
    'computed_torque': ComputedTorque,
    'gravity_compensation': GravityCompensation,
    'hand_guiding': HandGuiding,
    'joint_impedance': JointImpedance,
}
"""The control laws of this package."""
NO_COMMAND = 'none'
ENTRY_POINTS = 'robot_dynamics.control_laws'
"""Group of the entry points of further laws."""


def command_modes() -> tuple[str, ...]:
    """Return the values of the parameter `command`: all laws, and `none`."""
    return (*LAWS, *sorted(further_laws().keys() - LAWS.keys()), NO_COMMAND)


@cache
def further_laws() -> Mapping[str, type[ControlLaw] | str]:
    """Return the laws of other packages by name, or why one cannot be loaded."""
    found: dict[str, type[ControlLaw] | str] = {}
    for one in metadata.entry_points(group=ENTRY_POINTS):
        try:
            law = one.load()
            if not issubclass(law, ControlLaw):
                raise TypeError(f'{law!r} is not a subclass of ControlLaw')
            found[one.name] = law
        except Exception as error:  # any error of another package
            found[one.name] = (
                f'command is {one.name!r}, but the control law of that entry point cannot be '
                f'loaded: {error!r}')
    return found


def all_laws() -> Mapping[str, type[ControlLaw]]:
    """Return the laws by name, without those that cannot be loaded."""
    return {**{name: law for name, law in further_laws().items() if not isinstance(law, str)},
            **LAWS}


def declared(what: str) -> tuple[Any, ...]:
    """Return the PARAMETERS, TOPICS or REFERENCES (`ControlLaw`) of all laws, each once."""
    return tuple(dict.fromkeys(
        one for law in all_laws().values() for one in getattr(law, what)))


def make_law(arm: ArmModel, feedback: ErrorFeedback, options: ControllerOptions) -> ControlLaw:
    """Return the law that `options.command` names; raise InvalidInputError."""
    name = options.command
    law = LAWS.get(name) or further_laws().get(
        name, f'command is {name!r}, expected one of {list(command_modes())}')
    if isinstance(law, str):
        raise InvalidInputError(law)
    return law(feedback, law.options(arm, options))
