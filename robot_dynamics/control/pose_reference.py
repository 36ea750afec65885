# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A pose of the frame of the Cartesian impedance, as a set-point of the joints."""

from collections.abc import Mapping
from typing import Any, TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.control.laws.control_law import LawParameter
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, last_link
from robot_dynamics.task_space.inverse_kinematics import joints_at
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.validation import check_vector, is_empty, LARGEST_VALUE

if TYPE_CHECKING:  # the controller imports the laws
    from robot_dynamics.control.controller import Controller

NORMS = (0.99, 1.01)
"""Range of the norm of a quaternion."""
FRAME = LawParameter('cartesian.frame', '', (
    'Link whose origin cartesian_impedance and ~/pose_reference control. If empty, the last link '
    'that most joints move.'))


def frame_name(arm: ArmModel, parameters: Mapping[str, Any]) -> str:
    """Return the frame that parameters name; raise InvalidInputError if the arm lacks it."""
    name = parameters.get(FRAME.name) or last_link(arm)
    arm.link_frame(name, FRAME.name)
    return name


def follow_pose(controller: 'Controller', message: Any) -> JointTrajectory:
    """Return the set-point of a message PoseStamped; raise InvalidInputError."""
    p, turn = message.pose.position, message.pose.orientation
    return pose_set_point(
        controller, message.header.frame_id, [p.x, p.y, p.z], [turn.x, turn.y, turn.z, turn.w])


def pose_set_point(
    controller: 'Controller', frame_id: str, translation: npt.ArrayLike,
    orientation: npt.ArrayLike = (),
) -> JointTrajectory:
    """
    Return the set-point near the present reference, or state, at which the frame has a pose.

    `translation` (3,) [m] and `orientation`, a quaternion x y z w, are given in the frame of a
    link that no joint moves. An empty orientation, or one of zeros, keeps the present one. The
    frame is that of the parameter FRAME. Raises InvalidInputError for another frame, for values
    that are no pose, without a state, and for a pose out of reach.
    """
    arm, state = controller.arm, controller.state
    fixed = [name for name in arm.link_names if arm.link_frame(name).parentJoint == 0]
    if frame_id not in fixed:
        raise InvalidInputError(
            f'header.frame_id is {frame_id!r}, expected one of the links that no joint moves: '
            f'{fixed}')
    base = arm.link_frame(frame_id).placement
    p = check_vector('pose.position', translation, 3, ('x', 'y', 'z'), LARGEST_VALUE)
    turn = np.zeros(4) if is_empty(orientation) else check_vector(
        'pose.orientation', orientation, 4, ('x', 'y', 'z', 'w'), LARGEST_VALUE)
    reference = controller.reference
    if state is None:
        raise InvalidInputError(
            'no joint state has been received, so that there is no pose to start from')
    start = state[1] if reference is None else reference.position
    kinematics = FrameKinematics(arm, frame_name(arm, controller.options.parameters))
    norm = float(np.linalg.norm(turn))
    if norm == 0.0:
        R = kinematics.pose(start)[1]
    elif NORMS[0] <= norm <= NORMS[1]:
        R = base.rotation @ pin.Quaternion(turn / norm).matrix()
    else:
        raise InvalidInputError(f'pose.orientation has the norm {norm:g}, expected 1, or 0')
    goal = joints_at(arm, kinematics, start, base.act(p), R)
    return make_trajectory(arm.joint_names, [0.0], [goal], (), (), arm.joint_names)
