# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The order of a connection: found, passive, active, the files."""

from argparse import Namespace
from datetime import datetime
import sys
import time
from typing import Any

import numpy as np
from rclpy.qos import qos_profile_sensor_data
from robot_dynamics.control.safety.faults import STATE_TIMEOUT
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Origin
from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.parameters.robot_description import description_from_parameters
from robot_dynamics.tools import command_line
from robot_dynamics_tools.connect import description, passive, probe, robot, states
from robot_dynamics_tools.connect.checks import (
    BAD,
    Checklist,
    DESCRIPTION,
    GOOD,
    parameter_file,
    report_page,
    Settings,
    UNKNOWN,
)
from robot_dynamics_tools.gravity_calibration.holds import Hold
from robot_dynamics_tools.options import read_parameters, read_robot
from robot_dynamics_tools.recordings.interrupts import interrupted_by_sigterm
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from sensor_msgs.msg import JointState

FILE = 'robot_description_file'
REST = 2.0
"""[s] of rest before the command."""


def connect(arguments: Namespace, origin: Origin) -> int:
    """Connect to a robot, write the files, return the exit status; raises RobotDynamicsError."""
    may_ask = sys.stdin.isatty() and not arguments.yes
    if not (arguments.passive or arguments.yes or may_ask):
        raise InvalidInputError(
            'standard input is no terminal, expected one for the confirmation, --yes, or '
            '--passive')
    output, report = arguments.output, arguments.report
    if report == output:
        raise InvalidInputError(f'--report and --output are both {output}, expected two files')
    for path in filter(None, [output, report]):
        command_line.prepare_file(path, arguments.force)
    with interrupted_by_sigterm(), DynamicsClient(probe.NODE, arguments.timeout) as client:
        session = Session(client, arguments, may_ask)
        session.run()
    if report is not None and session.arm is not None:
        command_line.write_file(report, report_page(
            session.arm, session.checks, session.settings, session.holds, origin))
        print(f'Report: {report}')
    for check in session.checks.bad[:1]:
        print(f'connect: {output} is not written: {check.name}: {check.text}', file=sys.stderr)
        return command_line.FAILED
    command_line.write_file(output, session.file())
    print(f'Parameters: {output}')
    return command_line.DONE


