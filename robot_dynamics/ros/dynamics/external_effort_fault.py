# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The fault `external_effort`: an estimated external effort above its limit stops the arm.

The momentum observer runs after each command, and only if there is a limit.
"""

import numpy as np
from rclpy.node import Node
from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import per_joint
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import check_order_is_given
from robot_dynamics.monitoring.contact_levels import ContactLevels, OTHER_CAUSES
from robot_dynamics.monitoring.external_effort import ExternalEffort, joint_effort
from robot_dynamics.monitoring.state_plausibility import StateVerdict
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.parameters.declared_parameters import (
    flag,
    number,
    numbers_per_joint,
    Values,
)

DEFAULT_BANDWIDTH = 10.0
"""[Hz]"""
LONGEST_STEP = 0.1
"""[s] between two states after which the observer resets: the motion between is unknown."""
RECOVERY = 25
"""Valid states in a row without an excess after which the fault ends."""

OBSERVER_SPECS = (
    numbers_per_joint('external_effort_limit', 0.0, 1e9, (
        'Estimated external effort [N·m] or [N] above which a fault occurs'), (
        '. 0 or an empty array disables this check. dynamics_monitor publishes the estimate.')),
    number('external_effort_bandwidth', DEFAULT_BANDWIDTH, 0.01, 1000.0, (
        'Bandwidth [Hz] of the momentum observer: the external effort responds like a '
        'first-order low-pass filter with this cut-off frequency.')),
)
CONTACT_SPECS = (
    numbers_per_joint('contact.effort', 0.0, 1e9, (
        'External effort [N·m] or [N] at rest above which dynamics_monitor publishes ~/contacts'),
        (', 0 for a joint without a level. If empty, contacts are not detected. ros2 dynamics '
         'learn_contact_levels writes it.')),
    numbers_per_joint('contact.effort_per_velocity', 0.0, 1e9, (
        'Increase of contact.effort with the speed [N·m·s/rad] or [N·s/m]'), (
        '. If empty, 0.')),
    flag('contact.is_fault', False, (
        'Whether a contact is the fault external_effort, in addition to external_effort_limit.')),
)


def contact_levels(values: Values, arm: ArmModel) -> ContactLevels | None:
    """Return the levels of the parameters, None without levels; raise InvalidInputError."""
    names = 'contact.effort', 'contact.effort_per_velocity'
    for name in names:
        check_order_is_given(values, name, arm)
    if not any(values[names[0]]):
        if values['contact.is_fault']:
            raise InvalidInputError(
                'contact.is_fault is true without levels, expected contact.effort (ros2 dynamics '
                'learn_contact_levels)')
        return None
    return ContactLevels(*(
        per_joint(name, values[name] or [0.0], arm.joint_names) for name in names))


class ExternalEffortFault:
    """Observes the external effort of one arm; the control thread calls `fault`."""

    def __init__(
        self, node: Node, controller: Controller, convention: EffortConvention, values: Values,
    ) -> None:
        """Observe with the active load, within the limits of the parameters."""
        self._node, self._controller, self._convention = node, controller, convention
        self._arm = controller.dynamics.arm
        self._observer = ExternalEffort(
            ArmDynamics(self._arm), values['external_effort_bandwidth'])
        self._stamp, self._obstacle = 0, 'no joint state yet'
        self.set_limits(values)

    def set_limits(self, values: Values) -> None:
        """Use the limits and the bandwidth of the parameters from the next state on."""
        arm, name = self._controller.arm, 'external_effort_limit'
        limit = per_joint(name, values[name] or [0.0], arm.joint_names)
        self._limit = np.where(limit > 0.0, limit, np.inf)
        self._levels = contact_levels(values, arm) if values['contact.is_fault'] else None
        self._observer.set_bandwidth(values['external_effort_bandwidth'])
        self.is_on = bool((limit > 0.0).any()) or self._levels is not None
        """Whether there is a limit."""
        if not self.is_on:
            self._observer.restart()

    def fault(
        self, reader: JointStateReader, state: SensedState, q: FloatArray,
        v: FloatArray | None, verdict: StateVerdict, robot_gravity: FloatArray,
    ) -> Fault | None:
        """
        Return the fault at a state whose command is published, None for none.

        `robot_gravity` (n,) is g(q) without a load.
        """
        if not verdict.is_new:
            return None
        try:
            estimate = self._estimate(reader, state, q, v, verdict, robot_gravity)
            self._obstacle = ''
            return None if estimate is None or v is None else self._excess(estimate, v)
        except Exception as error:  # an error of the estimate must not stop the control path
            self._observer.restart()
            self._obstacle = str(error) if isinstance(error, RobotDynamicsError) else repr(error)
            self._node.get_logger().warning(
                f'The external effort is not limited: {self._obstacle}',
                throttle_duration_sec=LOG_PERIOD)
            return None

    def _estimate(
        self, reader: JointStateReader, state: SensedState, q: FloatArray,
        v: FloatArray | None, verdict: StateVerdict, robot_gravity: FloatArray,
    ) -> FloatArray | None:
        if self._convention.measured_effort == 'none':
            raise InvalidInputError("measured_effort is 'none'")
        measured = reader.effort(state)
        if measured is None or not all_finite(measured):
            raise InvalidInputError('joint states have no effort')
        if v is None:
            raise InvalidInputError('joint states have no velocity')
        arm = self._controller.dynamics.arm
        if arm is not self._arm:
            self._arm = arm
            self._observer.set_dynamics(ArmDynamics(arm))
        dt = 1e-9 * (verdict.stamp - self._stamp)
        self._stamp = verdict.stamp
        if verdict.restart or not 0.0 < dt <= LONGEST_STEP:
            self._observer.restart()
        estimate = self._observer.update(dt, q, v, joint_effort(
            self._controller.arm, self._convention, measured, v, robot_gravity))
        if estimate is not None and not all_finite(estimate):
            raise InvalidInputError('the estimate is not finite')
        return estimate

    def _excess(self, effort: FloatArray, v: FloatArray) -> Fault | None:
        """Return the fault at the joint whose effort exceeds its limit most."""
        limit = self._limit
        if self._levels is not None:
            limit = np.minimum(limit, self._levels.at(v))
        ratio = np.abs(effort) / limit
        j = int(np.argmax(ratio))
        if ratio[j] <= 1.0:
            return None
        return Fault(
            'external_effort', f'external effort at {self._arm.joint_names[j]!r} is '
            f'{effort[j]:.3g}, expected at most {limit[j]:.3g} (external_effort_limit or '
            f'contact.effort): a contact, or {OTHER_CAUSES}', recovery=RECOVERY)

    def status(self) -> Status:
        """Return whether the external effort is limited, for the diagnostics."""
        if not self.is_on:
            return Status('external effort', OK, 'no limit', {})
        return Status(
            'external effort', WARN if self._obstacle else OK,
            f'not limited: {self._obstacle}' if self._obstacle else 'limited', {})
