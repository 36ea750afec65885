# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What `dynamics` serves: one object, which a change of model or parameters replaces."""

from dataclasses import dataclass
import time

from robot_dynamics.control.feed_forward import FeedForward
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.drive_status import DriveStatus
from robot_dynamics.ros.dynamics.external_effort_fault import ExternalEffortFault
from robot_dynamics.ros.middleware.cdr_templates import (
    array_template,
    state_template,
    terms_template,
)
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.middleware.state_assembly import StateAssembly
from robot_dynamics.ros.parameters.declared_parameters import Values


class ArmMessages:
    """Reads the joint states of one arm, and writes its messages; for the control path."""

    def __init__(self, joint_names: tuple[str, ...], is_embedded: bool) -> None:
        """With `is_embedded` states with other joints are errors (`StateAssembly`)."""
        self.joint_count = len(joint_names)
        self.assembly = StateAssembly(joint_names, is_embedded)
        self.reader = JointStateReader(joint_names)
        self.foreign_joints = ''
        """Reason why the embedded arm is not served, empty if it is."""
        self.is_open, self.used_at = not is_embedded, time.monotonic()
        """Whether no description is awaited, and there are no foreign joints."""
        self.effort = state_template(joint_names, has_motion=False)
        self.bare_command = array_template(len(joint_names))
        self.motion = state_template(joint_names, has_effort=False)
        self.drive_command = state_template(joint_names)
        self.terms = terms_template(joint_names)


@dataclass(frozen=True)
class Served:
    """
    The arm that is served, and what was made for it.

    It is replaced between two states. A reader takes one reference to it, and uses only that.
    """

    loop: ControlLoop
    """Arm, load, law, limits and references."""
    values: Values
    """The parameters."""
    drives: DriveStatus
    external: ExternalEffortFault
    feed_forward: FeedForward
    messages: ArmMessages

    @property
    def arm(self) -> ArmModel:
        """The arm without loads."""
        return self.loop.controller.arm
