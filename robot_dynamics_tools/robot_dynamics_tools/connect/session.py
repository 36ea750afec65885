# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The order of a connection: found, passive, active, the files."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
import sys
from typing import NamedTuple

import numpy as np
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Origin
from robot_dynamics.tools import command_line
from robot_dynamics_tools.connect.checklist import BAD, Checklist
from robot_dynamics_tools.connect.description import checked_arm, read_description
from robot_dynamics_tools.connect.graph import (
    check_publishers,
    commanding,
    find_receiver,
    Receiver,
    topic_of_states,
)
from robot_dynamics_tools.connect.passive import check_report, watch_poses
from robot_dynamics_tools.connect.probe import (
    confirm,
    holding_node,
    LARGEST_SHARE,
    NODE,
    Probes,
)
from robot_dynamics_tools.connect.result import parameter_file, report_page, Settings
from robot_dynamics_tools.connect.states import (
    check_noise,
    check_states,
    check_units,
    STATE_TIMEOUT,
    StateLog,
)
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.recordings.interrupts import interrupted_by_sigterm
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError

LISTEN = 3.0
"""[s] in which rate, stamps and noise are measured."""
REST = 2.0
"""[s] of rest before the command."""


class ConnectRequest(NamedTuple):
    """What the user asks for: the options of `connect`; `limits` are by joint."""

    output: Path
    report: Path | None
    urdf: str | None
    xacro: Mapping[str, str]
    topic: str | None
    receiver: str | None
    joints: Sequence[str]
    parameters: Mapping[str, object]
    limits: Mapping[str, Sequence[float]]
    gravity: Sequence[float] | None
    poses: int
    duration: float
    is_passive: bool
    is_confirmed: bool
    force: bool
    timeout: float
    origin: Origin


class Connection(NamedTuple):
    """A robot that has been found."""

    urdf: str
    arm: ArmModel
    receiver: Receiver | None
    settings: Settings
    topic: str

    @property
    def remaps(self) -> list[str]:
        """The remappings of `dynamics_node` in the root namespace to this robot."""
        return [f'joint_states:={self.topic}', *(
            [] if self.receiver is None else [self.receiver.remap])]


def connect(request: ConnectRequest) -> int:
    """Connect to a robot, write the files, return the exit status; raises RobotDynamicsError."""
    may_ask = sys.stdin.isatty() and not request.is_confirmed
    if not (request.is_passive or request.is_confirmed or may_ask):
        raise InvalidInputError(
            'standard input is no terminal, expected one for the confirmation, --yes, or '
            '--passive')
    files = [request.output, request.output.with_suffix('.urdf'), *filter(None, [request.report])]
    for path in files:
        command_line.prepare_file(path, request.force)
    checks = Checklist()
    with interrupted_by_sigterm(), DynamicsClient(NODE, request.timeout) as client:
        topic = topic_of_states(client, request.topic)
        log = StateLog(topic)
        with log.receiving(client):
            if not client.wait(lambda: len(log)):
                raise NoAnswerError(f'no message on {topic} in {request.timeout:g} s')
            client.wait(lambda: False, LISTEN)
            found = _found(client, log, request, may_ask, checks)
            if found is None or checks.bad:
                return _not_written(request, checks)
            holds = _passive(client, log, found, request, checks)
            if not (request.is_passive or checks.bad):
                _active(client, log, found, request, checks)
    if request.report is not None:
        command_line.write_file(request.report, report_page(
            found.arm, checks, found.settings, holds, request.origin))
    if checks.bad:
        return _not_written(request, checks)
    command_line.write_file(files[1], found.urdf)
    command_line.write_file(
        request.output, parameter_file(found.settings, found.remaps, request.output))
    print('\nWritten:\n' + '\n'.join(f'  {path}' for path in files))
    return command_line.DONE


def _not_written(request: ConnectRequest, checks: Checklist) -> int:
    print(f'connect: {request.output} is not written: {checks.bad[0].name}: '
          f'{checks.bad[0].value}', file=sys.stderr)
    return command_line.FAILED


