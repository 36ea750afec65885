# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The order of a connection: found, passive, active, the files."""

from argparse import Namespace
from datetime import datetime
from pathlib import Path
import sys

import numpy as np
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Origin
from robot_dynamics.tools import command_line
from robot_dynamics_tools.connect.checklist import BAD, Checklist, UNKNOWN
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
    moving,
    STATE_TIMEOUT,
    StateLog,
)
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.options import number_in, read_parameters
from robot_dynamics_tools.recordings.interrupts import interrupted_by_sigterm
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError

LISTEN = 3.0
"""[s] in which rate, stamps and noise are measured."""
REST = 2.0
"""[s] of rest before the command."""


def connect(arguments: Namespace, origin: Origin) -> int:
    """Connect to a robot, write the files, return the exit status; raises RobotDynamicsError."""
    may_ask = sys.stdin.isatty() and not arguments.yes
    if not (arguments.passive or arguments.yes or may_ask):
        raise InvalidInputError(
            'standard input is no terminal, expected one for the confirmation, --yes, or '
            '--passive')
    output: Path = arguments.output
    urdf_file = output.with_suffix('.urdf')
    files = [output, urdf_file, *filter(None, [arguments.report])]
    for path in files:
        command_line.prepare_file(path, arguments.force)
    with interrupted_by_sigterm(), DynamicsClient(NODE, arguments.timeout) as client:
        session = Session(client, arguments, may_ask)
        session.run()
    if arguments.report is not None and session.arm is not None:
        command_line.write_file(arguments.report, report_page(
            session.arm, session.checks, session.settings, session.holds, origin))
    bad = session.checks.bad
    if bad:
        print(f'connect: {output} is not written: {bad[0].name}: {bad[0].value}', file=sys.stderr)
        return command_line.FAILED
    command_line.write_file(urdf_file, session.urdf)
    command_line.write_file(output, session.file())
    print('\nWritten:\n' + '\n'.join(f'  {path}' for path in files))
    return command_line.DONE


