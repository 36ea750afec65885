# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Tools of robot_dynamics: recordings, identification, calibration, pictures, viewer, demo.

This module exports the most frequently used names; each is imported at its first use. Other names
are in the subpackages: `robot_dynamics_tools.recordings` and so on.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robot_dynamics_tools.analysis import analyze_recording as analyze_recording
    from robot_dynamics_tools.excitation import find_excitation as find_excitation
    from robot_dynamics_tools.gravity_calibration import (
        calibrate_recordings as calibrate_recordings,
    )
    from robot_dynamics_tools.identification import identify as identify
    from robot_dynamics_tools.identification import identify_bags as identify_bags
    from robot_dynamics_tools.recordings import find_recordings as find_recordings
    from robot_dynamics_tools.recordings import Recording as Recording
    from robot_dynamics_tools.recordings import RecordingWriter as RecordingWriter

_NAMES = {
    'analysis': ('analyze_recording',),
    'excitation': ('find_excitation',),
    'gravity_calibration': ('calibrate_recordings',),
    'identification': ('identify', 'identify_bags'),
    'recordings': ('find_recordings', 'Recording', 'RecordingWriter'),
}
_MODULES = {name: f'{__name__}.{module}' for module, names in _NAMES.items() for name in names}
"""The module of each name."""
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