def _found(
    client: DynamicsClient, log: StateLog, request: ConnectRequest, may_ask: bool,
    checks: Checklist,
) -> Connection | None:
    """Check what is found before the arm moves; None if no arm of the description is."""
    namespace = log.topic.rpartition('/')[0]
    check_publishers(client, log.topic, log.states.layouts, checks)
    description = read_description(client, request.urdf, request.xacro, namespace)
    receiver = find_receiver(client, request.receiver, namespace, checks)
    commands = commanding(client, receiver)
    checks.add('other commands', not commands, f'{", ".join(commands) or "none"}',
               'no other node commands efforts', 'end it before this package commands the arm')
    published = max(log.states.layouts, key=len)
    joints = request.joints or (receiver.joints if receiver is not None else ())
    urdf, arm = checked_arm(description, joints, published, request.limits, may_ask, checks)
    if arm is None:
        return None
    if request.gravity is not None:
        arm = arm.with_gravity(request.gravity)
    today = f'{datetime.now():%Y-%m-%d}'
    settings: Settings = {name: (value, 'given') for name, value in request.parameters.items()}
    settings |= {
        'joints': (list(arm.joint_names), f'{log.topic}, {description.source}, {today}'),
        'robot_description_file': (str(request.output.with_suffix('.urdf').resolve()), (
            f'the description of {description.source}, with the limits of the checks')),
        'gravity': (arm.gravity.tolist(), 'given' if request.gravity else 'assumed: upright')}
    timeout = check_states(log, arm, checks)
    if timeout > STATE_TIMEOUT and 'state_timeout' not in settings:
        settings['state_timeout'] = timeout, f'measured {today}: three longest gaps'
    check_units(log.series(arm), arm, checks)
    check_noise(log.series(arm), arm, checks)
    return Connection(urdf, arm, receiver, settings, log.topic)


def _passive(
    client: DynamicsClient, log: StateLog, found: Connection, request: ConnectRequest,
    checks: Checklist,
) -> list[Hold]:
    """Watch the arm in a few poses; add what they show to the settings; return the holds."""
    settings, arm = found.settings, found.arm
    holds: list[Hold] = []
    if log.series(arm).effort is None:
        settings['measured_effort'] = 'none', 'no effort in the joint states'
        checks.add('report', False, 'none', 'an effort per joint', 'dynamics does without it')
    else:
        holds = watch_poses(client, log, arm, request.poses, request.duration)
    if holds:
        check_units(log.series(arm), arm, checks)
        settings |= check_report(arm, holds, request.gravity is None, checks)
    settings['command'] = 'none', (
        'no command has been tried: docs/safety.md, "The first command"')
    return holds


def _active(
    client: DynamicsClient, log: StateLog, found: Connection, request: ConnectRequest,
    checks: Checklist,
) -> None:
    """Hold the arm, and move each joint; add what it shows to the settings."""
    arm, series = found.arm, log.series(found.arm)
    series = series.at(np.flatnonzero(series.times > series.times[-1] - REST))
    assert series.position is not None
    share = float((np.abs(RigidBody(arm).gravity(series.position[-1])) / arm.limits.effort).max())
    others = commanding(client, found.receiver)
    for name, is_bad, value, expected in (
            ('receiver', found.receiver is None, 'none', 'a receiver of efforts'),
            ('other commands', others, f'of {", ".join(others)}', 'no other node commands'),
            ('rest', not check_noise(series, arm, checks), 'the arm moves', 'an arm at rest'),
            ('pose', share > LARGEST_SHARE, f'gravity takes {share:.0%} of an effort limit', (
                f'less than {LARGEST_SHARE:.0%}'))):
        if is_bad:
            checks.add(f'{name} before the command', BAD, value, expected, 'then run it again')
    if checks.bad:
        return
    confirm(request.is_confirmed)
    text = parameter_file(found.settings, found.remaps, request.output)
    with holding_node(text, found.urdf, found.remaps):
        found.settings.update(Probes(client, arm, found.topic, checks).run())
