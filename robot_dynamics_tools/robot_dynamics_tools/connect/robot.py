# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Who publishes joint states and the pose of the base, receives efforts, and commands them."""

from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from rclpy.qos import qos_profile_sensor_data
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.base_gravity import gravity_from_imu
from robot_dynamics.ros.dynamics.silence import JOINT_STATE, NUMBERS
from robot_dynamics.ros.middleware.graph_watch import full_name, subscribers
from robot_dynamics_tools.connect.checks import BAD, Checklist, GOOD, UNKNOWN
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from sensor_msgs.msg import Imu

COMMANDS = '/commands'
"""End of the topics of ros2_control controllers."""
ASKED = {'joints': list, 'interface_name': str, 'command_timeout': float}
"""Parameters of a receiver: of controllers of ros2_control, and of `simulated_arm`."""


class Receiver(NamedTuple):
    """
    A topic of efforts, and a node that subscribes to it.

    `joints` and `interface` are those of a controller of ros2_control, `timeout` [s] the
    `command_timeout` of `simulated_arm`; empty and None if the node does not state them.
    """

    topic: str
    node: str
    joints: Sequence[str]
    interface: str
    timeout: float | None

    @property
    def is_controller(self) -> bool:
        return self.topic.endswith(COMMANDS)

    @property
    def remap(self) -> str:
        """The remapping of `dynamics_node` to this topic."""
        return f'{"~/commands" if self.is_controller else "effort_command"}:={self.topic}'

    def __str__(self) -> str:
        claimed = ', '.join(f'{joint}/{self.interface}' for joint in self.joints)
        return f'{self.topic} to {self.node}' + (f', for {claimed}' if claimed else '')


