# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a control loop uses in place of velocities in doubt and of joints without a signal."""

from functools import partial

from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.braking import is_held
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.goal_execution import GoalExecution
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.frozen_joints import FrozenJoints
from robot_dynamics.monitoring.motion_consistency import MotionConsistency

FROZEN_RECOVERY = 25
"""Valid states in a row with a signal of all joints after which frozen_joint ends."""


class JointSignals:
    """The checked signals of one arm; `ControlLoop` calls the methods with its lock held."""

    def __init__(self, controller: Controller, goals: GoalExecution) -> None:
        arm = controller.arm
        self._controller, self._goals = controller, goals
        self.consistency = MotionConsistency(
            arm.joint_names, arm.joint_kinds, partial(is_held, controller))
        self.is_consistent, self.checked_ns = True, 0
        """The result of the last check, and its stamp."""
        self.frozen: FrozenJoints | None = None
        """The joints without a signal, None if there are none."""
        self._doubt = ''

    def check(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> None:
        """Check the velocities of a state (n,)."""
        self.checked_ns = stamp_ns
        self.is_consistent = self.consistency.update(
            stamp_ns, q, v, self._controller.reference_position)

    def judged(
        self, stamp_ns: int, q: FloatArray, v: FloatArray | None, dt: float,
        command: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray | None, Fault | None]:
        """
        Return position and velocity to use, None to estimate the velocity, and a fault.

        When a velocity comes into doubt, an arm in motion stops from where it is: the wrong
        velocity has driven it away from its reference. A joint without a signal is a fault, in
        which its motion is predicted from the `command` (n,) since the last state.
        """
        consistency, controller = self.consistency, self._controller
        is_frozen = bool(consistency.frozen.any())
        if consistency.doubtful.any():
            v = None
            if consistency.reason != self._doubt and not is_frozen:
                self._doubt = consistency.reason
                self._goals.notice = (
                    f'{consistency.reason}. Velocities are estimated from the positions; a '
                    'motion ends with a stop.')
                self._goals.interrupt(consistency.reason, holds=True)
        if not is_frozen:
            if self.frozen is not None:
                self.frozen = None
                controller.set_without_signal(False)
                controller.stop_from_state()
            return q, v, None
        controller.set_without_signal(True)
        if self.frozen is None:
            self.frozen = FrozenJoints(
                consistency.frozen, consistency.repeats_since_ns, controller, stamp_ns, dt, q, v)
            controller.stop()
        self.frozen.mark(consistency.frozen)
        fault = Fault('frozen_joint', consistency.reason, recovery=FROZEN_RECOVERY)
        return (*self.frozen.predict(stamp_ns, dt, q, v, command), fault)
