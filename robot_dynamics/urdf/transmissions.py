# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Gear ratios from the transmissions of a URDF.

A transmission of one joint may state its reduction, motor revolutions per joint revolution, under
`<actuator>`, `<joint>` or itself: as `mechanicalReduction` (ROS 1; ros_control,
`transmission_interface`), or, inside `<ros2_control>`, as `mechanical_reduction` (ros2_control). A
transmission of several joints, such as a differential, couples the joints, so that no joint has a
separate ratio: it is skipped.
"""

from collections.abc import Mapping
import math
import xml.etree.ElementTree as ElementTree

from robot_dynamics.exceptions import ModelError

Reductions = Mapping[str, tuple[str, ...]]
"""The unchecked texts of the reductions of each joint."""

_TRANSMISSIONS = ('transmission', 'ros2_control/transmission')
_TAGS = ('mechanicalReduction', 'mechanical_reduction')
_PLACES = ('', 'actuator/', 'joint/')


def read_reductions(robot: ElementTree.Element) -> dict[str, tuple[str, ...]]:
    """
    Return the reductions that the transmissions of a `<robot>` state, by joint.

    The texts are not checked here: an invalid reduction that is not used must cause no error.
    """
    reductions: dict[str, tuple[str, ...]] = {}
    for path in _TRANSMISSIONS:
        for transmission in robot.findall(path):
            joints = {joint.get('name') or '' for joint in transmission.findall('joint')}
            if len(joints) == 1:
                name = joints.pop()
                reductions[name] = reductions.get(name, ()) + tuple(
                    (element.text or '').strip() for place in _PLACES for tag in _TAGS
                    for element in transmission.findall(place + tag))
    return reductions


def gear_ratio(joint: str, reductions: Reductions) -> float | None:
    """
    Return the gear ratio N of a joint, None if no transmission states one.

    Raises ModelError, naming joint and text, if the ratio is zero or not a number, or if several
    ratios differ, for example those of two motors with separate gears.
    """
    ratios = {_number(joint, text) for text in reductions.get(joint, ())}
    if len(ratios) > 1:
        raise ModelError(
            f'robot_description: the transmissions of joint {joint!r} state the reductions '
            f'{sorted(ratios)}, expected one for all its actuators')
    return ratios.pop() if ratios else None


def _number(joint: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if value == 0.0 or not math.isfinite(value):
        raise ModelError(
            f'robot_description: transmission of joint {joint!r}: mechanicalReduction is '
            f'{text!r}, expected a number other than 0')
    return value
