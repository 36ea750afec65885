# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The active part: a `dynamics` node with the new file holds the arm, and moves each joint a little.

The node is started for this, in the namespace /connect: what is tried is then the file that is
written, and not the parameters of a node that happens to run.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import zip_longest
import json
from pathlib import Path
import re
import sys
from tempfile import TemporaryDirectory
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.monitoring.drive_tilt import TILTED
from robot_dynamics.monitoring.drive_verdicts import AGREES
from robot_dynamics.monitoring.drive_verdicts import NEAR as RESOLUTION
from robot_dynamics.monitoring.drive_verdicts import UNKNOWN as UNSEEN
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics.ros.middleware.diagnostics import STIFFNESS
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.connect.checks import BAD, CHECK, Checklist, Settings, UNKNOWN
from robot_dynamics_tools.gravity_calibration.holds import per_joint
from robot_dynamics_tools.gravity_calibration.reported_gravity import is_scale, NOISE
from robot_dynamics_tools.processes import DYNAMICS, NodeProcess, STOP_TIMEOUT
from robot_dynamics_tools.recordings.interrupts import uninterrupted
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.motion_watch import goal_publication, MotionWatch
from robot_dynamics_tools.ros2_dynamics.orders import values_per_joint
from sensor_msgs.msg import JointState

NAMESPACE = '/connect'
NODE = f'{NAMESPACE}/dynamics'
STEP = 0.02, 0.005
"""[rad], [m]: displacement of a probe."""
REACH, FRICTION = 8, 0.08
"""
Steps that the reference may go, and effort by its limit, until a joint that friction holds moves.

A joint with more steps until this effort may need up to three times as many. Gains that a busy
machine has lowered grow again: then the joint goes to the reference.
"""
START_TIME = 30.0
"""[s] that the node may take to start."""
MOVE_TIME, HOLD_TIME = 0.5, 2.0
"""[s] of the motion of a probe, and of holding before the first one."""
LIMIT_FRACTION = 0.5
"""Of the effort limits, to which the command is clamped."""
LARGEST_SHARE = 0.4
"""Largest share of the effort limit that gravity may take at the pose of the probes."""
LEAST_SHARE, NEAR = 0.05, 0.15
"""Gravity by the effort limit from which a probe shows the command; and its largest error."""
REVERSED = -0.5
"""Reported effort by torque of a small motion below which the report is reversed."""
COULOMB = 'friction.coulomb'
_ALL = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
RATE_SHARE, LEAST_GAINS = 'share of the gains that the state rate allows', 0.5
QUESTION = (
    'The arm stands at {pose}, by its joint states.\n'
    'A dynamics node now holds it with at most {share:.0%} of its effort limits, and moves each '
    'joint by about\n{step}. Then the command ends: brakes, or the controller of the robot, must '
    'hold the arm. Keep the emergency stop\nat hand. Ctrl-C stops the arm. Type yes and press '
    'Enter if the pose is right: ')


def confirm(arm: ArmModel, q: FloatArray) -> None:
    """Ask on the terminal with the positions (n,); raise ToolError unless the user types yes."""
    pose = ', '.join(f'{name} {x:.3f} m' if kind == 'prismatic' else f'{name} {np.degrees(x):.0f}°'
                     for name, kind, x in zip(arm.joint_names, arm.joint_kinds, q))
    print(QUESTION.format(pose=pose, share=LIMIT_FRACTION,
                          step=f'{STEP[0]:g} rad or {STEP[1]:g} m'), end='', flush=True)
    if sys.stdin.readline().strip().lower() != 'yes':
        raise ToolError('not confirmed; the arm has not moved')


@contextmanager
def holding_node(parameters: str, remaps: Sequence[str]) -> Iterator[NodeProcess]:
    """Run `dynamics_node` with the text of a parameter file; at the end the arm stops first."""
    with TemporaryDirectory() as name:
        folder, file = Path(name), Path(name, 'arm.yaml')
        file.write_text(parameters, encoding='utf-8')
        node = NodeProcess('dynamics', DYNAMICS, {
            'command': 'computed_torque', 'effort_limit_fraction': LIMIT_FRACTION}, folder, file, [
                '--ros-args', *(word for remap in [f'__ns:={NAMESPACE}', *remaps]
                                for word in ('-r', remap)), '--'])
        try:
            yield node
        except NoAnswerError as error:
            raise ToolError(f'{error}; its log ends with:\n{node.last_lines()}') from None
        finally:
            with uninterrupted():
                node.interrupt()
                node.wait(time.monotonic() + STOP_TIMEOUT)
                print('The arm has stopped, and the command has ended.', file=sys.stderr)


