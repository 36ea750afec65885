# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The effort check of `dynamics`, which runs after the control path until it has a verdict."""

from rclpy.node import Node
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.monitoring import gravity_check
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader

NAME = 'effort check'


class EffortCheck:
    """
    Watches joint states until a static hold shows whether the robot compensates gravity.

    The thread of the control path calls `look`; any thread may call `status`.
    """

    def __init__(self, node: Node, arm: ArmModel, convention: EffortConvention) -> None:
        """Finish at once if there is no measured effort."""
        self._node, self._names, self._convention = node, arm.joint_names, convention
        self._check = gravity_check.GravityCheck(
            convention, arm.friction, arm.actuators, arm.is_continuous,
            arm.drive, arm.report)
        self._command: FloatArray | None = None
        self._said: set[str] = {gravity_check.STILL}
        self._verdict: gravity_check.GravityVerdict | None = None
        self._words = gravity_check.STILL
        self.done = False
        if convention.measured_effort == 'none':
            self._finish(f"{gravity_check.NO_EFFORT} (measured_effort is 'none')")

    def lack_effort(self) -> None:
        """Note that the joint states have no effort."""
        if not self.done:
            self._wait(f'{gravity_check.NO_EFFORT} in the joint states')

    def add_state(
        self, reader: JointStateReader, message: SensedState, q: FloatArray,
        gravity: FloatArray, command: FloatArray | None,
    ) -> None:
        """
        Take a state and the command for it, None if there is no command or no subscriber.

        The active command at a state is the command for the state before. An invalid effort
        never drops the state.
        """
        in_force, self._command = self._command, command
        try:
            effort = reader.effort(message)
        except RobotDynamicsError as error:
            self._wait(f'{gravity_check.NO_EFFORT}: {error}')
            return
        if effort is None:
            return
        try:
            verdict = self._check.add(message.stamp_ns, q, effort, in_force, gravity)
        except Exception as error:  # an error of the check must not stop the control path
            self._node.get_logger().error(f'The effort check failed: {error!r}')
            self._finish(f'failed: {error!r}')
            return
        if verdict is None:
            self._wait(self._check.waiting)
        else:
            self._conclude(verdict)

    def status(self) -> Status:
        """Return the condition that the check waits for, or its verdict, for the diagnostics."""
        verdict = self._verdict
        if verdict is None:
            return Status(NAME, OK, self._words, {})
        return Status(
            NAME, OK if verdict.agrees else WARN, self._words,
            {'k': f'{verdict.ratio:.3f}', 'expected k': f'{verdict.expected:.0f}',
             'tolerance': f'{verdict.tolerance:.3f}'})

    def _wait(self, reason: str) -> None:
        self._words = reason
        if reason not in self._said:
            self._said.add(reason)
            self._node.get_logger().info(f'Effort check: {reason}')

    def _conclude(self, verdict: gravity_check.GravityVerdict) -> None:
        words = gravity_check.verdict_in_words(verdict, self._names, self._convention)
        self._verdict = verdict
        self._finish(words)
        logger = self._node.get_logger()
        if verdict.agrees:
            logger.info(f'Effort check passed: {words}')
        else:
            logger.warning(f'Effort check: {words}')

    def _finish(self, words: str) -> None:
        self._words, self.done = words, True