class Session:
    """A robot that is being connected: what is found, and the settings that follow from it."""

    def __init__(self, client: DynamicsClient, arguments: Namespace, may_ask: bool) -> None:
        """`arguments` are the options of `connect`; with `may_ask`, missing limits are asked."""
        self._client, self._arguments, self._may_ask = client, arguments, may_ask
        if arguments.gravity and not np.linalg.norm(arguments.gravity) > 1.0:
            raise InvalidInputError(f'--gravity is {arguments.gravity}, expected 9.81 in length')
        self._stated = 'stated by --unit' if arguments.unit else ''
        self._receiver: robot.Receiver | None = None
        self.checks = Checklist()
        self._given = self._parameters()
        self.settings: Settings = {name: (value, f'given in {arguments.parameters}')
                                   for name, value in self._given.items()}
        self._description = (
            read_robot(arguments.urdf) if arguments.urdf is not None
            else description_from_parameters({DESCRIPTION: '', FILE: ''} | self._given),
            arguments.urdf or arguments.parameters)
        self.settings.pop(FILE, None)
        if arguments.gravity:
            self._given['gravity'] = arguments.gravity
            self.settings['gravity'] = arguments.gravity, 'given by --gravity'
        self.arm: ArmModel | None = None
        self.holds: list[Hold] = []

    def _parameters(self) -> dict[str, Any]:
        """Return the parameters of dynamics_node in the given file; check their names."""
        values, joints = read_parameters(self._arguments.parameters), self._arguments.joints
        other = ', '.join(sorted(values.keys() - {spec.name for spec in SPECS}))
        if values:
            self.checks.add('parameters', not other, f'not used: {other}' if other else 'known',
                            'parameters of dynamics_node', 'correct their names')
        given = {spec.name: values[spec.name] for spec in SPECS if spec.name in values}
        if joints and list(given.get('joints') or joints) != joints:
            raise InvalidInputError(f'--joints has {joints}, but --parameters has '
                                    f'{given["joints"]}, expected the same joints')
        return given

    def run(self) -> None:
        """Check the robot; end before the arm is moved if a check is bad."""
        client, arguments = self._client, self._arguments
        self._log = log = states.StateLog(robot.topic_of_states(client, arguments.topic))
        with client.subscribed((JointState, log.topic, log.take, qos_profile_sensor_data)):
            if not client.wait(lambda: log.states):
                raise NoAnswerError(
                    f'no message on {log.topic} of '
                    f'{", ".join(robot.publishers(client, log.topic))} in {client.timeout:g} s: '
                    'start its driver, or activate its controller')
            client.wait(lambda: False, states.LISTEN)
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

    def _others(self) -> list[str]:
        """Return the nodes that command efforts."""
        return [] if self._receiver is None else robot.publishers(
            self._client, self._receiver.topic)

    def file(self) -> str:
        """Return the text of the parameter file."""
        return parameter_file(self.settings, self._remaps, self._arguments.output.name)

    def _find(self) -> None:
        """Check what is found before the arm moves."""
        client, log, arguments, checks = self._client, self._log, self._arguments, self.checks
        layouts, names = log.recorded.layouts, robot.publishers(client, log.topic)
        checks.add('joint states', BAD if 1 < len(names) > len(layouts) else True,
                   f'{log.topic} of {", ".join(names)}', 'one publisher per joint',
                   'end all but one of them')
        urdf, source = self._description
        if urdf is None:
            urdf, source = description.published_description(client, log.topic.rpartition('/')[0])
        self._receiver = robot.find_receiver(
            client, arguments.receiver, log.topic, not arguments.passive, checks)
        commands = self._others()
        checks.add('other commands', not commands, ', '.join(commands) or 'none',
                   'no other node commands efforts', 'end it before this package commands the arm')
        joints = arguments.joints or self._given.get('joints') or (
            self._receiver.joints if self._receiver is not None else ())
        urdf, arm = description.checked_arm(
            urdf, source, joints, log.recorded.joint_names if joints else max(layouts, key=len),
            self._given, {name: limits for name, *limits in arguments.limit}, self._may_ask,
            checks)
        if arm is not None:
            self.settings[DESCRIPTION] = urdf, f'of {source}, with the limits of the checks'
            self.arm = self._set_up(arm, source)
            states.check_units(log.series(arm), arm, self._stated, checks)
            states.check_noise(log.series(arm), arm, checks)

    def _set_up(self, arm: ArmModel, source: object) -> ArmModel:
        """Check the joint states and the mount of an arm; begin its settings; return the arm."""
        log, today = self._log, f'{datetime.now():%Y-%m-%d}'
        if 'gravity' not in self.settings and (
                found := robot.gravity_of_imu(self._client, arm, self.checks)):
            arm = arm.with_gravity(found[0])
            self.settings['gravity'] = (
                arm.gravity.round(4).tolist(), f'measured by {found[1]}, {today}')
        timeout, measured = states.check_states(log, arm, self.checks)
        self.settings |= {
            'joints': (list(arm.joint_names), f'{log.topic}, {measured}, {source}, {today}'),
            'command': ('none', 'no command has been tried: docs/safety.md, "The first command"')}
        if self._receiver is not None and self._receiver.is_controller:
            self.settings.setdefault('end_action', (
                'ramp_to_zero', f'{self._receiver.node} keeps the last command'))
        if timeout > STATE_TIMEOUT:
            self.settings.setdefault('state_timeout', (timeout, f'{measured}, {today}'))
        return arm

    def _watch(self, arm: ArmModel) -> None:
        """Watch the arm in a few poses, and add what they show to the settings."""
        log, arguments, settings = self._log, self._arguments, self.settings
        kind = self._given.get('measured_effort', 'joint_torque')
        if log.series(arm).effort is None:
            settings['measured_effort'] = 'none', 'no effort in the joint states'
            self.checks.add('report', False, 'none', 'a finite effort per joint', 'nothing')
        elif kind != 'joint_torque':
            self.checks.add('report', UNKNOWN, f'{kind}, given', 'joint_torque', (
                'compare it with `calibrate_gravity`'))
        else:
            self.holds = passive.watch_poses(
                self._client, log, arm, arguments.poses, arguments.duration)
            shown = passive.check_report(arm, self.holds, 'gravity' not in settings, self.checks)
            if 'effort.report_scale' in shown:
                settings.pop('effort.report_covariance', None)  # of another scale
            settings |= shown
            if 'gravity' in shown:
                self.arm = arm.with_gravity(np.array(shown['gravity'][0]))
        if len(self.holds) > 1:  # it has moved
            is_shown = any(one.grade is GOOD and one.name.startswith('report of')
                           for one in self.checks)
            states.check_units(log.series(arm), arm, self._stated or (
                'g(q) of the positions is the effort' if is_shown else ''), self.checks)

    def _move(self, arm: ArmModel) -> None:
        """Hold the arm, and move each joint; add what it shows to the settings."""
        checks, series = self.checks, self._log.series(arm)
        series = series.at(np.flatnonzero(series.times > series.times[-1] - REST))
        assert series.position is not None
        g = RigidBody(arm).gravity(series.position[-1])
        share = float((np.abs(g) / arm.limits.effort).max())
        others = self._others()
        motion = states.moving(series, arm)
        is_doubtful = any(one.name == 'units' and one.grade is UNKNOWN for one in checks)
        silent = 1e-9 * (time.time_ns() - self._log.states[-1].recorded_ns)
        for name, is_bad, value, expected in (
                ('joint states', silent > REST, f'none for {silent:.1f} s', 'a running driver'),
                ('other commands', others, f'of {", ".join(others)}', 'no other node commands'),
                ('rest', motion, motion, 'an arm at rest'),
                ('units', is_doubtful and self._arguments.yes, 'not known', '--unit rad'),
                ('pose', share > probe.LARGEST_SHARE,
                 f'gravity takes {share:.0%} of an effort limit',
                 f'less than {probe.LARGEST_SHARE:.0%}')):
            if is_bad:
                checks.add(f'{name} before the command', BAD, value, expected,
                           'change this and run connect again; --passive writes the rest')
        if not checks.bad:
            if not self._arguments.yes:
                probe.confirm(arm, series.position[-1])
            with probe.holding_node(self.file(), self._remaps) as node:
                probes = probe.Probes(self._client, arm, self._log.topic, checks)
                self.settings |= probes.run(self.settings, node)