class Probes:
    """Holds and moves the arm by the node NODE, which runs; adds what that shows to the checks."""

    def __init__(
        self, client: DynamicsClient, arm: ArmModel, topic: str, checks: Checklist,
    ) -> None:
        """`topic` is that of the joint states."""
        self._client, self._arm, self._topic, self._checks = client, arm, topic, checks
        self._watch = MotionWatch(client, arm.joint_names, arm.joint_kinds)
        self._body = RigidBody(arm)
        self._torque, self._states = dict[int, FloatArray](), dict[int, FloatArray]()
        """Torque (n,), and position and reported effort (2, n), by the stamp of the state."""
        self._share: FloatArray = np.full(arm.joint_count, np.nan)
        """Of g(q) that holds the joint (n,), NaN if it bears too little to tell."""
        self._reported: FloatArray = np.ones(arm.joint_count)
        """Reported effort by torque in the probes (n,), 1 if the torque is too small to tell."""
        self._friction: FloatArray = np.full(arm.joint_count, np.nan)
        """Dry friction (n,) of the joints that the probes have moved, else NaN."""
        self._state: dict[str, tuple[float, float]] = {}
        """The newest position and effort of each joint."""
        self._values: dict[str, str] = {}
        """Values of the statuses `drive` and `reference`."""
        self._stiffness: dict[str, float] = {}
        """The largest stiffness [N·m/rad] or [N/m] of each joint, as with all gains."""

    def run(self, used: Settings, node: NodeProcess) -> Settings:
        """
        Hold the arm by `node`, move each joint, and return the settings after those `used`.

        Raises NodeError if the node does not start.
        """
        client, arm, watch, failure = self._client, self._arm, self._watch, ''

        def is_started() -> bool:
            node.check()
            return bool(client.node.count_publishers(f'{NODE}/reference'))

        client.wait(is_started, START_TIME)
        client.wait(lambda: client.joint_state_topic() == self._topic)
        with watch.following(), client.subscribed(
                (JointState, self._topic, self._on_state, _ALL),
                (JointState, client.resolve('~/computed_torque'), self._on_torque, 100),
                (DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)):
            try:
                watch.wait_ready()
                client.receive(JointState, client.resolve('~/computed_torque'), 100, bool)
                client.wait(lambda: False, HOLD_TIME)
                start = np.array(watch.measured())
                with (goal_publication(client, arm.joint_names) as publish,
                      Progress(arm.joint_count, 'joints') as progress):
                    for j in range(arm.joint_count):
                        self._probe(j, start, publish)
                        progress.update(j + 1)
            except RobotDynamicsError as error:
                failure = str(error)
            client.wait(lambda: False, HOLD_TIME)
        self._checks.add(
            'feedback', float(self._values.get(RATE_SHARE, 1.0)) > LEAST_GAINS,
            f'{self._values.get(RATE_SHARE, "?")} of the gains, stiffness ' + ', '.join(
                f'{name} {value:g}' for name, value in self._stiffness.items()),
            '1.0, N·m/rad or N/m', 'a faster driver, or lower gains.natural_frequency')
        verdicts = {name: self._values.get(name, UNSEEN) for name in arm.joint_names}
        for name, ratio in zip(arm.joint_names, self._reported):
            if verdicts[name].startswith(UNSEEN) and ratio < REVERSED and (
                    used.get('measured_effort', ('joint_torque',))[0] == 'joint_torque'):
                verdicts[name] = f'report scale -1; {ratio:.2f} of the torque in the probe'
        settings = drive_settings(arm, verdicts, self._share, used, failure, self._checks)
        if COULOMB not in used and np.nansum(self._friction) > 0.0 and (
                np.isfinite(self._friction).all()):
            settings[COULOMB] = self._friction.round(3).tolist(), 'of the probes, both directions'
        return settings

    def _probe(
        self, j: int, start: FloatArray, publish: Callable[[Sequence[float], float], None],
    ) -> None:
        """
        Move joint j away from its nearer limit, and back; check its way, friction and torque.

        The reference goes further while friction holds the joint. The mean of both directions has
        no friction.
        """
        arm = self._arm
        limits, step = arm.limits, per_joint(STEP, arm.joint_kinds)
        sign = 1.0 if limits.upper[j] - start[j] > start[j] - limits.lower[j] else -1.0
        (there, g_there, e_there), far = self._push(j, start, sign * step[j], 1, publish)
        (back, g_back, e_back), way = self._push(j, start, -sign * step[j], 0, publish)
        far = max(far, way)
        if max(abs(there), abs(back)) > NOISE * limits.effort[j] and (
                np.isfinite(e_there + e_back)):
            self._reported[j] = (e_there * there + e_back * back) / (there**2 + back**2)
        g, held = 0.5 * (g_there + g_back), ''
        if abs(g) > LEAST_SHARE * limits.effort[j]:
            self._share[j] = 0.5 * (there + back) / g
            held = f', held by {self._share[j]:.2f} g(q)'
        friction = max(0.5 * sign * (there - g_there - back + g_back), 0.0)
        is_moved = far > 0.5 * step[j]
        if is_moved:
            self._friction[j] = friction if friction > NOISE * limits.effort[j] else 0.0
        self._checks.add(
            f'probe of {arm.joint_names[j]}', is_moved and not abs(self._share[j] - 1.0) >= NEAR,
            f'moved by {far:.4f}, friction {"" if is_moved else "above "}{friction:.2g}{held}',
            f'moved by {step[j]:g}, held by 1.00 g(q)',
            'see drive, mount, and masses of the model' if is_moved else
            'friction or a brake holds it: set actuator.reflected_inertia and friction')

    def _push(
        self, j: int, start: FloatArray, step: float, first: int,
        publish: Callable[[Sequence[float], float], None],
    ) -> tuple[FloatArray, float]:
        """
        Move the reference of joint j from `start` (n,) by steps, at first `first`, until it moves.

        Return torque, g(q) and reported effort of the joint, and how far it is from its start.
        """
        watch, limits = self._watch, self._arm.limits
        began, goal, k = watch.measured()[j], start.copy(), first
        stiffness = self._stiffness.get(self._arm.joint_names[j], np.inf)
        reach = min(3.0 * REACH, max(
            float(REACH), FRICTION * limits.effort[j] / max(stiffness * abs(step), 1e-9)))
        self._torque.clear()
        self._states.clear()
        while True:
            goal[j] = np.clip(start[j] + k * step, limits.lower[j], limits.upper[j])
            watch.wait_taken(goal.tolist(), partial(publish, goal.tolist(), MOVE_TIME))
            watch.wait_end(goal.tolist(), lambda _: None)
            watch.wait_rest()
            tau, g, effort, q = self._of_joint(j)
            is_moved = (watch.measured()[j] - began) * np.sign(step) > 0.5 * abs(step)
            feedback = (tau[-1] - g[-1]) * np.sign(step)
            if is_moved or k >= reach or feedback >= FRICTION * limits.effort[j]:
                break
            k += 1
        mean = work_by_way(tau, g, effort, q, 0.25 * abs(step))
        return mean, abs(watch.measured()[j] - start[j])

    def _of_joint(self, j: int) -> FloatArray:
        """Return torque, g(q), reported effort and position of joint j (4, N), in N states."""
        stamps = sorted(self._torque.keys() & self._states.keys())
        if len(stamps) < 3:
            raise NoAnswerError(f'no message on {NODE}/computed_torque during the motion')
        q, effort = np.moveaxis(np.array([self._states[stamp] for stamp in stamps]), 1, 0)
        return np.stack([
            [self._torque[stamp][j] for stamp in stamps],
            [self._body.gravity(x)[j] for x in q],
            [self._arm.given_report.torque(x)[j] for x in effort], q[:, j]])

    def _on_state(self, message: JointState) -> None:
        """Keep the positions and efforts (2, n) of a stamp."""
        self._state |= zip(message.name, zip_longest(
            message.position, message.effort, fillvalue=np.nan))
        if self._state.keys() >= set(self._arm.joint_names):
            self._states[stamp_from_ros(message.header.stamp)] = np.transpose(
                [self._state[name] for name in self._arm.joint_names])

    def _on_torque(self, message: JointState) -> None:
        self._torque[stamp_from_ros(message.header.stamp)] = np.array(message.effort)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name in (f'{NODE}: drive', f'{NODE}: reference'):
                self._values |= {pair.key: pair.value for pair in status.values}
                for name, value in values_per_joint(status.values, STIFFNESS).items():
                    self._stiffness[name] = max(value, self._stiffness.get(name, 0.0))


