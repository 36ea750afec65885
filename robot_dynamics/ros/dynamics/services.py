# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The services of `dynamics`: each checks its request, calls the library, fills the response."""

from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.model.derivatives import ArmDerivatives
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.model.joint_order import JointOrder
from robot_dynamics.ros.dynamics.payloads import PayloadKeeper
from robot_dynamics.ros.middleware.conversions import (
    add_task_space,
    floats_to_ros,
    terms_to_ros,
    trajectory_from_ros,
    trajectory_to_ros,
    with_efforts,
    wrenches_from_ros,
)
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.task_space.task_space import TaskSpace as TaskSpaceOfPoint
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.goal_limits import motion_excesses
from robot_dynamics.trajectories.limit_warnings import (
    limit_warnings,
    motor_warnings,
    worst_in_words,
)
from robot_dynamics.trajectories.retiming import retime
from robot_dynamics.validation import check_scalar
from robot_dynamics_interfaces import srv

Handler = Callable[[Any, Any], None]
PLANNED_RATE = 0.75
"""Share of `effort_rate_limit` that retimed trajectories use; the rest is for the feedback."""
_PART = 1000
"""Number of samples of task space that are computed together, to bound the memory."""
SERVICE_QOS = QoSProfile(depth=100)
"""Largest number of waiting requests of all clients; further requests are lost silently."""


