# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The model of the running node `dynamics`, made again from description, parameters and payloads.

Parameters are requested when the node appears or restarts, which a new publisher of `~/payload`
shows, after each description, and when /parameter_events names the node.
"""

from collections.abc import Callable
import math
import time
from typing import Any

from geometry_msgs.msg import Inertia, InertiaStamped
import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
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
from robot_dynamics.ros.dynamics.model_source import LATCHED
from robot_dynamics.ros.dynamics.payloads import ALL_PAYLOADS
from robot_dynamics.ros.middleware.conversions import payload_from_ros
from robot_dynamics.ros.middleware.diagnostics import ERROR, OK, Status, WARN
from robot_dynamics.ros.middleware.pausing_timer import PausingTimer
from robot_dynamics.ros.parameters import robot_description
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics.urdf.document import LARGEST_DESCRIPTION
from std_msgs.msg import String

PERIOD = 0.5
"""[s] between two checks whether the node is there."""
PATIENCE = 5.0
"""[s] for an answer of the node."""
SETTLE = 0.05
"""[s] after which all messages of `~/payload` with one stamp have arrived."""

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
    """Follows `dynamics`, and makes its model again after each change, all in the executor."""

    def __init__(
        self, node: Node, name: str, use: Callable[[Followed | None], None],
        own: Callable[[], Values],
    ) -> None:
        """
        Follow the node with a full `name`, for a node whose `own` parameters add to its own.

        `use` is called with each model, and with None if there is none any more.
        """
        self.name, self._node, self._use, self._own = name, node, use, own
        self._description = self._xml = ''
        """The newest URDF, and that of the values."""
        self._values: Values = {}
        self._publishers: frozenset[bytes] = frozenset()
        self._is_due = self._has_values = False
        self._request: Any = None
        self._requested_at = 0.0
        self._stamp: Any = None
        self._new_payloads: list[Payload] = []
        self._payloads: tuple[Payload, ...] = ()
        self._known: dict[str, tuple[Inertia, Payload | None]] = {}
        """Payloads by link, so that one that has not changed remains the same object."""
        self._imu: BaseGravity | None = None
        self._gravity: FloatArray | None = None
        """Gravity (3,) [m/s²] of the IMU."""
        self._current: Followed | None = None
        self._lack = self._obstacle = ''
        """Why there are no parameters, and no model."""
        self._client = node.create_client(GetParameters, f'{name}/get_parameters')
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, qos_profile_parameter_events)
        node.create_subscription(InertiaStamped, f'{name}/payload', self._on_payload, ALL_PAYLOADS)
        node.create_subscription(
            String, f'{name}/robot_description', self._on_description, LATCHED,
            largest=LARGEST_DESCRIPTION)
        self._settle = PausingTimer(node, SETTLE, self._use_payloads)
        node.create_timer(PERIOD, self._look)
        node.get_logger().info(f'Waiting for the parameters of the node {name}.')

    # ------------------------------------------------------------------ description, parameters

    def _on_description(self, message: String) -> None:
        self._description, self._is_due = message.data, True
        self._ask()

    def _look(self) -> None:
        found = frozenset(
            bytes(end.endpoint_gid)
            for end in self._node.get_publishers_info_by_topic(f'{self.name}/payload'))
        self._is_due = self._is_due or bool(found - self._publishers)
        self._publishers = found
        if self._request is not None and time.monotonic() - self._requested_at > PATIENCE:
            self._client.remove_pending_request(self._request)
            self._request, self._is_due = None, True
        self._ask()

    def _on_event(self, event: ParameterEvent) -> None:
        if event.node == self.name and any(
                one.name in NAMES for one in event.changed_parameters):
            self._is_due = True
            self._ask()

    def _ask(self) -> None:
        if self._is_due and self._request is None and self._client.service_is_ready():
            self._is_due, self._requested_at = False, time.monotonic()
            self._request = self._client.call_async(GetParameters.Request(names=list(NAMES)))
            self._request.add_done_callback(self._on_answer)

    def _on_answer(self, request: Any) -> None:
        if request is not self._request:  # answered too late
            return
        self._request = None
        found = dict(zip(NAMES, map(parameter_value_to_python, request.result().values)))
        missing = [name for name in NAMES if found.get(name) is None]
        self._lack = (
            f'{self.name} has no parameters {missing}, expected a node dynamics of the version '
            'of this node') if missing else ''
        self._has_values = self._has_values or not missing
        if not missing and self._description:
            self._set_values({
                name: value if isinstance(value, (bool, int, float, str)) else tuple(value)
                for name, value in found.items()})
        self._ask()

    def _set_values(self, values: Values) -> None:
        """Use the newest URDF and parameters of `dynamics`."""
        name = robot_description.REPORT_COVARIANCE_SPEC.name
        values = {**values, name: self._own()[name]}
        is_other = self._description != self._xml or any(
            values[name] != self._values.get(name) for name in MODEL_NAMES if name != 'gravity')
        self._xml, self._values = self._description, values
        if values['imu_rpy'] and self._imu is None:
            self._imu = BaseGravity(self._node, lambda: self._values, self._use_gravity)
        self._make(is_other)

    # ------------------------------------------------------------------ payloads

    def _on_payload(self, message: InertiaStamped) -> None:
        """Collect the messages of one stamp: one per payload, m = 0 without a payload."""
        if message.header.stamp != self._stamp:
            self._stamp, self._new_payloads = message.header.stamp, []
        link, inertia = message.header.frame_id, message.inertia
        known, payload = self._known.get(link, (None, None))
        if inertia != known:
            payload = payload_from_ros(None, message)
            self._known[link] = inertia, payload
        if payload is not None:
            self._new_payloads.append(payload)
        self._settle.run(False)
        self._settle.run(True)

    def _use_payloads(self) -> None:
        self._settle.run(False)
        self._payloads = tuple(self._new_payloads)
        self._make()

    # ------------------------------------------------------------------ the model

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

    # ------------------------------------------------------------------ diagnostics

    def statuses(self) -> list[Status]:
        """Return whether the node is there, the model and its loads, for the diagnostics."""
        model: Any = self._current
        if model is None:
            words = self._obstacle or 'none yet'
            return [self._status_of_node(),
                    Status('model', ERROR if self._obstacle else WARN, words, {})]
        imu = self._imu.status() if self._imu and model.values['imu_rpy'] else None
        level, words = (OK, '') if imu is None or imu.level == OK else (
            imu.level, f'; {imu.message}')
        return [
            self._status_of_node(),
            Status('model', level, f'{model.arm.name}{words}', {
                'gravity': [round(float(g), 3) for g in model.arm.gravity]}),
            Status('payload', OK, describe_payloads(model.payloads), {
                'payloads': len(model.payloads),
                'mass': math.fsum(one.mass for one in model.payloads)})]

    def _status_of_node(self) -> Status:
        if not self._publishers:
            others = sorted(
                name.removesuffix('/payload')
                for name, kinds in self._node.get_topic_names_and_types()
                if name.endswith('/payload') and 'geometry_msgs/msg/InertiaStamped' in kinds
                and self._node.count_publishers(name))
            return Status('dynamics', WARN, (
                f'no node {self.name} (parameter dynamics), those that run: '
                f'{", ".join(others) or "none"}' + (
                    '; its last parameters are used' if self._has_values else '')), {})
        if self._lack:
            return Status('dynamics', ERROR, self._lack, {})
        if not self._has_values:
            return Status('dynamics', WARN, f'waiting for the parameters of {self.name}', {})
        return Status('dynamics', OK, f'follows {self.name}', {})
