# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Estimates of `dynamics` from measured efforts, computed only while there are subscribers.

`~/external_effort`, `~/external_wrench` and `~/residual` are computed after the command is
published. Each estimator resets when its first subscriber connects. An error in them does not
affect the control path.
The expected standard deviation of an estimate is published on a separate topic, `…_deviation`.
"""

from collections import Counter
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.joints.effort_convention import EffortConvention, joint_from_measured
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.monitoring.live_residual import LiveResidual
from robot_dynamics.monitoring.state_plausibility import StateVerdict
from robot_dynamics.ros.dynamics.external.live_contacts import CONTACT_SPECS, LiveContacts
from robot_dynamics.ros.dynamics.external.live_wrench import (
    LiveWrench,
    wrench_estimator,
    WRENCH_SPECS,
)
from robot_dynamics.ros.middleware.cdr_templates import effort_template, SensedState
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.middleware.message_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.rclpy_internals import subscription_count
from robot_dynamics.ros.parameters.declared_parameters import number, Values
from sensor_msgs.msg import JointState

DEFAULT_BANDWIDTH = 10.0
"""[Hz]"""
LONGEST_STEP = 0.1
"""[s] between two states after which the estimators reset: the motion between is unknown."""
NEWEST_ONLY = QoSProfile(depth=1)
NO_SUBSCRIBERS = 'no subscribers'

ESTIMATE_SPECS = (
    number('external_effort_bandwidth', DEFAULT_BANDWIDTH, 0.01, 1000.0, (
        'Bandwidth [Hz] of the momentum observer: ~/external_effort responds like a first- order '
        'low-pass filter with this cut-off frequency.')),
    number('residual_bandwidth', DEFAULT_BANDWIDTH, 0.01, 1000.0, (
        'Cut-off frequency [Hz] of the second-order low-pass filter of ~/residual.')),
    *WRENCH_SPECS,
    *CONTACT_SPECS,
)


class Estimates:
    """The estimates of one arm: external effort, then residual, each only on request."""

    def __init__(
        self, controller: Controller, convention: EffortConvention, values: Values,
    ) -> None:
        """Estimate with the active load, at the bandwidths of the parameters."""
        self.convention, self._controller = convention, controller
        self.template = effort_template(controller.arm.joint_names)
        self._arm = controller.dynamics.arm
        self._deviation: EffortDeviation | None = None
        dynamics = ArmDynamics(self._arm)
        self._external = ExternalEffort(dynamics, values['external_effort_bandwidth'])
        self._residual = LiveResidual(dynamics, values['residual_bandwidth'])
        self._all: tuple[ExternalEffort | LiveResidual, ...] = (self._external, self._residual)
        self.wrench = wrench_estimator(dynamics, self._external, values)

    def set_bandwidths(self, values: Values) -> None:
        """Set the bandwidths of the parameters; the estimates continue without a reset."""
        self._external.set_bandwidth(values['external_effort_bandwidth'])
        self._residual.set_bandwidth(values['residual_bandwidth'])

    def restart(self) -> None:
        """Reset all estimators at the next state."""
        for estimator in self._all:
            estimator.restart()
        self.wrench.restart()

    def joint_effort(
        self, measured: FloatArray, v: FloatArray, robot_gravity: FloatArray,
    ) -> FloatArray:
        """Return the joint effort (n,) for a measured effort (n,)."""
        return joint_effort(self._controller.arm, self.convention, measured, v, robot_gravity)

    def update(
        self, wanted: tuple[bool, bool], dt: float, q: FloatArray, v: FloatArray,
        effort: FloatArray,
    ) -> list[FloatArray | None]:
        """Return each requested estimate (n,), None until it exists; reset the others."""
        self._take_load()
        found: list[FloatArray | None] = []
        for is_wanted, estimator in zip(wanted, self._all):
            estimate = None
            if is_wanted:
                estimate = estimator.update(dt, q, v, effort)
            else:
                estimator.restart()
            found.append(estimate)
        if not wanted[0]:
            self.wrench.restart()
        return found

    @property
    def has_deviations(self) -> bool:
        """Whether the arm has an uncertainty."""
        return self._arm.uncertainty is not None

    def deviation(self, number: int, dt: float) -> FloatArray | None:
        """
        Return the expected standard deviation (n,) of an estimate, None if it is unknown.

        `number` is the place of the estimate in the result of `update`, dt [s] the period of the
        states. The parts are the effort noise behind the filter of the estimate, and the
        uncertainty of the model at the present state.
        """
        estimator, uncertainty = self._all[number], self._arm.uncertainty
        if uncertainty is None or estimator.state is None:
            return None
        if self._deviation is None:
            self._deviation = EffortDeviation(ArmDynamics(self._arm), uncertainty)
        return np.hypot(
            uncertainty.noise(estimator.noise_bandwidth, dt),
            self._deviation(*estimator.state, smooth=True))

    def _take_load(self) -> None:
        arm = self._controller.dynamics.arm
        if arm is not self._arm:
            self._arm, self._deviation, dynamics = arm, None, ArmDynamics(arm)
            for estimator in self._all:
                estimator.set_dynamics(dynamics)
            self.wrench.set_dynamics(dynamics)


def joint_effort(
    arm: ArmModel, convention: EffortConvention, measured: FloatArray, v: FloatArray,
    robot_gravity: FloatArray,
) -> FloatArray:
    """Return the joint effort (n,) for an effort (n,) that the robot or the drives report."""
    effort = joint_from_measured(
        convention.measured_effort, measured, v, robot_gravity, arm.actuators)
    return effort if arm.drive is None else arm.drive.torque(effort)


class LiveEstimates:
    """Publishes estimates; the control thread calls `look`, any thread `status`."""

    def __init__(self, node: Node, is_external_wanted: Callable[[], bool]) -> None:
        """`is_external_wanted` returns whether the node itself needs effort and wrench."""
        self._node, self._is_external_wanted = node, is_external_wanted
        self._publishers = (
            node.create_publisher(JointState, '~/external_effort', NEWEST_ONLY),
            node.create_publisher(JointState, '~/residual', NEWEST_ONLY))
        self._deviations = (
            node.create_publisher(JointState, '~/external_effort_deviation', NEWEST_ONLY),
            node.create_publisher(JointState, '~/residual_deviation', NEWEST_ONLY))
        self.wrench, self.contacts = LiveWrench(node, is_external_wanted), LiveContacts(node)
        self._counts = [subscription_count(one) for one in self._publishers]
        self._deviation_counts = [subscription_count(one) for one in self._deviations]
        self.counts = (*self._counts, *self._deviation_counts, *self.wrench.counts,
                       self.contacts.count)
        """Functions that return the number of subscribers of each topic."""
        self.estimates: Estimates | None = None
        """The estimators in use, None without a model."""
        self.is_on = self.is_lacking = False
        """Whether the estimators run, and whether subscribers lack the estimates."""
        self._words = NO_SUBSCRIBERS
        self._stamp = 0
        self.external_effort: FloatArray | None = None
        """External effort of the newest state (n,), None if it is not estimated."""
        self._external_limit: FloatArray | None = None
        self.has_limits = False
        """Whether an external effort can be a fault."""
        self.limit: FloatArray | None = None
        """Limit at the newest state (n,) [N·m] or [N], infinite for none; None: no limits."""
        self._restarts: Counter[str] = Counter()

    def set_estimates(self, estimates: Estimates) -> None:
        """Use these estimators from the next state on."""
        self.estimates, self.is_on, self.wrench.estimator = estimates, False, estimates.wrench

    def forget(self) -> None:
        """Stop to estimate."""
        self.estimates = self.wrench.estimator = None
        self._rest()

    def update(
        self, reader: JointStateReader, state: SensedState, q: FloatArray,
        v: FloatArray | None, judgement: StateVerdict, robot_gravity: FloatArray,
    ) -> None:
        """Take a state whose command is published; `robot_gravity` (n,) is g(q) without a load."""
        estimates = self.estimates
        has_subscribers, has_residual = self._has_subscribers(estimates)
        has_subscribers = has_subscribers or self.contacts.is_on
        is_limited = self.has_limits
        wanted = has_subscribers or is_limited or self._is_external_wanted(), has_residual
        if estimates is None or not any(wanted):
            self._rest()
        elif judgement.is_new:
            try:
                self._take(estimates, wanted, reader, state, q, v, judgement, robot_gravity)
            except RobotDynamicsError as error:
                self._lack(str(error), has_subscribers or is_limited or wanted[1])
            except Exception as error:  # an error of an estimate must not stop the control path
                self._lack(repr(error), has_subscribers or is_limited or wanted[1])

    def _has_subscribers(self, estimates: Estimates | None) -> tuple[bool, bool]:
        """Return whether each estimate, or its deviation, has a subscriber."""
        external, residual = (count() > 0 for count in self._counts)
        external = external or self.wrench.has_subscribers
        if estimates is None or not estimates.has_deviations:
            return external, residual
        of_external, of_residual = (count() > 0 for count in self._deviation_counts)
        return external or of_external, residual or of_residual

    def set_limits(
        self, external_limit: FloatArray | None, values: Values, arm: ArmModel,
    ) -> None:
        """Use this limit of the external effort (n,), None for none, and the contact levels."""
        self.contacts.set_levels(values, arm)
        self._external_limit = external_limit
        self.has_limits = external_limit is not None or self.contacts.is_fault

    def excess(self) -> int | None:
        """Return the joint whose external effort exceeds its limit most, None if none does."""
        if self.limit is None or self.external_effort is None:
            return None
        ratio = np.abs(self.external_effort) / self.limit
        j = int(np.argmax(ratio))
        return j if ratio[j] > 1.0 else None

    def _rest(self) -> None:
        self.is_on, self.is_lacking, self._words = False, False, NO_SUBSCRIBERS
        self.external_effort = self.wrench.newest = None

    def _take(
        self, estimates: Estimates, wanted: tuple[bool, bool], reader: JointStateReader,
        state: SensedState, q: FloatArray, v: FloatArray | None, judgement: StateVerdict,
        robot_gravity: FloatArray,
    ) -> None:
        measured = reader.effort(state)
        if estimates.convention.measured_effort == 'none':
            raise InvalidInputError("measured_effort is 'none'")
        if measured is None or not all_finite(measured):
            raise InvalidInputError('joint states have no effort')
        if v is None:
            raise InvalidInputError('joint states have no velocity')
        dt = self._begin_where_needed(estimates, judgement)
        with np.errstate(over='ignore', invalid='ignore'):
            effort = estimates.joint_effort(measured, v, robot_gravity)
            found = estimates.update(wanted, dt, q, v, effort)
        if not all(estimate is None or all_finite(estimate) for estimate in found):
            raise InvalidInputError('the estimates are not finite')
        self._judge(found[0], v, dt, judgement.stamp)
        for publisher, estimate in zip(self._publishers, found):
            if estimate is not None:
                publisher.publish(estimates.template.filled(state.stamp, estimate))
        if found[0] is not None:
            self.wrench.publish(judgement.stamp, dt)
        if estimates.has_deviations:
            self._publish_deviations(estimates, found, dt, state.stamp)

    def _judge(
        self, effort: FloatArray | None, v: FloatArray, dt: float, stamp_ns: int,
    ) -> None:
        """Keep the external effort (n,) and its limits at a velocity, and look for contacts."""
        self.external_effort, self.limit = effort, self._external_limit
        levels = self.contacts.fault_levels(v)
        if levels is not None:
            self.limit = levels if self.limit is None else np.minimum(self.limit, levels)
        if effort is not None and self.contacts.is_on:
            self.contacts.update(stamp_ns, dt, v, effort)

    def _publish_deviations(
        self, estimates: Estimates, found: list[FloatArray | None], dt: float, stamp: bytes,
    ) -> None:
        for i, (publisher, count) in enumerate(zip(self._deviations, self._deviation_counts)):
            if found[i] is not None and count():
                deviation = estimates.deviation(i, dt)
                if deviation is not None:
                    publisher.publish(estimates.template.filled(stamp, deviation))

    def _begin_where_needed(self, estimates: Estimates, judgement: StateVerdict) -> float:
        """Return the time [s] since the state before; after a reset it is not used."""
        dt = 1e-9 * (judgement.stamp - self._stamp)
        self._stamp = judgement.stamp
        reason = judgement.restart
        if not reason and not 0.0 < dt <= LONGEST_STEP:
            reason = 'gap'
        if self.is_on and reason:
            self._restarts[reason] += 1
        if reason or not self.is_on:
            estimates.restart()
        self.is_on, self.is_lacking, self._words = True, False, 'made'
        return dt

    def _lack(self, words: str, has_subscribers: bool) -> None:
        """Reset at the next state, and log the reason if there are subscribers."""
        self._rest()
        if not has_subscribers:
            return
        self.is_lacking, self._words = True, f'none: {words}'
        self._node.get_logger().warning(
            f'No ~/external_effort, ~/external_wrench and ~/residual: {words}',
            throttle_duration_sec=LOG_PERIOD)

    def status(self) -> Status:
        """Return whether estimates are published, for the diagnostics."""
        restarts = dict(self._restarts)  # an atomic copy, because another thread counts
        return Status('estimates', WARN if self.is_lacking else OK, self._words, {
            f'reset: {reason}': count for reason, count in sorted(restarts.items())})
