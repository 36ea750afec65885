# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The description of the robot: its source, its joints, the check of its model, its limits."""

from collections.abc import Mapping, Sequence
import math
import sys

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model_check.report import check_description, NEXT_STEPS
from robot_dynamics.urdf.editing import with_continuous_joints, with_elements
from robot_dynamics.validation import check_scalar, LARGEST_VALUE
from robot_dynamics_tools.connect.checks import BAD, Checklist, GOOD
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, LATCHED, NoAnswerError
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


def checked_arm(
    urdf: str, source: str, joints: Sequence[str], published: Sequence[str],
    limits: Mapping[str, Sequence[str]], may_ask: bool, checks: Checklist,
) -> tuple[str, ArmModel | None]:
    """
    Return the URDF with all limits, and its arm with the joints that are published.

    `limits` has velocity and effort by joint. Limits that are missing are asked for on the
    terminal if that `may_ask`. There is no arm if no joint is published.
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
        'the joints of the description, by name', _remedy(known, published))
    if not used:
        return urdf, None
    arm = arm_from_urdf(urdf, used)
    branches = _branches(arm)
    if branches and not joints:
        checks.add('gripper', BAD, f'{", ".join(branches)} may be a gripper',
                   'one chain of joints that no other joint mimics',
                   'name the joints of the arm: --joints ' + ' '.join(
                       name for name in used if name not in branches))
    urdf = _completed(urdf, arm, limits, may_ask, checks)
    arm = arm_from_urdf(urdf, used)
    for finding in check_description(urdf, used, arm).findings:
        checks.add(f'model {finding.check}', BAD if finding.level == 'error' else False,
                   finding.message, 'a consistent model', NEXT_STEPS[finding.check])
    return urdf, arm


def _remedy(known: Sequence[str], published: Sequence[str]) -> str:
    """Return what to do if joints are not published."""
    prefixes = {theirs.removesuffix(known[0]) for theirs in published if theirs.endswith(known[0])}
    for prefix in prefixes:
        if set(published) >= {f'{prefix}{name}' for name in known}:
            return (f'the driver begins all names with {prefix!r}: use the description that it '
                    f'uses, for example --xacro prefix:={prefix}')
    return ('name the joints of the arm with --joints (others are locked), its topic with '
            '--topic, or use the description that the driver uses')


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
    urdf: str, arm: ArmModel, given: Mapping[str, Sequence[str]], may_ask: bool, checks: Checklist,
) -> str:
    """Return the URDF with the given limits, and with those that the user types."""
    for name in given:
        if name not in arm.joint_names:
            raise InvalidInputError(f'--limit has joint {name!r}, expected one of: '
                                    f'{", ".join(arm.joint_names)}')
    values = {name: {what: _checked(f'--limit {name}: {what}', text)
                     for what, text in zip(LIMITS, pair)} for name, pair in given.items()}
    missing = []
    for what in LIMITS:
        for name, limit in zip(arm.joint_names, getattr(arm.limits, what)):
            of_joint = values.setdefault(name, {})
            if math.isinf(limit) and what not in of_joint:
                text = _typed(f'{what} limit of {name}') if may_ask else ''
                if text:
                    of_joint[what] = text
                else:
                    missing.append(f'{what} of {name}')
    urdf = with_elements(urdf, {}, {}, values) if any(values.values()) else urdf
    limits = arm_from_urdf(urdf, arm.joint_names).limits
    checks.add('limits', BAD if missing else GOOD, (
        f'missing or 0: {", ".join(missing)}' if missing else 'velocity and effort ' + ', '.join(
            f'{name} {v:g} {e:g}' for name, v, e in zip(
                arm.joint_names, limits.velocity, limits.effort))),
        'each above 0, from the data sheet', '--limit JOINT VELOCITY EFFORT for each')
    return urdf


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
