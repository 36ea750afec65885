# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The status `drive` of `dynamics`: what the drives do, instead of what the model says."""

from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.monitoring.drive_verdicts import AGREES, UNKNOWN, Verdict
from robot_dynamics.monitoring.external_effort import joint_effort
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader

NAME = 'drive'


class DriveStatus:
    """The drive check of one loop: takes the reports, and logs and returns the verdicts."""

    def __init__(
        self, node: Node, loop: ControlLoop, convention: EffortConvention,
        is_heard: Callable[[], bool], has_position_drives: Callable[[], bool],
    ) -> None:
        """
        Check the drives of a loop.

        `is_heard` returns whether the command has a subscriber, `has_position_drives` whether
        drives with their own stiffness are commanded, which are not checked.
        """
        self._node, self._loop, self._convention = node, loop, convention
        self._is_heard, self._has_position_drives = is_heard, has_position_drives
        self._logged: set[tuple[str, str]] = set()
        self._obstacle = ''

    def take(self, reader: JointStateReader, state: SensedState, output: ControlOutput) -> None:
        """
        Take the efforts that a state reports, after its command; an error drops only them.

        Once per sample, if it `wants_report`.
        """
        samples = self._loop.drives.samples
        samples.wants_report = False
        self._loop.is_heard = self._is_heard() and not self._has_position_drives()
        convention = self._convention
        if convention.measured_effort == 'none':
            return
        try:
            measured = reader.effort(state)
            if measured is not None:
                samples.report(joint_effort(
                    self._loop.controller.arm, convention, measured, output.state.v,
                    output.robot_gravity if convention.lacks_gravity else np.zeros_like(measured)))
            self._obstacle = ''
        except RobotDynamicsError as error:
            self._obstacle = f'no measured effort: {error}'

    def status(self) -> Status:
        """Return the verdicts for the diagnostics; a wrong drive is logged once."""
        names = self._loop.controller.arm.joint_names
        if self._has_position_drives():
            return Status(NAME, OK, f'{UNKNOWN}; position drives are commanded', {})
        verdicts = dict(zip(names, self._loop.drives.verdicts()))
        wrong = {name: one for name, one in verdicts.items() if one.is_wrong}
        for name, one in wrong.items():
            if (name, one.verdict) not in self._logged:
                self._logged.add((name, one.verdict))
                self._node.get_logger().warning(f'Drive of {name!r}: {_text(one)}')
        return Status(
            NAME, WARN if wrong else OK, self._message(verdicts, wrong),
            {name: _text(one) for name, one in verdicts.items()}, tuple(
                one.verdict for one in wrong.values()))

    def _message(self, verdicts: dict[str, Verdict], wrong: dict[str, Verdict]) -> str:
        if wrong:
            name, one = next(iter(wrong.items()))
            others = [other for other in wrong if other != name]
            return f'{name}: {_text(one)}' + (f' ({", ".join(others)} too)' if others else '')
        if all(one.verdict == AGREES for one in verdicts.values()):
            return AGREES
        unknown = [name for name, one in verdicts.items() if one.verdict == UNKNOWN]
        words = f'{UNKNOWN}: {", ".join(unknown)}'
        return '; '.join(filter(None, (words, self._obstacle)))


def _text(verdict: Verdict) -> str:
    return f'{verdict.verdict}; {verdict.sentence}'
