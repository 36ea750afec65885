# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The active part: a `dynamics` node with the new file holds the arm, and moves each joint a little.

The node is started for this, in the namespace /connect: what is tried is then the file that is
written, and not the parameters of a node that happens to run.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
import re
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.connect.checklist import BAD, Checklist, UNKNOWN
from robot_dynamics_tools.connect.result import Settings
from robot_dynamics_tools.gravity_calibration.holds import per_joint
from robot_dynamics_tools.recordings.interrupts import uninterrupted
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.move import goal_publication, MotionWatch
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

Publish = Callable[[Sequence[float], float], None]
NAMESPACE = '/connect'
NODE = f'{NAMESPACE}/dynamics'
STEP = 0.02, 0.005
"""[rad], [m]: displacement of a probe."""
START_TIME, END_TIME = 30.0, 10.0
"""[s] that the node may take to start, and to end."""
MOVE_TIME, HOLD_TIME = 0.5, 2.0
"""[s] of the motion of a probe, and of holding before the first one."""
LIMIT_FRACTION = 0.5
"""Of the effort limits, to which the command is clamped."""
LARGEST_SHARE = 0.4
"""Largest share of the effort limit that gravity may take at the pose of the probes."""
LEAST_SHARE, NEAR = 0.05, 0.15
"""Gravity by the effort limit from which a probe shows the command; and its largest error."""
AGREES, UNSEEN = 'agrees', 'not observable yet'
"""Verdicts of the status `drive` that accuse no drive."""
QUESTION = (
    'A dynamics node now holds the arm with at most {share:.0%} of its effort limits, and moves '
    'each joint by {step}.\nThen the command ends: brakes, or the controller of the robot, must '
    'hold the arm. Keep the emergency stop\nat hand. Ctrl-C stops the arm. Type yes and press '
    'Enter to begin: ')


def confirm(is_confirmed: bool) -> None:
    """Ask on the terminal; raise ToolError unless the user types yes."""
    if is_confirmed:
        return
    print(QUESTION.format(share=LIMIT_FRACTION, step=f'{STEP[0]:g} rad or {STEP[1]:g} m'), end='',
          flush=True)
    if sys.stdin.readline().strip().lower() != 'yes':
        raise ToolError('not confirmed; the arm has not moved')