def publishers(client: DynamicsClient, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic."""
    return sorted(full_name(end.node_name, end.node_namespace)
                  for end in client.node.get_publishers_info_by_topic(topic))


def topic_of_states(client: DynamicsClient, given: str | None) -> str:
    """Return the topic of the joint states; raise NoAnswerError or InvalidInputError."""
    def found() -> list[str]:
        return [name for name, kinds in client.node.get_topic_names_and_types()
                if JOINT_STATE in kinds and client.node.count_publishers(name)]

    def fit() -> list[str]:
        return [name for name in found()
                if (name == given if given else name.endswith('joint_states'))]

    if client.wait(fit):  # others may be discovered later
        client.wait(lambda: given or '/joint_states' in fit(), 1.0)
    topics = fit()
    if not topics:
        raise NoAnswerError(
            f'no joint states on {given or "a topic .../joint_states"} in {client.timeout:g} s; '
            f'published topics of this type: {", ".join(found()) or "none"}. Start the '
            'driver, name the topic with --topic, or set the ROS_DOMAIN_ID of the robot')
    if len(topics) > 1 and '/joint_states' not in topics:
        raise InvalidInputError(
            f'there are joint states on {", ".join(topics)}, expected --topic with one of them')
    return topics[0] if len(topics) == 1 else '/joint_states'


def find_receiver(
    client: DynamicsClient, given: str | None, states: str, is_needed: bool, checks: Checklist,
) -> Receiver | None:
    """
    Return who receives efforts, None without a receiver.

    `given` is a topic, `states` that of the joint states.
    """
    usual = given or f'{states.rpartition("/")[0]}/effort_command'
    found, watching, drivers = list[Receiver](), list[str](), publishers(client, states)
    for topic, kinds in client.node.get_topic_names_and_types():
        if topic == given and not {JOINT_STATE, NUMBERS} & set(kinds):
            raise InvalidInputError(
                f'--receiver {topic} has the type {kinds[0]}, expected {JOINT_STATE} or {NUMBERS}')
        if topic == usual or not given and NUMBERS in kinds and topic.endswith(COMMANDS):
            nodes, observers = subscribers(client.node, topic)
            watching += observers
            for node in nodes:
                stated = dict[str, Any]()
                with suppress(NoAnswerError):  # it may have no parameter service
                    for name in ASKED:  # one by one: an undeclared one prevents other answers
                        stated |= client.parameters([name], node)
                stated = {name: x for name, x in stated.items() if isinstance(x, ASKED[name])}
                found.append(Receiver(
                    topic, node, stated.get('joints') or (),
                    stated.get('interface_name') or 'effort', stated.get('command_timeout')))
    fit = [one for one in found if one.interface == 'effort']
    chosen = [one for one in fit if one.topic == usual] or fit
    if len(chosen) > 1:
        chosen = [one for one in chosen if one.node in drivers]
    is_known = given or chosen and (chosen[0].is_controller or chosen[0].node in drivers)
    checks.add(
        'receiver', bool(is_known) if len(chosen) == 1 else BAD if is_needed else False,
        ('; '.join(map(str, found)) or 'none') + ('' if is_known or not chosen else (
            ', which publishes no joint states')) + (
                f'; only observe: {", ".join(watching)}' if watching else ''),
        f'one receiver of efforts, {usual}' + ('' if given else ' or an effort controller'),
        'name the topic of the arm with --receiver; start the driver or its effort controller')
    if len(chosen) != 1:
        return None
    timeout = chosen[0].timeout
    keeps_last = chosen[0].is_controller or timeout == 0.0
    if chosen[0].is_controller:
        _check_controllers(client, chosen[0], is_needed, checks)
    checks.add(
        'watchdog', False if keeps_last else UNKNOWN if timeout is None else GOOD,
        'none: the last command stays active' if keeps_last else
        'not stated by the receiver' if timeout is None else f'after {timeout:g} s',
        'the arm is braked soon after the last command',
        'brakes or another controller must hold the arm if dynamics_node is killed')
    return chosen[0]


def _check_controllers(
    client: DynamicsClient, receiver: Receiver, is_needed: bool, checks: Checklist,
) -> None:
    """Check by the controller manager that the controller is active, and claims the efforts."""
    namespace, _, name = receiver.node.rpartition('/')
    service, expected = f'{namespace}/controller_manager/list_controllers', 'active, with effort'
    try:
        kind = import_module('controller_manager_msgs.srv').ListControllers
        found = client.call(kind, service, kind.Request()).controller
    except (ImportError, RobotDynamicsError) as error:
        checks.add('controller', UNKNOWN, f'state of {name} not read: {error}', expected,
                   'ros2 control list_controllers --claimed-interfaces')
        return
    listed = [f'{one.name} is {one.state}' + (
        f', claims {", ".join(one.claimed_interfaces)}' if one.claimed_interfaces else '')
        for one in found if one.name == name or one.claimed_interfaces]
    wanted = {f'{joint}/effort' for joint in receiver.joints}
    is_ready = any(one.name == name and one.state == 'active'
                   and wanted <= set(one.claimed_interfaces) for one in found)
    checks.add('controller', is_ready or (BAD if is_needed else False),
               '; '.join(listed) or f'{name} is not loaded', expected,
               f'ros2 control switch_controllers --activate {name}')


def gravity_of_imu(
    client: DynamicsClient, arm: ArmModel, checks: Checklist,
) -> tuple[FloatArray, str] | None:
    """Return gravity (3,) [m/s²] by an IMU that the description fixes to the base, and which."""
    size = float(np.linalg.norm(arm.gravity))
    for topic, kinds in client.node.get_topic_names_and_types():
        if 'sensor_msgs/msg/Imu' not in kinds or not client.node.count_publishers(topic):
            continue
        message = client.receive(Imu, topic, qos_profile_sensor_data, lambda one: one)
        if message is None:
            continue
        try:
            place = arm.link_frame(message.header.frame_id)
            if place.parentJoint:
                continue  # of a link that moves
            gravity = place.placement.rotation @ gravity_from_imu(message, size)
        except InvalidInputError as error:
            checks.add('IMU', UNKNOWN, f'{topic}: {error}', 'a link that is fixed to the base',
                       'state the mount: --gravity X Y Z')
            continue
        gravity *= size / np.linalg.norm(gravity)
        checks.add('IMU', GOOD, f'{topic} of {message.header.frame_id}: gravity '
                   f'({gravity.round(2).tolist()})', 'at rest')
        return gravity, topic
    return None
