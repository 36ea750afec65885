# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The source of the model of `dynamics`: parameters, a topic, or the embedded arm.

A description on the topic replaces the embedded arm at once. It replaces another description when
no command is published. ~/robot_description contains the one in use, for other nodes.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from subprocess import SubprocessError
from threading import Thread
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.worst_gravity import BRIEF, QUICK
from robot_dynamics.model_check.finding import refuse_errors
from robot_dynamics.model_check.mesh_check import lines_of_meshes
from robot_dynamics.model_check.report import check_description
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.parameters import options_from
from robot_dynamics.ros.dynamics.payloads import PayloadKeeper
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics.ros.parameters.robot_description import (
    check_joint_count,
    description_from_parameters,
)
from robot_dynamics.urdf.document import LARGEST_DESCRIPTION
from std_msgs.msg import String

NEAR = 1e-3
"""Relative difference, or [rad, m, N·m, N], of numbers that are the same."""
LARGEST_ARM = 12
"""Largest number of joints for the quick search at the start; above it, the brief search runs."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class _Model(NamedTuple):
    xml: str
    arm: ArmModel
    is_embedded: bool = False


class ModelSource:
    """Loads the first model, and replaces it."""

    def __init__(
        self, node: Node, values: Callable[[], Values], payloads: PayloadKeeper,
        is_commanding: Callable[[], bool], use: Callable[[ArmModel, bool], None],
    ) -> None:
        """
        Take the dependencies of a model.

        `values` returns the parameters; `is_commanding` whether efforts are published; `use`
        serves an arm from now on, which may be the embedded one, or raises RobotDynamicsError.
        """
        self._node, self._values, self._payloads = node, values, payloads
        self._is_commanding, self._use = is_commanding, use
        self._current: _Model | None = None
        self.waiting: _Model | None = None
        """A new model that waits until it can be loaded."""
        self.differences: list[str] = []
        """Why the description of the parameters is not that on the topic, which is ignored."""
        self._subscription: Any = None
        self._in_use = node.create_publisher(String, '~/robot_description', LATCHED)

    def load(self) -> None:
        """Use the first model, or wait for one; raise RobotDynamicsError for an invalid one."""
        values = self._values()
        xml = description_from_parameters(values)
        if xml is not None:
            self._take(_Model(xml, self._checked_arm(xml)))
            self._subscribe(self._compare)
            return
        obstacle = self._obstacle_of_embedded_arm()
        if obstacle:
            self._node.get_logger().warning(
                f'{obstacle}. Waiting for a URDF on the topic robot_description; alternatively '
                'set robot_description_file.')
        else:
            self._use_embedded_arm()
        self._subscribe(self._on_description)

    def _subscribe(self, callback: Callable[[String], None]) -> None:
        if self._subscription is None:
            self._subscription = self._node.create_subscription(
                String, 'robot_description', callback, LATCHED,
                refuse=self._refuse, largest=LARGEST_DESCRIPTION)

    def forget(self) -> None:
        """Forget all models, until `load`."""
        self._current = self.waiting = None
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def take_waiting(self) -> None:
        """Use the waiting model, if that is possible now."""
        waiting = self.waiting
        if waiting is None or self._is_commanding() or not self._payloads.suit(waiting.arm):
            return
        self.waiting = None
        try:
            self._take(waiting)
        except Exception as error:  # the parameters may have changed
            self._refuse(error)

    def _take(self, model: _Model) -> None:
        self._use(model.arm, model.is_embedded)
        self._current = model
        self._in_use.publish(String(data=model.xml))
        if '<mesh' in model.xml:
            Thread(target=self._check_meshes, args=[model.xml], daemon=True).start()

    def _check_meshes(self, xml: str) -> None:
        with suppress(OSError, SubprocessError):  # another process: it must not slow the command
            for line in lines_of_meshes(xml):
                self._node.get_logger().warning(f'Model check: {line}')

    def _obstacle_of_embedded_arm(self) -> str:
        """Return why the embedded arm cannot be used without a description, empty if it can."""
        values, topic = self._values(), self._node.resolve_topic_name('~/commands')
        try:
            load_arm(default_arm_urdf(), values['joints'], values['gravity'])
        except InvalidInputError:
            return f'joints is {list(values["joints"])}, but no robot_description was given'
        if topic != f'{self._node.get_fully_qualified_name()}/commands':
            return f'~/commands is remapped to {topic}, and no robot_description was given'
        return ''

    def _use_embedded_arm(self) -> None:
        xml = default_arm_urdf()
        model = _Model(xml, self._checked_arm(xml), is_embedded=True)
        if not self._payloads.suit(model.arm):  # they may belong to a later description
            self.waiting = model
            self._node.get_logger().error(f'No model in use: {self._payloads.obstacle}.')
            return
        self._take(model)
        self._node.get_logger().warning(
            'No robot_description was given: the embedded planar two-link arm is used, for '
            'joint states that contain joint1 and joint2 only. For a robot, set '
            'robot_description_file, or publish the topic robot_description.')

    def _on_description(self, message: String) -> None:
        self.waiting, current = None, self._current
        is_embedded = current is not None and current.is_embedded
        if current is not None and message.data == current.xml and not is_embedded:
            return
        model = _Model(message.data, self._checked_arm(message.data))
        if not self._payloads.suit(model.arm):
            self.waiting = model
            self._payloads.check(model.arm)
        elif self._is_commanding() and not is_embedded:
            self.waiting = model
            self._node.get_logger().error(
                'Kept the model in use while commanding: the new robot_description will be '
                'loaded after the command stops (no joint states, or ~/change_state).')
        else:
            self._take(model)

    def _compare(self, message: String) -> None:
        """Warn if the robot publishes another description than that of the parameters."""
        if self._current is not None and message.data != self._current.xml:
            found = differences(self._current.arm, arm_from_parameters(
                message.data, self._values(), self._current.arm.joint_names))
            self.differences = [
                'the description of the parameters is used, that on the topic robot_description '
                f'has {found}' for found in found[:1]]
            for words in self.differences:
                self._node.get_logger().warning(f'Another robot? {words}')

    def _refuse(self, error: Exception) -> None:
        self._node.get_logger().error(f'Kept the model in use: {describe_error(error)}')

    def _checked_arm(self, xml: str) -> ArmModel:
        """Return the arm of a description; raise RobotDynamicsError if it is invalid."""
        values = self._values()
        arm = arm_from_parameters(xml, values)
        check_joint_count(arm)
        check_or_refuse(xml, arm, values, self._node.get_logger())
        options_from(values, arm)
        return arm


def differences(ours: ArmModel, theirs: ArmModel) -> list[str]:
    """Return what another model of the same joints has instead; limits that one lacks agree."""
    found = []
    for field in fields(ours.limits):
        mine, other = getattr(ours.limits, field.name), getattr(theirs.limits, field.name)
        found += [f'the {field.name} limit {b:g} of {name}, not {a:g}' for name, a, b in zip(
            ours.joint_names, mine, other) if np.isfinite([a, b]).all() and abs(a - b) > NEAR]
    q = np.linspace(0.3, 0.9, ours.joint_count)  # no symmetric pose
    mine_body, other_body = RigidBody(ours), RigidBody(theirs)
    for what, a, b in (('g(q)', mine_body.gravity(q), other_body.gravity(q)),
                       ('M(q)', mine_body.mass_matrix(q), other_body.mass_matrix(q))):
        error = float(np.abs(a - b).max())
        if error > NEAR * max(float(np.abs(a).max()), 1.0):
            found.append(f'another {what}, by up to {error:.3g} of {np.abs(a).max():.3g}')
    return found


def check_or_refuse(xml: str, arm: ArmModel, values: Values, logger: Any) -> None:
    """
    Log findings and scope of the model check; raise ModelError with the first error not ignored.

    `arm` is the model of the URDF `xml` with the parameters `values`. Meshes are not read, and the
    search for the worst gravity is quick; the tool check_model reads them and searches fully.
    """
    ignored = values['ignore_checks']
    search = QUICK if arm.joint_count <= LARGEST_ARM else BRIEF
    checked = check_description(xml, arm=arm, search=search)
    refuse_errors(checked.findings, ignored)
    for finding in checked.findings:
        logger.warning(f'Model check: {finding}')
    if checked.findings or checked.unread:
        logger.info(f'Model check: {checked.counts}. Scope: {checked.scope}')
