# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The description of the robot: its source, its joints, the check of its model, its limits."""

from collections.abc import Mapping, Sequence
import math
import sys
from typing import NamedTuple

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model_check.report import check_description
from robot_dynamics.urdf.description_file import read_description_file
from robot_dynamics.urdf.editing import with_continuous_joints, with_limits
from robot_dynamics.urdf.parser import parse_urdf
from robot_dynamics.validation import check_scalar, LARGEST_VALUE
from robot_dynamics_tools.connect.checklist import BAD, Checklist, GOOD
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, LATCHED, NoAnswerError
from std_msgs.msg import String

DISCOVERY_TIME = 0.5
"""[s] in which publishers of a topic are discovered."""
LIMITS = 'velocity', 'effort'


class Description(NamedTuple):
    """The text of a URDF, and where it is from."""

    urdf: str
    source: str


def read_description(
    client: DynamicsClient, given: str | None, xacro: Mapping[str, str], namespace: str,
) -> Description:
    """
    Return the description in the file `given`, or on the topic robot_description.

    Raises ModelError, or NoAnswerError without a description.
    """
    if given is not None:
        return Description(read_description_file(given, '--urdf', xacro), given)
    topics = list(dict.fromkeys([f'{namespace}/robot_description', '/robot_description']))
    for topic in topics:
        client.wait(lambda: False, DISCOVERY_TIME)
        if client.node.count_publishers(topic):
            text = client.receive(String, topic, LATCHED, lambda message: str(message.data))
            if text:
                return Description(text, topic)
    raise NoAnswerError(
        f'no description on {" or ".join(topics)}, expected robot_state_publisher, or --urdf FILE')


def checked_arm(
    description: Description, joints: Sequence[str], published: Sequence[str],
    limits: Mapping[str, Sequence[float]], may_ask: bool, checks: Checklist,
) -> tuple[str, ArmModel | None]:
    """
    Return the URDF with all limits, and its arm with the joints that are published.

    `limits` has velocity and effort by joint. Limits that are missing are asked for on the
    terminal if that `may_ask`. There is no arm if no joint is published.
    """
    urdf, changed = with_continuous_joints(description.urdf)
    robot = arm_from_urdf(urdf)
    checks.add('description', GOOD, (
        f'{robot.name}, {robot.joint_count} joints, of {description.source}' + (
            f'; revolute without <limit>, used as continuous: {", ".join(changed)}'
            if changed else '')), 'a URDF')
    known = list(joints or robot.joint_names)
    used = [name for name in known if name in published]
    missing, other = (
        [name for name in one if name not in two] for one, two in (
            (known, published), (published, known)))
    checks.add(
        'joints', BAD if not used or joints and missing else not missing,
        f'{", ".join(used) or "none"}' + (f'; not published: {", ".join(missing)}' if missing
                                         else '') + (
            f'; ignored: {", ".join(other)}' if other else ''),
        'the joints of the description, by name',
        'joints that are not published are locked; name those of the arm with --joints, or use '
        'the description that the driver uses')
    if not used:
        return urdf, None
    if not joints and (branches := _branches(urdf, used)):
        checks.add('gripper', BAD, f'{", ".join(branches)} may be a gripper',
                   'one chain of joints that no other joint mimics',
                   f'name the joints: --joints {" ".join(used)}')
    urdf = _completed(urdf, used, limits, may_ask, checks)
    arm = arm_from_urdf(urdf, used)
    found = check_description(urdf, used, arm)
    for finding in found.findings:
        checks.add(f'model {finding.check}', BAD if finding.level == 'error' else False,
                   finding.message, 'a consistent model', 'correct the description')
    return urdf, arm


def _branches(urdf: str, names: Sequence[str]) -> list[str]:
    """Return joints that share their nearest moving ancestor, and those that others mimic."""
    robot = parse_urdf(urdf)
    led = {joint.mimic.leader for joint in robot.joints if joint.mimic is not None}
    of_child = {joint.child: joint for joint in robot.joints}
    before: dict[str, list[str]] = {}
    for name in names:
        joint = of_child.get(robot.joint(name).parent)
        while joint is not None and joint.name not in names:
            joint = of_child.get(joint.parent)
        before.setdefault('' if joint is None else joint.name, []).append(name)
    return [name for group in before.values() for name in group
            if len(group) > 1 or name in led]


def _completed(
    urdf: str, names: Sequence[str], given: Mapping[str, Sequence[float]], may_ask: bool,
    checks: Checklist,
) -> str:
    """Return the URDF with the given limits, and with those that the user types."""
    for name in given:
        if name not in names:
            raise InvalidInputError(f'--limit has joint {name!r}, expected one of: '
                                    f'{", ".join(names)}')
    values = {name: dict(zip(LIMITS, pair)) for name, pair in given.items()}
    arm, missing = arm_from_urdf(urdf, names), []
    for j, name in enumerate(names):
        for what, limit in zip(LIMITS, (arm.limits.velocity[j], arm.limits.effort[j])):
            if math.isfinite(limit) or what in values.get(name, {}):
                continue
            text = _typed(f'{what} limit of {name}') if may_ask else ''
            if text:
                values.setdefault(name, {})[what] = check_scalar(
                    f'{what} limit of {name}', float(text), 0.0, LARGEST_VALUE,
                    exclusive_minimum=True)
            else:
                missing.append(f'{what} of {name}')
    if values:
        urdf = with_limits(urdf, {name: {what: repr(value) for what, value in one.items()}
                                  for name, one in values.items()})
    limits = arm_from_urdf(urdf, names).limits
    checks.add('limits', BAD if missing else GOOD, (
        f'missing or 0: {", ".join(missing)}' if missing else 'velocity and effort ' + ', '.join(
            f'{name} {v:g} {e:g}' for name, v, e in zip(names, limits.velocity, limits.effort))),
        'each above 0, from the data sheet', '--limit JOINT VELOCITY EFFORT for each')
    return urdf


def _typed(what: str) -> str:
    """Return the number that the user types, '' for none."""
    print(f'{what} [SI units, from the data sheet; Enter for none]: ', end='', flush=True)
    text = sys.stdin.readline().strip()
    try:
        float(text)
    except ValueError:
        return ''
    return text