def work_by_way(
    tau: FloatArray, g: FloatArray, effort: FloatArray, q: FloatArray, least: float,
) -> FloatArray:
    """
    Return the mean torque, g(q) and reported effort (3,) of a joint, each (N,), along its way q.

    They are work by way, in which no torque counts while the joint sticks. The torque between two
    states answers the state before them: it needs a period to act. If the joint moves by less than
    `least` [rad] or [m], they are the means of the last states.
    """
    passed = np.diff(q)[1:]
    values = np.stack([tau[:-2], 0.5 * (g[1:-1] + g[2:]), 0.5 * (effort[1:-1] + effort[2:])])
    way = float(passed.sum())
    return np.asarray(values @ passed / way if abs(way) > least else values[:, -10:].mean(axis=1))


def drive_settings(
    arm: ArmModel, verdicts: Mapping[str, str], share: FloatArray, used: Settings, failure: str,
    checks: Checklist,
) -> Settings:
    """
    Check the `verdicts` on the drives by joint; return the settings that they need.

    `share` (n,) of g(q) has held the joints, NaN if unknown; `used` are the settings of the node,
    and `failure` is why the motion has ended. After a wrong drive, the command of the other joints
    was only a stop: it shows no scale.
    """
    names, settings = arm.joint_names, Settings()
    stopped = re.findall(r"wrong_drive: '([^']*)'", failure)
    said = {name: verdicts.get(name, UNSEEN) if name in (stopped or names) else UNSEEN
            for name in names}
    for j, (name, text) in enumerate(said.items()):
        verdict, _, sentence = text.partition('; ')
        if abs(share[j] - 1.0) < NEAR:  # the command is right
            verdict = re.sub(r'^unclear: (report scale \S+) or .*', r'\1', verdict)
        checks.add(f'drive of {name}', UNKNOWN if verdict == UNSEEN else verdict == AGREES,
                   verdict, AGREES, sentence)
        scaled = re.fullmatch(
            r'(command|report) scale (\S+)', verdict.replace('reversed', 'command scale -1'))
        if scaled and is_scale(float(scaled[2])):
            key, factor = f'effort.{scaled[1]}_scale', float(scaled[2])
            if abs(factor + 1.0) < RESOLUTION:
                factor = -1.0
            before: Any = settings.get(key, used.get(key, (1.0, '')))[0]
            scales = np.ones(len(names)) * before
            scales[j] *= factor if scaled[1] == 'command' else 1.0 / factor
            settings[key] = scales.round(3).tolist(), f'{name}: {text}'
        elif verdict == 'adds gravity':
            settings['robot_compensates'] = ['gravity'], sentence
        elif verdict.startswith(TILTED):
            found = np.array(json.loads(re.findall(r'\[.*?\]', sentence)[0]))
            found *= np.linalg.norm(arm.gravity) / np.linalg.norm(found)
            settings['gravity'] = found.round(2).tolist(), sentence
    is_right = all(text.startswith((AGREES, UNSEEN)) for text in said.values()) and not stopped
    if failure:
        checks.add('motion', BAD if is_right else False, failure, 'a motion as commanded',
                   'see the drives')
    is_shown = is_right and not failure and not any(
        one.grade is CHECK for one in checks if one.name.startswith('probe of'))
    settings['command'] = ('computed_torque', (
        f'held the arm, and moved each joint by {STEP[0]:g} rad or {STEP[1]:g} m')) if (
        is_shown) else ('none', 'before the first command, run connect until all joints pass')
    return settings
