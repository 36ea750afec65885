# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The drive check: whether the commanded torque acts at the joints.

Each state costs one sum. At the end of an interval of 10 to 40 ms (`drive_samples`), the torque
that the motion needs is compared with the command; only if they differ by more than friction,
rotors and the model explain, the causes are compared (`drive_comparison`). The verdicts
(`drive_verdicts`) are computed when they are read, outside the control path.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.options import DEFAULT_EFFORT_RATE, FULL_EFFORT_TIME
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.model.regressor import GravityRegressor, LoadRegressor
from robot_dynamics.monitoring.drive_causes import (
    Cause,
    DriveModel,
    GRAVITY,
    Joints,
    MODEL,
    REVERSED,
    SCALE,
)
from robot_dynamics.monitoring.drive_comparison import compare, Comparison
from robot_dynamics.monitoring.drive_samples import (
    COUNT,
    DriveSamples,
    DriveWindow,
    LONGEST,
    SLOW,
    smoothed,
    START,
)
from robot_dynamics.monitoring.drive_tilt import tilted
from robot_dynamics.monitoring.drive_verdicts import (
    agreeing,
    candidates,
    causes_verdicts,
    NOT_YET,
    report_verdicts,
    resting_verdicts,
    right_verdict,
    Verdict,
)

RECENT = 10
"""Samples that decide in the control path, after START."""
LATER = 3
"""Samples between two comparisons after START: one takes 1.5 ms, and a contact may last."""
SOFT = 0.05
"""
Feedback, as a fraction of the effort limit, with which a command begins: what friction can bear.

A drive with the opposite sign turns feedback into a motor; that of gravity alone shows it.
"""
SOFT_TIME, SOFT_RAMP = 0.06, 0.14
"""[s] of the first command with this feedback, and [s] in which it then grows by the limit."""
NAMING = 1.0
"""[s] after a wrong drive was seen that its name is decided from."""


class WrongDrive(NamedTuple):
    """A wrong drive that was seen in the control path: its cause, and when [s]."""

    time: float
    cause: Cause


def _at_joints(output: ControlOutput, command: FloatArray) -> FloatArray:
    """Return the torque (n,) that right drives deliver for a command."""
    torque = command if output.drive is None else output.drive.torque(command)
    return np.asarray(torque + output.robot.gravity + output.robot.friction)


def _share(causes: list[Cause]) -> float:
    """
    Return the share of the effort that holds a joint, 0 if its drive may turn it to a motor.

    A scale above 1 that may also be added gravity is taken first: what the arm then does tells.
    """
    scale = next((one.value for one in causes if one.name == SCALE), 1.0)
    if scale <= 1.0 and (scale < 0.0 or any(one.name in (REVERSED, GRAVITY) for one in causes)):
        return 0.0
    return 1.0 / max(1.0, scale)


