# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The model of `dynamics`, made again from its description, its parameters and its payloads."""

from collections.abc import Callable
import math
from typing import Any

import numpy as np
from rclpy.node import Node
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.arm_parameters import arm_from_parameters, convention_from_parameters
from robot_dynamics.model.payload import describe_payloads, Payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.base_gravity import BaseGravity
from robot_dynamics.ros.dynamics.external_effort_fault import CONTACT_SPECS, OBSERVER_SPECS
from robot_dynamics.ros.middleware.diagnostics import ERROR, OK, Status, WARN
from robot_dynamics.ros.parameters import robot_description
from robot_dynamics.ros.parameters.declared_parameters import Values

MODEL_NAMES = (
    *(spec.name for spec in (
        *robot_description.FRICTION_SPECS, *robot_description.ACTUATOR_SPECS,
        *robot_description.DRIVE_SPECS, *robot_description.UNCERTAINTY_SPECS)),
    'joints', 'gravity', 'imu_rpy', 'measured_effort', 'robot_compensates', 'robot_gravity')
"""Parameters of `dynamics` that describe the model."""
NAMES = (
    *MODEL_NAMES, *(spec.name for spec in (*OBSERVER_SPECS, *CONTACT_SPECS)),
    'state_max_age', 'lock_step', 'command', 'friction_compensation',
    'use_sim_time')
"""All parameters of `dynamics` that are used."""


class Followed:
    """The model in use, which is never changed; `values` are the parameters of `dynamics`."""

    def __init__(
        self, base: ArmModel, xml: str, values: Values, gravity: FloatArray,
        payloads: tuple[Payload, ...], is_embedded: bool,
    ) -> None:
        """
        Take the arm without loads of the URDF `xml`.

        `gravity` (3,) [m/s²] is the present one. Raises InvalidInputError if the arm lacks the
        link of a payload.
        """
        self.base, self.xml, self.values, self.is_embedded = base, xml, values, is_embedded
        self.payloads = payloads
        unloaded = base.with_gravity(gravity)
        self.arm = unloaded.with_payloads(payloads)
        """The arm with its loads and the present gravity."""
        self.convention: EffortConvention = convention_from_parameters(values)
        own = self.convention.robot_gravity
        self._robot = UncheckedArmDynamics(unloaded if own is None else base.with_gravity(own))

    def robot_gravity(self, q: FloatArray) -> FloatArray:
        """Return the gravity-compensation torque (n,) of the robot, which knows no loads."""
        return self._robot.rigid_body.gravity(q)


class FollowedModel:
    """Makes the model again after each change; all calls are in the executor."""

    def __init__(
        self, node: Node, use: Callable[[Followed | None], None], own: Callable[[], Values],
    ) -> None:
        """
        Follow for a node, whose `own` parameters add to those of `dynamics`.

        `use` is called with each model, and with None if there is none any more.
        """
        self._own = own
        self._node, self._use = node, use
        self._xml = ''
        self._values: Values = {}
        self._payloads: tuple[Payload, ...] = ()
        self._imu: BaseGravity | None = None
        self._gravity: FloatArray | None = None
        """Gravity (3,) [m/s²] of the IMU."""
        self._current: Followed | None = None
        self._obstacle = ''

    def set_model(self, xml: str, values: Values) -> None:
        """Use the URDF and the parameters of `dynamics`."""
        name = robot_description.REPORT_COVARIANCE_SPEC.name
        values = {**values, name: self._own()[name]}
        is_other = xml != self._xml or any(
            values[name] != self._values.get(name) for name in MODEL_NAMES if name != 'gravity')
        self._xml, self._values = xml, values
        if values['imu_rpy'] and self._imu is None:
            self._imu = BaseGravity(self._node, lambda: self._values, self._use_gravity)
        self._make(is_other)

    def set_payloads(self, payloads: tuple[Payload, ...]) -> None:
        """Use the payloads of `dynamics`."""
        self._payloads = payloads
        self._make()

    def _use_gravity(self, gravity: FloatArray) -> None:
        """Use the gravity (3,) of the IMU at once; only a command must not jump."""
        self._gravity = gravity
        self._make()

    def _make(self, is_other: bool = False) -> None:
        """Make the model from what is known; `is_other` is whether its description has changed."""
        if not self._values:
            return
        values, current, was = self._values, self._current, self._obstacle
        try:
            base = current.base if current is not None and not is_other else (
                arm_from_parameters(self._xml, values))
            gravity = self._gravity if values['imu_rpy'] and (
                self._gravity is not None) else np.array(values['gravity'])
            self._current = Followed(
                base, self._xml, values, gravity, self._payloads,
                self._xml == default_arm_urdf())
            self._use(self._current)
            self._obstacle = ''
        except RobotDynamicsError as error:
            self._current, self._obstacle = None, str(error)
            self._use(None)
            if was != self._obstacle:
                self._node.get_logger().error(f'No model: {error}')
        model = self._current
        if model is not None and (current is None or current.base is not model.base):
            self._node.get_logger().info(
                f'Model {model.arm.name!r}: joints {list(model.arm.joint_names)}')

    def statuses(self) -> list[Status]:
        """Return the model and its loads, for the diagnostics."""
        model: Any = self._current
        if model is None:
            words = self._obstacle or 'none yet'
            return [Status('model', ERROR if self._obstacle else WARN, words, {})]
        imu = self._imu.status() if self._imu and model.values['imu_rpy'] else None
        level, words = (OK, '') if imu is None or imu.level == OK else (
            imu.level, f'; {imu.message}')
        return [
            Status('model', level, f'{model.arm.name}{words}', {
                'gravity': [round(float(g), 3) for g in model.arm.gravity]}),
            Status('payload', OK, describe_payloads(model.payloads), {
                'payloads': len(model.payloads),
                'mass': math.fsum(one.mass for one in model.payloads)})]
