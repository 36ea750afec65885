# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Dynamics of robot arms described by a URDF: the joint torques that produce a motion.

This module exports the most frequently used names; each is imported at its first use. Other names
are in the subpackages: `robot_dynamics.model`, `robot_dynamics.control` and so on.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__: str

if TYPE_CHECKING:
    from robot_dynamics.control import ControlLaw as ControlLaw
    from robot_dynamics.control import Controller as Controller
    from robot_dynamics.control import ControllerOptions as ControllerOptions
    from robot_dynamics.control import make_gains as make_gains
    from robot_dynamics.exceptions import RobotDynamicsError as RobotDynamicsError
    from robot_dynamics.joints import make_actuators as make_actuators
    from robot_dynamics.joints import make_friction as make_friction
    from robot_dynamics.model import ArmDynamics as ArmDynamics
    from robot_dynamics.model import ArmModel as ArmModel
    from robot_dynamics.model import load_arm as load_arm
    from robot_dynamics.model import make_payload as make_payload
    from robot_dynamics.model import Payload as Payload
    from robot_dynamics.model_check import check_model as check_model
    from robot_dynamics.simulation import ArmSimulation as ArmSimulation
    from robot_dynamics.simulation import ArmState as ArmState
    from robot_dynamics.trajectories import JointTrajectory as JointTrajectory
    from robot_dynamics.trajectories import make_trajectory as make_trajectory

_NAMES = {
    'control': ('ControlLaw', 'Controller', 'ControllerOptions', 'make_gains'),
    'exceptions': ('RobotDynamicsError',),
    'joints': ('make_actuators', 'make_friction'),
    'model': ('ArmDynamics', 'ArmModel', 'load_arm', 'make_payload', 'Payload'),
    'model_check': ('check_model',),
    'simulation': ('ArmSimulation', 'ArmState'),
    'trajectories': ('JointTrajectory', 'make_trajectory'),
}
_MODULES = {name: f'{__name__}.{module}' for module, names in _NAMES.items() for name in names}
"""The module of each name."""
__all__ = sorted(_MODULES)


def _version() -> str:
    """Return the version in package.xml of a checkout, or else that of the installation."""
    from importlib.metadata import version
    from pathlib import Path
    import re
    manifest = Path(__file__).resolve().parents[1] / 'package.xml'
    if not manifest.exists():
        return version(__name__)
    return str(re.findall('<version>(.+)</version>', manifest.read_text(encoding='utf-8'))[0])


def __getattr__(name: str) -> object:
    if name == '__version__':
        return _version()
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