class DynamicsServices:
    """
    Offers all services on a node.

    The response to an invalid request has success = false and the reason.
    """

    def __init__(
        self, node: GuardedCallbacks, payloads: PayloadKeeper,
        controller: Callable[[], Controller | None],
    ) -> None:
        """
        Offer the services on a node; ~/set_payload changes `payloads`.

        `controller` returns that of the arm that is served, None without a model.
        """
        self._node, self._payloads, self._served = node, payloads, controller

        def offer(service_type: type, name: str, handler: Handler) -> None:
            def answer(request: Any, response: Any) -> Any:
                handler(request, response)
                response.success = True
                return response

            node.create_service(service_type, f'~/{name}', answer, qos_profile=SERVICE_QOS)

        offer(srv.InverseDynamics, 'inverse_dynamics', self._inverse_dynamics)
        offer(srv.InverseDynamicsBatch, 'inverse_dynamics_batch', self._batch)
        offer(srv.InverseDynamicsTrajectory, 'inverse_dynamics_trajectory', self._trajectory)
        offer(srv.RetimeTrajectory, 'retime_trajectory', self._retime)
        offer(srv.ForwardDynamics, 'forward_dynamics', self._forward_dynamics)
        offer(srv.ManipulatorEquation, 'manipulator_equation', self._manipulator_equation)
        offer(srv.TaskSpace, 'task_space', self._task_space)
        offer(srv.SetPayload, 'set_payload', self._set_payload)

    def _used(self) -> Controller:
        controller = self._served()
        if controller is None:
            raise ModelError(
                'no model yet: expected a URDF on the topic robot_description, or the node to be '
                'configured (~/change_state)')
        return controller

    def _dynamics(self) -> ArmDynamics:
        """Return the dynamics for planning: the services run in the executor's thread."""
        return self._used().load.planning

    def _state_of(
        self, request: Any, response: Any,
    ) -> tuple[UncheckedArmDynamics, JointOrder, FloatArray, FloatArray]:
        """Return the dynamics, the order of a request, and its q and v (n,); fill in the names."""
        dynamics = self._dynamics().unchecked
        order = JointOrder(dynamics.arm, request.joint_names)
        response.joint_names = list(order.names)
        return (dynamics, order, order.position(request.position),
                order.rate(request.velocity, 'velocity'))

    def _inverse_dynamics(
        self, request: srv.InverseDynamics.Request, response: srv.InverseDynamics.Response,
    ) -> None:
        dynamics, order, q, v = self._state_of(request, response)
        a = order.rate(request.acceleration, 'acceleration')
        wrenches = wrenches_from_ros(dynamics.arm, request.external_wrenches)
        terms = dynamics.terms(q, v, a, wrenches)
        _fill(response, order.answer, effort=terms.effort)
        uncertainty = dynamics.arm.uncertainty
        if uncertainty is not None and uncertainty.has_covariance:
            _fill(response, order.answer, effort_deviation=EffortDeviation(
                self._dynamics(), uncertainty).prediction(
                    q, v, a, terms.effort - terms.friction))
        response.terms = terms_to_ros(
            terms, order.names, self._node.get_clock().now().to_msg(), order)
        response.warnings = [
            *limit_warnings(dynamics.arm, q, v, terms.effort),
            *_fill_motors(response, order, dynamics.arm, terms.effort, v, a)]
        if request.include_derivatives:
            by = ArmDerivatives(dynamics.arm).inverse_dynamics(q, v, a, wrenches)
            _fill(response, order.answer_form, **{
                f'effort_{name}_derivative': getattr(by, name)
                for name in ('position', 'velocity', 'acceleration')})

    def _batch(
        self, request: srv.InverseDynamicsBatch.Request,
        response: srv.InverseDynamicsBatch.Response,
    ) -> None:
        dynamics = self._dynamics().unchecked
        order = JointOrder(dynamics.arm, request.joint_names)
        q = order.positions(request.position)
        v = order.rates(request.velocity, len(q), 'velocity')
        a = order.rates(request.acceleration, len(q), 'acceleration')
        effort = dynamics.inverse_dynamics_batch(q, v, a)
        response.joint_names = list(order.names)
        _fill(response, order.answer, effort=effort)
        response.warnings = limit_warnings(dynamics.arm, q, v, effort)
        if dynamics.arm.actuators is not None:
            response.warnings += motor_warnings(
                dynamics.arm, dynamics.arm.actuators.load(effort, v, a))

    def _trajectory(
        self,
        request: srv.InverseDynamicsTrajectory.Request,
        response: srv.InverseDynamicsTrajectory.Response,
    ) -> None:
        dynamics = self._dynamics()
        if not request.trajectory.joint_names:
            request.trajectory.joint_names = list(dynamics.arm.joint_names)
        trajectory = trajectory_from_ros(request.trajectory, dynamics.arm.joint_names)
        result = efforts_along(dynamics, trajectory)
        order = JointOrder(dynamics.arm, request.trajectory.joint_names)
        response.trajectory = with_efforts(request.trajectory, order.answer(result.efforts))
        response.message = worst_in_words(result)
        response.warnings = motion_excesses(dynamics.arm, trajectory)
        if not result.feasible:
            response.warnings += [response.message]
        response.feasible = not response.warnings
        response.worst_joint = result.worst_joint
        response.worst_ratio = result.worst_ratio
        response.worst_time = result.worst_time

    def _retime(
        self, request: srv.RetimeTrajectory.Request, response: srv.RetimeTrajectory.Response,
    ) -> None:
        controller = self._used()
        dynamics, options = controller.load.planning, controller.options
        names = request.trajectory.joint_names = (
            list(request.trajectory.joint_names) or list(dynamics.arm.joint_names))
        trajectory = trajectory_from_ros(request.trajectory, dynamics.arm.joint_names)
        order = JointOrder(dynamics.arm, names)
        limits = request.acceleration_limits
        result = retime(
            dynamics, trajectory, request.method or 'fastest', request.corner_tolerance,
            order.effort(limits, 'acceleration_limits') if len(limits) else (),
            request.effort_limit_fraction or options.effort_limit_fraction,
            () if request.efforts_may_jump else PLANNED_RATE * np.broadcast_to(
                options.effort_rate, len(names)))
        message = trajectory_to_ros(result.trajectory, order)
        message.header = request.trajectory.header
        response.trajectory = with_efforts(message, order.answer(result.efforts))
        response.duration, response.ratio = result.duration, result.ratio
        response.limiting_joint = list(result.limiting_joint)
        response.limited_quantity = list(result.limited_quantity)
        response.message = result.summary
        response.warnings = list(result.warnings)

    def _forward_dynamics(
        self, request: srv.ForwardDynamics.Request, response: srv.ForwardDynamics.Response,
    ) -> None:
        dynamics, order, q, v = self._state_of(request, response)
        tau = order.effort(request.effort)
        wrenches = wrenches_from_ros(dynamics.arm, request.external_wrenches)
        a = dynamics.forward_dynamics(q, v, tau, wrenches)
        _fill(response, order.answer, acceleration=a)
        response.warnings = [
            *limit_warnings(dynamics.arm, q, v, tau),
            *_fill_motors(response, order, dynamics.arm, tau, v, a)]

    def _manipulator_equation(
        self, request: srv.ManipulatorEquation.Request, response: srv.ManipulatorEquation.Response,
    ) -> None:
        dynamics, order, q, v = self._state_of(request, response)
        body = dynamics.rigid_body
        nonlinear = body.nonlinear(q, v)
        _fill(response, order.answer, gravity=body.gravity(q), nonlinear=nonlinear,
              friction=dynamics.friction.effort(v, nonlinear))
        _fill(response, order.answer_form, mass_matrix=body.mass_matrix(q),
              coriolis_matrix=body.coriolis_matrix(q, v))
        if request.include_christoffel:
            _fill(response, order.answer_form, christoffel=body.christoffel_symbols(q))
        response.kinetic_energy = body.kinetic_energy(q, v)
        response.potential_energy = body.potential_energy(q)
        response.warnings = limit_warnings(dynamics.arm, q, v)

    def _task_space(
        self, request: srv.TaskSpace.Request, response: srv.TaskSpace.Response,
    ) -> None:
        arm, point = self._dynamics().arm, request.point
        task = TaskSpaceOfPoint(
            arm, request.frame, (point.x, point.y, point.z), request.reference or 'base_aligned')
        order = JointOrder(arm, request.joint_names)
        q = order.positions(request.position)
        if not len(q):
            raise InvalidInputError(
                f'position has 0 values, expected samples × {len(order.names)} joints '
                f'({list(order.names)}), row by row')
        v = order.rates(request.velocity, len(q), 'velocity')
        response.joint_names = list(order.names)
        for i in range(0, len(q), _PART):
            states = task.unchecked_batch(q[i:i + _PART], v[i:i + _PART])
            add_task_space(response, states, order)
        response.warnings = limit_warnings(arm, q, v)

    def _set_payload(
        self, request: srv.SetPayload.Request, response: srv.SetPayload.Response,
    ) -> None:
        seconds = check_scalar('transition_time', request.transition_time, minimum=0.0)
        if self._served() is None and self._payloads.payloads and (
                request.payload.inertia.m == 0.0):
            response.message = self._payloads.remove(request.payload.header.frame_id)
            return
        controller = self._used()
        response.message = self._payloads.change(controller, request.payload, seconds)
        response.warnings = self._payloads.warnings(controller.arm)


def _fill(
    response: Any, in_order: Callable[[FloatArray], FloatArray], **values: FloatArray,
) -> None:
    """Fill in fields of a response with arrays over joints; `in_order` is of a JointOrder."""
    for name, value in values.items():
        setattr(response, name, floats_to_ros(in_order(value)))


def _fill_motors(
    response: Any, order: JointOrder, arm: ArmModel, effort: FloatArray, v: FloatArray,
    a: FloatArray,
) -> list[str]:
    """Fill in currents and voltages for an effort, if motors are known; return warnings."""
    if arm.actuators is None:
        return []
    load = arm.actuators.load(effort, v, a)
    _fill(response, order.answer, motor_current=load.current, motor_voltage=load.voltage,
          current_ratio=load.current_ratio, voltage_ratio=load.voltage_ratio)
    return motor_warnings(arm, load)
