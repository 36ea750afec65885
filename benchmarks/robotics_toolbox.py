# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The Robotics Toolbox for Python, with the same arm as URDF and as DH parameters."""

import importlib
import io
from typing import Any

from benchmarks.chains import chain_urdf, ChainLink, joint_frames, modified_dh
from benchmarks.engine_calls import Calls, GRAVITY, named, quiet
import numpy as np


def robotics_toolbox(links: list[ChainLink]) -> Calls:
    """Return the calls of the Robotics Toolbox for a URDF, which it computes in Python."""
    toolbox = _toolbox()
    with quiet():
        reader = importlib.import_module('roboticstoolbox.models.URDF.URDFRobot')
    elements, name, _ = reader.URDF_file(io.StringIO(chain_urdf(links)))
    robot = toolbox.Robot(elements, name=name)
    return _toolbox_calls('URDF', robot)


def robotics_toolbox_dh(links: list[ChainLink]) -> Calls:
    """
    Return the calls of the Robotics Toolbox for DH parameters, which it computes in C++.

    The other quantities call its inverse dynamics from Python, once or for several states.
    """
    toolbox = _toolbox()
    frames, parameters = modified_dh(links)
    dh_links = []
    for link, joint, frame, (alpha, a, offset, d) in zip(
            links, joint_frames(links), frames, parameters):
        in_frame = np.linalg.solve(frame, joint)
        rotation = in_frame[:3, :3]
        dh_links.append(toolbox.RevoluteMDH(
            alpha=alpha, a=a, offset=offset, d=d, m=link.mass,
            r=rotation @ link.com + in_frame[:3, 3], I=rotation @ link.inertia @ rotation.T))
    robot = toolbox.DHRobot(
        dh_links, base=importlib.import_module('spatialmath').SE3(frames[0], check=False),
        gravity=GRAVITY)
    return _toolbox_calls('DH', robot)


def _toolbox() -> Any:
    with quiet():
        return importlib.import_module('roboticstoolbox')


def _toolbox_calls(model: str, robot: Any) -> Calls:
    return Calls(
        f'{named("Robotics Toolbox", "roboticstoolbox-python")}, {model}', robot.rne,
        robot.gravload, robot.inertia, robot.accel)