class Session:
    """A robot that is being connected: what is found, and the settings that follow from it."""

    def __init__(self, client: DynamicsClient, arguments: Namespace, may_ask: bool) -> None:
        """`arguments` are the options of `connect`; with `may_ask`, missing limits are asked."""
        self._client, self._arguments, self._may_ask = client, arguments, may_ask
        self._given = read_parameters(arguments.parameters)
        self._receiver: Receiver | None = None
        self.checks = Checklist()
        self.settings: Settings = {name: (value, 'given') for name, value in self._given.items()}
        self.urdf = ''
        self.arm: ArmModel | None = None
        self.holds: list[Hold] = []

    def run(self) -> None:
        """Check the robot; end before the arm is moved if a check is bad."""
        client, arguments = self._client, self._arguments
        self._log = log = StateLog(topic_of_states(client, arguments.topic))
        with log.receiving(client):
            if not client.wait(lambda: len(log)):
                raise NoAnswerError(f'no message on {log.topic} in {client.timeout:g} s')
            client.wait(lambda: False, LISTEN)
            self._find()
            if self.arm is not None and not self.checks.bad:
                self._watch(self.arm)
            if self.arm is not None and not (arguments.passive or self.checks.bad):
                self._move(self.arm)

    @property
    def _remaps(self) -> list[str]:
        """The remappings of `dynamics_node` in the root namespace to this robot."""
        return [f'joint_states:={self._log.topic}', *(
            [] if self._receiver is None else [self._receiver.remap])]

    def file(self) -> str:
        """Return the text of the parameter file."""
        return parameter_file(self.settings, self._remaps, self._arguments.output)

    def _find(self) -> None:
        """Check what is found before the arm moves."""
        client, log, arguments, checks = self._client, self._log, self._arguments, self.checks
        namespace, layouts = log.topic.rpartition('/')[0], log.states.layouts
        check_publishers(client, log.topic, layouts, checks)
        description = read_description(client, arguments.urdf, dict(arguments.xacro), namespace)
        self._receiver = find_receiver(client, arguments.receiver, namespace, checks)
        commands = commanding(client, self._receiver)
        checks.add('other commands', not commands, ', '.join(commands) or 'none',
                   'no other node commands efforts', 'end it before this package commands the arm')
        joints = arguments.joints or self._given.get('joints') or (
            self._receiver.joints if self._receiver is not None else ())
        limits = {name: [number_in(1e-6, 1e6)(value) for value in values]
                  for name, *values in arguments.limit}
        self.urdf, arm = checked_arm(
            description, joints, max(layouts, key=len), limits, self._may_ask, checks)
        if arm is None:
            return
        gravity = arguments.gravity or self._given.get('gravity')
        self.arm = arm = arm if gravity is None else arm.with_gravity(gravity)
        today = f'{datetime.now():%Y-%m-%d}'
        self.settings |= {
            'joints': (list(arm.joint_names), f'{log.topic}, {description.source}, {today}'),
            'robot_description_file': (str(arguments.output.with_suffix('.urdf').resolve()), (
                f'the description of {description.source}, with the limits of the checks')),
            'gravity': (arm.gravity.tolist(), 'given' if gravity else 'assumed: upright')}
        self.settings.pop('robot_description', None)
        timeout = check_states(log, arm, checks)
        if timeout > STATE_TIMEOUT:
            self.settings.setdefault('state_timeout', (
                timeout, f'measured {today}: three longest gaps'))
        check_units(log.series(arm), arm, checks)
        check_noise(log.series(arm), arm, checks)

    def _watch(self, arm: ArmModel) -> None:
        """Watch the arm in a few poses, and add what they show to the settings."""
        log, arguments, settings = self._log, self._arguments, self.settings
        settings['command'] = 'none', (
            'no command has been tried: docs/safety.md, "The first command"')
        kind = self._given.get('measured_effort', 'joint_torque')
        if log.series(arm).effort is None:
            settings['measured_effort'] = 'none', 'no effort in the joint states'
            self.checks.add('report', False, 'none', 'an effort per joint', 'nothing')
        elif kind != 'joint_torque':
            self.checks.add('report', UNKNOWN, f'{kind}, given', 'joint_torque', (
                'compare it with `calibrate_gravity`'))
        else:
            self.holds = watch_poses(self._client, log, arm, arguments.poses, arguments.duration)
        if self.holds:
            if len(self.holds) > 1:
                check_units(log.series(arm), arm, self.checks)
            may_tilt = settings['gravity'][1] != 'given'
            shown = check_report(arm, self.holds, may_tilt, self.checks)
            if shown:
                settings.pop('effort.report_scale', None)  # the given one
            settings |= shown
            self.arm = arm.with_gravity(np.array(settings['gravity'][0]))

    def _move(self, arm: ArmModel) -> None:
        """Hold the arm, and move each joint; add what it shows to the settings."""
        checks, series = self.checks, self._log.series(arm)
        series = series.at(np.flatnonzero(series.times > series.times[-1] - REST))
        assert series.position is not None
        g = RigidBody(arm).gravity(series.position[-1])
        share = float((np.abs(g) / arm.limits.effort).max())
        others, motion = commanding(self._client, self._receiver), moving(series, arm)
        for name, is_bad, value, expected in (
                ('receiver', self._receiver is None, 'none', 'a receiver of efforts'),
                ('other commands', others, f'of {", ".join(others)}', 'no other node commands'),
                ('rest', motion, motion, 'an arm at rest'),
                ('pose', share > LARGEST_SHARE, f'gravity takes {share:.0%} of an effort limit', (
                    f'less than {LARGEST_SHARE:.0%}'))):
            if is_bad:
                checks.add(f'{name} before the command', BAD, value, expected, 'then run it again')
        if not checks.bad:
            confirm(self._arguments.yes)
            with holding_node(self.file(), self.urdf, self._remaps):
                probes = Probes(self._client, arm, self._log.topic, checks)
                self.settings |= probes.run(self.settings)
