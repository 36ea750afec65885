# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The description of the robot: its source, its joints, the check of its model, its limits."""

from collections.abc import Mapping, Sequence
import math
import sys
from typing import Any

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model_check.report import check_description, NEXT_STEPS
from robot_dynamics.ros.parameters.payloads import PAYLOAD_SPECS, payloads_at_start
from robot_dynamics.validation import check_scalar, LARGEST_VALUE
from robot_dynamics_tools.connect.checks import BAD, Checklist, GOOD
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, LATCHED, NoAnswerError
from robot_dynamics_tools.urdf_editing import with_continuous_joints, with_elements
from std_msgs.msg import String

LIMITS = 'velocity', 'effort'


def published_description(client: DynamicsClient, namespace: str) -> tuple[str, str]:
    """Return the URDF on a topic robot_description, and the topic; raise NoAnswerError."""
    topics = list(dict.fromkeys([f'{namespace}/robot_description', '/robot_description']))
    for topic in topics:
        if client.node.count_publishers(topic):
            text = client.receive(String, topic, LATCHED, lambda message: str(message.data))
            if text:
                return text, topic
    raise NoAnswerError(
        f'no description on {" or ".join(topics)}, expected robot_state_publisher, or --urdf FILE')


def _arm(urdf: str, given: Mapping[str, Any], joints: Sequence[str]) -> ArmModel:
    """Return the arm of a URDF with the parameters `given`, their payloads included."""
    values = {spec.name: spec.default for spec in PAYLOAD_SPECS} | dict(given)
    return arm_from_parameters(urdf, values, joints).with_payloads(payloads_at_start(values))


def checked_arm(
    urdf: str, source: str, joints: Sequence[str], published: Sequence[str],
    given: Mapping[str, Any], limits: Mapping[str, Sequence[str]], may_ask: bool,
    checks: Checklist,
) -> tuple[str, ArmModel | None]:
    """
    Return the URDF with all limits, and its arm with the joints that are published.

    `given` are parameters of `dynamics_node`. `limits` has velocity and effort by joint. Limits
    that are missing are asked for on the terminal if that `may_ask`. There is no arm if no joint
    is published.
    """
    urdf, changed = with_continuous_joints(urdf)
    robot = arm_from_urdf(urdf)
    checks.add('description', GOOD, f'{robot.name}, {robot.joint_count} joints, of {source}' + (
        f'; revolute without <limit>, used as continuous: {", ".join(changed)}'
        if changed else ''), 'a URDF')
    known = list(joints or robot.joint_names)
    used = [name for name in known if name in published]
    missing, other = ([name for name in one if name not in two] for one, two in (
        (known, published), (published, known)))
    checks.add(
        'joints', BAD if not used or joints and missing else not missing, '; '.join([
            ', '.join(used) or 'none', *(f'{what}: {", ".join(names)}' for what, names in (
                ('not published', missing), ('ignored', other)) if names)]),
        'the joints of the description, by name',
        'name the joints of the arm with --joints (others are locked), its topic with --topic, or '
        'use the description that the driver uses (with the same prefix: --xacro prefix:=PREFIX)')
    if not used:
        return urdf, None
    branches = _branches(arm_from_urdf(urdf, used))
    if branches and not joints:
        checks.add('gripper', BAD, f'{", ".join(branches)} may be a gripper',
                   'one chain of joints that no other joint mimics',
                   'name the joints of the arm: --joints ' + ' '.join(
                       name for name in used if name not in branches))
    urdf, arm = _completed(urdf, used, given, limits, may_ask, checks)
    for finding in check_description(urdf, used, arm).findings:
        checks.add(f'model {finding.check}', BAD if finding.level == 'error' else False,
                   finding.message, 'a consistent model', NEXT_STEPS[finding.check])
    return urdf, arm


def _branches(arm: ArmModel) -> list[str]:
    """Return joints that share their nearest moving ancestor, and those that others mimic."""
    model, after = arm.pinocchio_model, dict[str, list[str]]()
    for name in arm.joint_names:
        j = model.parents[model.getJointId(name)]
        while j and model.names[j] not in arm.joint_names:
            j = model.parents[j]
        after.setdefault(model.names[j], []).append(name)
    led = {joint.leader for joint in arm.mimic_joints}
    return [name for group in after.values() for name in group if len(group) > 1 or name in led]


def _completed(
    urdf: str, joints: Sequence[str], given: Mapping[str, Any],
    stated: Mapping[str, Sequence[str]], may_ask: bool, checks: Checklist,
) -> tuple[str, ArmModel]:
    """Return the URDF with the stated limits, and with those that the user types; and its arm."""
    for name in stated:
        if name not in joints:
            raise InvalidInputError(
                f'--limit has joint {name!r}, expected one of: {", ".join(joints)}')
    if stated and given.get('effort.limit'):
        raise InvalidInputError('effort.limit of --parameters replaces the efforts of --limit, '
                                'expected only one of them')
    values = {name: {what: _checked(f'--limit {name}: {what}', text)
                     for what, text in zip(LIMITS, pair)} for name, pair in stated.items()}
    arm = _arm(with_elements(urdf, {}, {}, values), given, joints)
    missing = [(name, what) for what in LIMITS
               for name, limit in zip(joints, getattr(arm.limits, what)) if math.isinf(limit)]
    for name, what in missing if may_ask else ():
        text = _typed(f'{what} limit of {name}')
        if not text:
            break
        values.setdefault(name, {})[what] = text
    if any(values.values()):
        urdf = with_elements(urdf, {}, {}, values)
        arm = _arm(urdf, given, joints)
    missing = [one for one in missing if one[1] not in values.get(one[0], {})]
    checks.add('limits', BAD if missing else GOOD, (
        f'missing or 0: {", ".join(f"{what} of {name}" for name, what in missing)}'
        if missing else 'velocity and effort ' + ', '.join(
            f'{name} {v:g} {e:g}' for name, v, e in zip(
                joints, arm.limits.velocity, arm.limits.effort))),
        'each above 0, from the data sheet', '--limit JOINT VELOCITY EFFORT for each')
    return urdf, arm


def _typed(what: str) -> str:
    """Return the limit that the user types, '' for none."""
    while True:
        print(f'{what} [SI units, from the data sheet; Enter for none]: ', end='', flush=True)
        text = sys.stdin.readline().strip()
        try:
            return text and _checked(what, text)
        except InvalidInputError as error:
            print(error)


def _checked(what: str, text: str) -> str:
    """Return the text of a limit; raise InvalidInputError if it is no number above 0."""
    try:
        check_scalar(what, float(text), 0.0, LARGEST_VALUE, exclusive_minimum=True)
    except ValueError:
        raise InvalidInputError(f'{what} is {text!r}, expected a number above 0') from None
    return text
