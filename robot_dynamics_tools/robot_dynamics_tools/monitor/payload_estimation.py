# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The estimation of `~/estimate_payload`: from buffered states to an estimate, and its payload.

The thread of the states only stores them, and only while an estimation is active. A timer filters
them and adds them to the estimator. Position, velocity and effort pass the same causal filter,
whose derivative of the velocity is the acceleration (`monitoring.low_pass`).
"""

from collections import deque
from dataclasses import replace
import math

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.regressor import NAMES
from robot_dynamics.ros.middleware.conversions import floats_to_ros, payload_to_ros
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error, GuardedCallbacks
from robot_dynamics_interfaces.srv import EstimatePayload, SetPayload
from robot_dynamics_tools.monitor.followed_model import Followed
from robot_dynamics_tools.monitor.states import MeasuredState
from robot_dynamics_tools.monitoring.low_pass import StateFilter
from robot_dynamics_tools.payload_estimation import PayloadEstimate, PayloadEstimator
from robot_dynamics_tools.payload_estimation.summary import headline

MOST_SAMPLES = 5000
"""Number of waiting states; if more arrive, the oldest are discarded."""
CUTOFF = 5.0
"""Cut-off frequency [Hz] of the filter."""
INTERVAL = 1.0 / (10.0 * CUTOFF)
"""Shortest interval [s] between two filtered samples that are used."""
PERIOD = 0.2
"""[s] between two calls that take the waiting states."""
LONGEST_STEP = 0.1
"""[s] between two states after which the filter restarts."""
GRAVITY_CHANGE = 0.05
"""Largest change of gravity [m/s²] during an estimation."""
WITHOUT_REFERENCE = 'none', 'gravity_compensation', 'hand_guiding'
"""Values of `command` of laws that follow no reference."""
ANSWER_TIME = 5.0
"""[s] for the answer of `~/set_payload`."""
COMPENSATED = (
    'dynamics compensated friction at rest, so that dry friction cancels only in part, and the '
    'deviations are larger: set friction_compensation to none for the holds')
NOT_STARTED = (
    'no estimation is active, expected an earlier call with start = true and the name of a link')


class _Run:
    """One estimation: the filter and the estimator."""

    def __init__(self, model: Followed, link: str) -> None:
        self.others = others_than(link, model)
        self._arm = model.arm.with_payloads(self.others)
        self._estimator = PayloadEstimator(self._arm, link, CUTOFF)
        self._filter = StateFilter(CUTOFF, self._arm.is_continuous)
        self._stamp, self._first_stamp, self._since_used = -math.inf, 0, 0.0
        self._friction_cancels = True

    @property
    def link(self) -> str:
        return self._estimator.link

    def has_other_gravity(self, model: Followed) -> bool:
        """Return whether gravity has changed since the start."""
        return bool(np.abs(self._arm.gravity - model.arm.gravity).max() > GRAVITY_CHANGE)

    def estimate(self) -> PayloadEstimate:
        found = self._estimator.estimate()
        if self._friction_cancels or not found.pairs:
            return found
        return replace(found, remarks=(*found.remarks, COMPENSATED))

    def add(self, samples: list[MeasuredState], compensates_at_rest: bool) -> None:
        """Filter states, and add some of them to the estimator."""
        if samples and compensates_at_rest:
            self._friction_cancels = False
        kept: list[tuple[float | FloatArray, ...]] = []
        for sample in samples:
            dt, self._stamp = 1e-9 * (sample.stamp_ns - self._stamp), sample.stamp_ns
            if sample.restart or not 0.0 < dt <= LONGEST_STEP:
                self._flush(kept)
                self._filter.restart()
                self._estimator.restart()
                dt = self._since_used = 0.0
                self._first_stamp = self._first_stamp or sample.stamp_ns
            self._since_used += dt
            effort = None if sample.effort is None else self._filter.update(
                dt, sample.q, sample.v, sample.effort)
            state = self._filter.state
            if effort is not None and state is not None and self._since_used >= INTERVAL:
                self._since_used = 0.0
                kept.append((1e-9 * (sample.stamp_ns - self._first_stamp), *state, effort))
        self._flush(kept)

    def _flush(self, kept: list[tuple[float | FloatArray, ...]]) -> None:
        if kept:
            self._estimator.add(*(np.array(signal) for signal in zip(*kept)))
            kept.clear()


class PayloadEstimation:
    """
    The active estimation, if any.

    The thread of the states calls `keep`, the executor the other methods. A deque is safe for one
    thread at each end.
    """

    def __init__(self, node: GuardedCallbacks) -> None:
        self._node = node
        self.is_on = False
        """Whether states are kept for an active estimation."""
        self._obstacle = ''
        """Reason why the newest state cannot be used, empty if it can."""
        self._waiting: deque[MeasuredState] = deque(maxlen=MOST_SAMPLES)
        self._model: Followed | None = None
        self._run: _Run | None = None
        self._ended = NOT_STARTED
        self._timer: object = None

    def set_model(self, model: Followed | None) -> None:
        """End an estimation if this is another arm, or None."""
        before, self._model = self._model, model
        if model is None:
            self._end('the estimation has ended, because there is no model')
        elif before is None or before.base is not model.base:
            self._end('the estimation has ended, because another model was loaded')

    def start(self, link: str) -> None:
        """Begin an estimation; raise InvalidInputError for an unknown link or without effort."""
        if self._model is None:
            raise ModelError('no model yet, expected a running node dynamics (parameter dynamics)')
        if self._model.convention.measured_effort == 'none':
            raise InvalidInputError(
                "measured_effort is 'none', expected a measured effort to estimate from")
        run = _Run(self._model, link)
        self._end(NOT_STARTED)
        self._run = run
        self._obstacle, self.is_on = 'no joint state since the start', True
        self._timer = self._node.create_timer(PERIOD, self._take)

    def keep(self, state: MeasuredState) -> None:
        """Keep a state that has an effort, if an estimation is active."""
        if self.is_on:
            self._obstacle = state.obstacle
            if state.effort is not None:
                self._waiting.append(state)

    def stop(self) -> None:
        """End the estimation."""
        self._end(NOT_STARTED)

    def estimate(self, link: str) -> PayloadEstimate:
        """
        Return the present estimate.

        Raises InvalidInputError if no estimation is active, if it is for another link than `link`
        (empty for any), or if it has no data.
        """
        self._take()
        if self._run is None:
            raise InvalidInputError(self._ended)
        if link not in ('', self._run.link):
            raise InvalidInputError(
                f'link is {link!r}, expected {self._run.link!r}, the link of the estimation')
        found = self._run.estimate()
        if found.duration == 0.0:
            raise InvalidInputError('no usable joint states yet: ' + (
                self._obstacle or (
                    f'expected them at most {LONGEST_STEP:g} s apart for 1 s')))
        return found

    def _take(self) -> None:
        """Add the waiting states to the estimate; an error ends the estimation."""
        run, model = self._run, self._model
        if run is None or model is None:
            return
        if others_than(run.link, model) != run.others:
            self._end('the estimation has ended, because the payload of another link has changed')
            return
        if run.has_other_gravity(model):
            self._end('the estimation has ended, because the gravity of the base has changed')
            return
        try:
            run.add([self._waiting.popleft() for _ in range(len(self._waiting))],
                    compensates_at_rest(model))
        except Exception as error:  # such as a state beyond all bounds
            self._end(f'the estimation has ended: {describe_error(error)}')

    def _end(self, reason: str) -> None:
        if self._run is not None or reason == NOT_STARTED:
            self._ended = reason
        self._run, self.is_on = None, False
        self._waiting.clear()
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None


def others_than(link: str, model: Followed) -> tuple[Payload, ...]:
    """Return the payloads of the other links."""
    return tuple(one for one in model.payloads if one.link != link)


def compensates_at_rest(model: Followed) -> bool:
    """Return whether `dynamics` compensates dry friction of joints that rest."""
    friction, values = model.arm.friction, model.values
    return values['command'] not in WITHOUT_REFERENCE and (
        values['friction_compensation'] == 'reference') and bool(
            (friction.at_rest.static + friction.load_coefficient).any())


def estimate_to_ros(estimate: PayloadEstimate, response: EstimatePayload.Response) -> None:
    """Fill an estimate into a response; the payload has m = 0 if it is not physical."""
    response.message = headline(estimate)
    response.link, response.duration = estimate.link, estimate.duration
    response.holds = estimate.holds
    response.parameters = list(NAMES)
    response.values = floats_to_ros(estimate.values)
    response.deviations = floats_to_ros(estimate.deviations)
    response.verdicts = list(estimate.verdicts)
    response.per_percent_of_effort = floats_to_ros(estimate.per_percent)
    response.advice = list(estimate.advice)
    response.remarks = [estimate.friction, *estimate.remarks]
    response.warnings = list(estimate.implausible)
    try:
        response.payload = payload_to_ros(estimate.payload())
    except InvalidInputError:  # the verdicts and the warnings state the reason
        response.payload = payload_to_ros(None)


class PayloadRequest:
    """
    Calls `~/set_payload` of `dynamics` from the callback of a service.

    A callback cannot wait for its own executor: a hidden node with another executor calls.
    """

    def __init__(self, node: Node, dynamics: str) -> None:
        """`dynamics` is the full name of the node."""
        self._service = f'{dynamics}/set_payload'
        self._helper = rclpy.create_node(
            f'_{node.get_name()}_requests', namespace=node.get_namespace(), context=node.context,
            use_global_arguments=False, start_parameter_services=False, enable_rosout=False)
        self._client = self._helper.create_client(SetPayload, self._service)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._helper)

    def apply(self, payload: Payload, transition_time: float) -> SetPayload.Response:
        """Return the answer; raise InvalidInputError if the payload is not set."""
        if not self._client.service_is_ready():
            raise InvalidInputError(
                f'the payload is not applied: there is no service {self._service}, expected the '
                'node dynamics to run')
        request = self._client.call_async(SetPayload.Request(
            payload=payload_to_ros(payload), transition_time=transition_time))
        self._executor.spin_until_future_complete(request, ANSWER_TIME)
        if not request.done():
            self._client.remove_pending_request(request)
            raise InvalidInputError(
                f'the payload may not be applied: {self._service} has not answered in '
                f'{ANSWER_TIME:g} s')
        answer = request.result()
        if not answer.success:
            raise InvalidInputError(f'the payload is not applied: {answer.message}')
        return answer

    def close(self) -> None:
        """Destroy the hidden node."""
        self._executor.shutdown()
        self._helper.destroy_node()
