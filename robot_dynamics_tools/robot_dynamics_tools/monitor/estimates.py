# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The estimates of one arm from measured efforts, computed only while there are subscribers.

`~/external_effort`, `~/external_wrench`, `~/contacts` and `~/residual`. Each estimator resets when
its first subscriber connects. The expected standard deviation of an estimate is published on a
separate topic, `…_deviation`.
"""

from collections import Counter
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.ros.middleware.cdr_templates import state_template
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics_tools.monitor.external import LiveContacts, LiveWrench, Output
from robot_dynamics_tools.monitor.followed_model import Followed
from robot_dynamics_tools.monitor.states import MeasuredState
from robot_dynamics_tools.monitoring.external_wrench import ExternalWrenchEstimator
from robot_dynamics_tools.monitoring.live_residual import LiveResidual
from robot_dynamics_tools.pictures.stick_figure import tool_link
from sensor_msgs.msg import JointState

LONGEST_STEP = 0.1
"""[s] between two states after which the estimators reset: the motion between is unknown."""
RESTING, MADE = (OK, 'no subscribers'), (OK, 'made')


class Estimates:
    """The estimators of one arm: external effort, then residual, each only on request."""

    def __init__(self, model: Followed, values: Values) -> None:
        """Estimate with a model, at the bandwidths of `dynamics` and of the `values`."""
        self.template = state_template(model.arm.joint_names, has_motion=False)
        dynamics = ArmDynamics(model.arm)
        self._external = ExternalEffort(dynamics, model.values['external_effort_bandwidth'])
        self.residual = LiveResidual(dynamics, values['residual_bandwidth'])
        self._all: tuple[ExternalEffort | LiveResidual, ...] = (self._external, self.residual)
        self.wrench = ExternalWrenchEstimator(
            dynamics, self._external, values['external_wrench.frame'] or tool_link(model.arm),
            values['external_wrench.largest_force'], values['external_wrench.largest_torque'])
        self.set_model(model)

    def set_model(self, model: Followed) -> None:
        """Continue with other loads, gravity or bandwidth of the same arm."""
        self._external.set_bandwidth(model.values['external_effort_bandwidth'])
        dynamics, self.uncertainty = ArmDynamics(model.arm), model.arm.uncertainty
        self._deviation = None if self.uncertainty is None else EffortDeviation(
            dynamics, self.uncertainty)
        for estimator in (*self._all, self.wrench):
            estimator.set_dynamics(dynamics)

    def restart(self) -> None:
        """Reset all estimators at the next state."""
        for estimator in (*self._all, self.wrench):
            estimator.restart()

    def update(
        self, wanted: tuple[bool, bool], dt: float, q: FloatArray, v: FloatArray,
        effort: FloatArray,
    ) -> list[FloatArray | None]:
        """Return each requested estimate (n,), None until it exists; reset the others."""
        found: list[FloatArray | None] = []
        for is_wanted, estimator in zip(wanted, self._all):
            if not is_wanted:
                estimator.restart()
            found.append(estimator.update(dt, q, v, effort) if is_wanted else None)
        if not wanted[0]:
            self.wrench.restart()
        return found

    def deviation(self, number: int, dt: float) -> FloatArray | None:
        """
        Return the expected standard deviation (n,) of an estimate, None if it is unknown.

        `number` is the place of the estimate in the result of `update`, dt [s] the period of the
        states. The parts are the effort noise behind the filter of the estimate, and the
        uncertainty of the model at the present state.
        """
        estimator = self._all[number]
        if self.uncertainty is None or self._deviation is None or estimator.state is None:
            return None
        return np.hypot(
            self.uncertainty.noise(estimator.noise_bandwidth, dt),
            self._deviation(*estimator.state, smooth=True))


class LiveEstimates:
    """Publishes estimates; one thread calls `update`, any thread `status`."""

    def __init__(self, node: Node, is_external_wanted: Callable[[], bool]) -> None:
        """`is_external_wanted` returns whether the node itself needs effort and wrench."""
        self._node, self._is_external_wanted = node, is_external_wanted
        self._outputs = [
            [Output(node, JointState, f'~/{estimate}{of}') for of in ('', '_deviation')]
            for estimate in ('external_effort', 'residual')]
        self.wrench, self.contacts = LiveWrench(node, is_external_wanted), LiveContacts(node)
        self.estimates: Estimates | None = None
        """The estimators in use, None without a model."""
        self._condition = RESTING
        self._stamp = 0
        self.external_effort: FloatArray | None = None
        """External effort of the newest state (n,), None if it is not estimated."""
        self._restarts: Counter[str] = Counter()

    def set_estimates(self, estimates: Estimates | None) -> None:
        """Use these estimators from the next state on, None without a model."""
        self.rest()
        self.estimates = estimates
        self.wrench.estimator = None if estimates is None else estimates.wrench

    @property
    def wanted(self) -> tuple[bool, bool]:
        """Whether external effort and residual are needed."""
        topics = 2 if self.estimates is not None and self.estimates.uncertainty is not None else 1
        external, residual = (
            any(one.count() > 0 for one in outputs[:topics]) for outputs in self._outputs)
        return (external or self.wrench.has_subscribers or self.contacts.is_on
                or self._is_external_wanted()), residual

    def rest(self) -> None:
        """Estimate nothing, and reset at the next state."""
        self._condition = RESTING
        self.external_effort = self.wrench.newest = None

    def update(self, state: MeasuredState, wanted: tuple[bool, bool]) -> None:
        """Publish the estimates that are needed, at a new state."""
        estimates = self.estimates
        if estimates is None or not any(wanted):
            self.rest()
            return
        try:
            self._take(estimates, wanted, state)
        except Exception as error:  # no state may end the thread
            self.rest()
            self._condition = WARN, f'none: {describe_error(error)}'
            self._node.get_logger().warning(
                f'No ~/external_effort, ~/external_wrench and ~/residual: {describe_error(error)}',
                throttle_duration_sec=LOG_PERIOD)

    def _take(self, estimates: Estimates, wanted: tuple[bool, bool], state: MeasuredState) -> None:
        if state.effort is None:
            raise InvalidInputError(state.obstacle)
        dt = self._begin_where_needed(estimates, state)
        with np.errstate(over='ignore', invalid='ignore'):
            found = estimates.update(wanted, dt, state.q, state.v, state.effort)
        if not all(estimate is None or all_finite(estimate) for estimate in found):
            raise InvalidInputError('the estimates are not finite')
        self.external_effort = found[0]
        if found[0] is not None and self.contacts.is_on:
            self.contacts.update(state.stamp_ns, dt, state.v, found[0])
        for i, ((output, of_deviation), estimate) in enumerate(zip(self._outputs, found)):
            if estimate is None:
                continue
            output.publish(estimates.template.filled(state.stamp, estimate))
            deviation = estimates.deviation(i, dt) if of_deviation.count() else None
            if deviation is not None:
                of_deviation.publish(estimates.template.filled(state.stamp, deviation))
        if found[0] is not None:
            self.wrench.publish(estimates.wrench, state.stamp_ns, dt)

    def _begin_where_needed(self, estimates: Estimates, state: MeasuredState) -> float:
        """Return the time [s] since the state before; after a reset it is not used."""
        dt = 1e-9 * (state.stamp_ns - self._stamp)
        self._stamp = state.stamp_ns
        reason = state.restart or ('' if 0.0 < dt <= LONGEST_STEP else 'gap')
        if self._condition == MADE and reason:
            self._restarts[reason] += 1
        if reason or self._condition != MADE:
            estimates.restart()
        self._condition = MADE
        return dt

    def status(self) -> Status:
        """Return whether estimates are published, for the diagnostics."""
        restarts = dict(self._restarts)  # an atomic copy, because another thread counts
        return Status('estimates', *self._condition, {
            f'reset: {reason}': count for reason, count in sorted(restarts.items())})