class DriveCheck:
    """Checks the drives of one arm; the control path calls `take` with the controller's lock."""

    def __init__(self, controller: Controller) -> None:
        self._controller, arm = controller, controller.arm
        self.joints = joints = Joints.of_arm(arm, DEFAULT_EFFORT_RATE * FULL_EFFORT_TIME)
        self._friction = joints.friction[0]
        self._rotor = 0.5 * (joints.rotor[0] + joints.rotor[1])
        self.samples = DriveSamples(arm.joint_count)
        self._loads = [LoadRegressor(arm, arm.link_names[-1]) for _ in range(2)]
        self._gravities = [GravityRegressor(arm) for _ in range(2)]
        """Of both, one for the control path and one for `verdicts`."""
        self._n, self._none = arm.joint_count, np.zeros(arm.joint_count)
        self._is_commanded = False
        self._found: dict[int, Verdict] = {}
        self._right: dict[int, Verdict] = {}
        self.soft_until = -np.inf
        """Time [s] until which the feedback is bounded."""
        self.wrong: WrongDrive | None = None
        """The wrong drive that was seen since the first command, or None."""

    def go_on(self) -> None:
        """Begin with an arm that is commanded already, by another model: this is no start."""
        self._is_commanded = True

    def restart(self) -> None:
        """Continue after a gap of the states."""
        self.samples.restart()

    def command(self, time: float, effort: FloatArray) -> None:
        """Take an effort (n,) that is commanded without a state."""
        if time > self.samples.due + LONGEST:  # no states arrive
            self.samples.restart()
        self.samples.command(time, effort)

    def softened(self, time: float, output: ControlOutput, command: FloatArray) -> FloatArray:
        """Return a command (n,) whose feedback is bounded, at a time [s] of the states."""
        holding = output.holding_effort()
        feedback = command - holding
        grown = max(0.0, time - self.samples.start - SOFT_TIME) / SOFT_RAMP
        share = (SOFT + grown) * self.joints.limit / np.maximum(np.abs(feedback), 1e-9)
        return np.asarray(holding + min(1.0, float(share.min())) * feedback)

    def take(
        self, time: float, output: ControlOutput, v: FloatArray, effort: FloatArray | None,
    ) -> Fault | None:
        """
        Take a state and the effort (n,) commanded for it; return the fault of a wrong drive.

        `time` [s] is that of the states, v (n,) the velocity with less delay. `effort` is None
        without a command.
        """
        samples = self.samples
        if effort is None:
            effort, self._is_commanded = self._none, False
        elif not self._is_commanded:
            self._is_commanded, self.wrong = True, None
            self._found, self._right = {}, {}
            self.soft_until = time + SOFT_TIME + SOFT_RAMP
            samples.begin(time, v)
        if time < samples.due:  # the usual case
            samples.commands.append(effort)
            samples.since.append(time)
            return None
        mean, state = samples.mean_command(time), output.state
        if mean is not None:
            mean, samples.active = _at_joints(output, mean), _at_joints(
                output, samples.commands[-1])
        is_new = samples.take(time, state.q, v, mean, state.dynamics)
        samples.command(time, effort)
        wrong = self.wrong
        if not is_new or not self._is_commanded or not (
                self._is_suspicious(*samples.last) if wrong is None else (
                    wrong.cause.name in (SCALE, GRAVITY) and time <= wrong.time + NAMING)):
            return None
        is_start = self._is_start(time)
        if not is_start and samples.count % LATER or not (
                self._controller.laws.follows or is_start and samples.moves_at_once):
            return None
        window = samples.window(COUNT if is_start else RECENT)
        try:
            comparison = self._compare(window, is_start, 0)
        except np.linalg.LinAlgError:  # an error of the check must not stop the control path
            return None
        found = candidates(comparison)
        if not found or wrong is not None and (
                found[0].is_bound or found[0].name not in (SCALE, GRAVITY)):
            return None
        verdicts = causes_verdicts(comparison, found)
        self._found = dict(verdicts)
        self.wrong = WrongDrive(time if wrong is None else wrong.time, found[0])
        return self._fault(comparison, found, verdicts)

    def _fault(
        self, found: Comparison, causes: list[Cause], verdicts: dict[int, Verdict],
    ) -> Fault:
        best, worst = causes[0], next(iter(verdicts))
        name, verdict = self._controller.arm.joint_names[worst], verdicts[worst]
        shares = {j: _share([found.at_joint(cause, j) for cause in causes]) for j in verdicts}
        if best.name == SCALE and shares[worst] < 1.0:  # a unit, perhaps of all commands
            shares = {j: 1.0 / max(1.0, found.at_joint(best, j).value)
                      for j in range(self._n)} | shares
        return Fault(
            'wrong_drive', f'{name!r}: {verdict.verdict}; {verdict.sentence}', latched=True,
            shares=tuple(shares.items()))

    def _is_suspicious(self, u: FloatArray, y: FloatArray, a: FloatArray) -> bool:
        """Return whether a sample needs more torque y than that of a right drive."""
        error = np.abs(y - u) - self._rotor * np.abs(a) - MODEL * np.abs(u)
        return bool((error > self._friction).any())

    def _is_start(self, time: float) -> bool:
        """Return whether a time [s] is within START of the first motion."""
        return self.samples.moved_since <= time <= self.samples.settled

    def _compare(self, window: DriveWindow, is_start: bool, user: int) -> Comparison:
        motion = window.position, window.velocity, smoothed(window.acceleration)
        gravity = self._controller.dynamics.arm.pinocchio_model.gravity.linear
        samples, none = self.samples, np.zeros(self._n, dtype=bool)
        model = DriveModel(
            window, self.joints, samples.moved_first if is_start else none, samples.moves_at_once)
        return compare(
            model, self._loads[user](*motion)[..., :4],
            tilted(model, self._gravities[user](*motion), np.array(gravity)), user == 1)

    # ------------------------------------------------------------------ verdicts

    def is_right(self, joint: int) -> bool:
        """Return whether the motion has confirmed the drive of a joint."""
        return joint in self._right and joint not in self._found

    def verdicts(self) -> tuple[Verdict, ...]:
        """Return the verdict on each joint; takes some milliseconds, in any one thread."""
        with self._controller.lock:
            window, start = self.samples.window(), self.samples.start
            wrong, is_commanded = self.wrong, self._is_commanded
            found, right = self._found, self._right
        follows, may_name = self._controller.laws.follows, is_commanded and len(window.time) > 0
        if may_name and (wrong is not None or follows and (
                len(right) < self._n and bool((np.abs(window.velocity) > SLOW).any()))):
            self._name(window, start, wrong, found, right)
        found.update(resting_verdicts(window, self.joints, is_commanded))
        agrees = np.array([j in right for j in range(self._n)])
        reported = report_verdicts(window, self.joints, agrees) if is_commanded else {}
        return tuple(
            found.get(j) or reported.get(j) or right.get(j, NOT_YET) for j in range(self._n))

    def _name(
        self, window: DriveWindow, start: float, wrong: WrongDrive | None,
        found: dict[int, Verdict], right: dict[int, Verdict],
    ) -> None:
        """Add the verdicts of a window of samples with a command."""
        settled = self.samples.settled
        first = window.between(start, settled)
        if wrong is not None:
            is_start = self._is_start(wrong.time)
            window = window.between(start if is_start else wrong.time - 2.0 * NAMING,
                                    wrong.time + NAMING)
        else:
            is_start = len(first.time) > 0 and self._is_start(window.time[-1] - START)
            window = first if is_start else window.between(settled, np.inf)
        if len(window.time) == 0:
            return
        comparison = self._compare(window, is_start, 1)
        named = causes_verdicts(comparison, candidates(
            comparison, None if wrong is None else wrong.cause.joint))
        found.update(named)
        if wrong is None and not named:
            right.update({
                j: right_verdict(float(comparison.gains.gain[j]), float(
                    comparison.gains.deviation[j]))
                for j in np.flatnonzero(agreeing(comparison)).tolist() if j not in found})