@contextmanager
def holding_node(parameters: str, urdf: str, remaps: Sequence[str]) -> Iterator[None]:
    """Run `dynamics_node` with the text of a parameter file and of a URDF."""
    with TemporaryDirectory() as folder, Path(folder, 'log').open('w', encoding='utf-8') as log:
        files = {'arm.yaml': parameters, 'arm.urdf': urdf}
        for name, text in files.items():
            Path(folder, name).write_text(text, encoding='utf-8')
        values = {'robot_description_file': Path(folder, 'arm.urdf'), 'command': 'computed_torque',
                  'effort_limit_fraction': LIMIT_FRACTION}
        process = subprocess.Popen(
            [sys.executable, '-m', 'robot_dynamics.ros.dynamics.node', '--ros-args',
             '--params-file', f'{folder}/arm.yaml', '-r', f'__ns:={NAMESPACE}',
             *(word for remap in remaps for word in ('-r', remap)),
             *(word for name, value in values.items() for word in ('-p', f'{name}:={value}'))],
            stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            yield
        except NoAnswerError as error:
            last = Path(folder, 'log').read_text(encoding='utf-8').splitlines()[-1:]
            raise ToolError(f'{error}; its log ends: {"".join(last)}') from None
        finally:
            with uninterrupted():  # the arm stops before the command ends
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(END_TIME)
                except subprocess.TimeoutExpired:
                    process.kill()


class Probes:
    """Holds and moves the arm of the node NODE, which runs; adds what it shows to the checks."""

    def __init__(
        self, client: DynamicsClient, arm: ArmModel, topic: str, checks: Checklist,
    ) -> None:
        """`topic` is that of the joint states."""
        self._client, self._arm, self._topic, self._checks = client, arm, topic, checks
        self._watch = MotionWatch(client, arm.joint_names, arm.is_continuous.tolist())
        self._body, self._torque = RigidBody(arm), list[FloatArray]()
        self._share: dict[int, float] = {}
        self._verdicts: dict[str, str] = {}
        self._failure = ''

    def run(self, used: Settings) -> Settings:
        """
        Hold and move the arm; return the settings that the drives need. Ctrl-C stops it.

        `used` are the settings of the node.
        """
        client = self._client
        try:
            client.wait(self._is_started, START_TIME)
            client.wait(lambda: client.joint_state_topic() == self._topic)
            self._move()
        except KeyboardInterrupt:
            self._stop()
            raise
        return self._settings(used)

    def _is_started(self) -> bool:
        return bool(self._client.node.count_publishers(f'{NODE}/reference'))

    def _move(self) -> None:
        """Hold the arm, and move each joint; keep why this ended early."""
        client, arm, watch = self._client, self._arm, self._watch
        torque = client.resolve('~/computed_torque')
        with watch.following(), client.subscribed(
                (JointState, torque, self._on_torque, 100),
                (DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)):
            try:
                watch.wait_ready()
                client.wait(lambda: False, HOLD_TIME)
                start = np.array(watch.measured())
                with (goal_publication(client, arm.joint_names) as publish,
                      Progress(arm.joint_count, 'joints') as progress):
                    for j in range(arm.joint_count):
                        self._check_probe(j, *self._probe(j, start, publish))
                        progress.update(j + 1)
            except RobotDynamicsError as error:
                self._failure = str(error)
            client.wait(lambda: False, HOLD_TIME)

    def _check_probe(self, j: int, way: float, friction: float) -> None:
        share = self._share.get(j)
        held = '' if share is None else f', held by {share:.2f} g(q)'
        self._checks.add(
            f'probe of {self._arm.joint_names[j]}', share is None or abs(share - 1.0) < NEAR,
            f'moved by {way:.4f}, friction {friction:.2g}{held}', 'held by 1.00 g(q)',
            'see the drive, and the masses of the model')

    def _stop(self) -> None:
        """Call ~/stop, if the node runs."""
        if not self._is_started():
            return
        with uninterrupted():
            try:
                report = self._client.call(Trigger, 'stop', Trigger.Request()).message
            except RobotDynamicsError as error:
                report = f'{error}; the node stops the arm before it ends'
        print(f'Called ~/stop: {report}', file=sys.stderr, flush=True)

    def _probe(self, j: int, start: FloatArray, publish: Publish) -> tuple[float, float]:
        """
        Move joint j away from its nearer limit, and back; return its way and its friction.

        The mean of both directions has no friction: the share of g(q) that it is, is kept.
        """
        arm, watch = self._arm, self._watch
        limits, step = arm.limits, per_joint(STEP, arm.joint_kinds)
        sign = 1.0 if limits.upper[j] - start[j] > start[j] - limits.lower[j] else -1.0
        means: list[float] = []
        gravity: list[float] = []
        far = 0.0
        aside = start + sign * step * (np.arange(len(start)) == j)
        for goal in (aside.tolist(), start.tolist()):
            self._torque.clear()
            watch.wait_taken(goal, partial(publish, goal, MOVE_TIME))
            watch.wait_end(goal, lambda _: None)
            torque, g = np.mean(self._torque, axis=0)[:, j]
            means.append(float(torque - g))
            gravity.append(float(g))
            far = max(far, abs(watch.measured()[j] - start[j]))
        if abs(sum(gravity)) > 2.0 * LEAST_SHARE * limits.effort[j]:
            self._share[j] = 1.0 + sum(means) / sum(gravity)
        return far, max(0.5 * sign * (means[0] - means[1]), 0.0)

    def _on_torque(self, message: JointState) -> None:
        """Take the torque and g(q) while the reference moves."""
        watch = self._watch
        if watch.reference is not None and len(watch.position) == self._arm.joint_count and any(
                watch.reference[2]):
            q = np.array(watch.measured())
            self._torque.append(np.array([message.effort, self._body.gravity(q)]))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f'{NODE}: drive':
                self._verdicts |= {pair.key: pair.value for pair in status.values}

    def _settings(self, used: Settings) -> Settings:
        """Add the verdicts on the drives to the checks; return what they need."""
        names, settings = self._arm.joint_names, dict[str, tuple[object, str]]()
        factors = {'command': np.ones(len(names)), 'report': np.ones(len(names))}
        said = {name: self._verdicts.get(name, UNSEEN) for name in names}
        for j, name in enumerate(names):
            verdict, _, sentence = said[name].partition('; ')
            if abs(self._share.get(j, 0.0) - 1.0) < NEAR:  # the command is right
                verdict = re.sub(r'^unclear: (report scale \S+) or .*', r'\1', verdict)
            grade = True if verdict == AGREES else UNKNOWN if verdict == UNSEEN else False
            self._checks.add(f'drive of {name}', grade, verdict, AGREES, sentence)
            if verdict == 'reversed':
                factors['command'][j] = -1.0
            elif verdict.startswith('command scale '):
                factors['command'][j] = float(verdict.split()[-1])
            elif verdict.startswith('report scale '):
                factors['report'][j] = 1.0 / float(verdict.split()[-1])
            elif verdict == 'adds gravity':
                settings['robot_compensates'] = ['gravity'], sentence
        for direction, factor in factors.items():
            key = f'effort.{direction}_scale'
            if (factor != 1.0).any():
                scale = np.array(used.get(key, (1.0, ''))[0]) * factor
                settings[key] = scale.round(3).tolist(), '; '.join(
                    f'{name}: {text}' for name, text in said.items())
        is_right = all(text.startswith((AGREES, UNSEEN)) for text in said.values())
        if self._failure:
            self._checks.add('motion', BAD if is_right else False, self._failure,
                             'a motion as commanded', 'see the drives')
        settings['command'] = ('computed_torque', (
            f'held the arm, and moved each joint by {STEP[0]:g} rad or {STEP[1]:g} m')) if (
            is_right and not self._failure) else (
            'none', 'run connect with the new values before the first command')
        return settings
