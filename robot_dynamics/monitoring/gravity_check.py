# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A check at start, in a static hold, for gravity that is compensated twice.

At rest, with the brakes released and without contact, the effort at the joints is g(q) up to
static friction, independent of the source of the effort. The measured effort minus the command u
contains the least-squares share of gravity

    k = gᵀ (τ_measured − u) / (gᵀ g)

which is 1 if the robot or another controller adds gravity compensation, and 0 if the command is
the only effort. k is lower by 1 if the measured effort excludes gravity (`effort_convention`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.actuator import Actuators
from robot_dynamics.joints.angle_wrapping import nearest_turn
from robot_dynamics.joints.effort_calibration import EffortCalibration
from robot_dynamics.joints.effort_convention import (
    EffortConvention,
    joint_effort_at_rest,
    MOTOR_SIDE,
)
from robot_dynamics.joints.friction import JointFriction

STILL_BAND = 0.0025
"""Largest distance [rad] or [m] of every joint from the first sample, apart from whole turns."""
WINDOW_NS = 500_000_000
MIN_SAMPLES = 20
MAX_GAP_NS = WINDOW_NS // 2
SAMPLE_PERIOD_NS = WINDOW_NS // 110
"""Shortest interval of the stored states: about a hundred per window are fast to judge."""
MIN_GRAVITY = 0.1
"""Smallest gravity effort [N·m] or [N] with which a joint is used."""
CLEARANCE = 4.0
"""Smallest ratio of the gravity effort to friction and noise with which a joint is used."""
TOLERANCE = 0.5
"""Half of the difference between the values of k to tell apart, 0 and 1."""
MARGIN = 0.5 * TOLERANCE
"""Largest addition of friction, noise and gears to the tolerance; largest difference of k between
the two halves of a window; and share of gravity in the measured effort below which the brakes
probably carry the arm."""
UNLOADED_PATIENCE_NS = 3_000_000_000
"""Duration of this state under a command: the command first has to arrive and open the brakes."""

STILL = 'waiting for the arm to stand still for 0.5 s'
POSE = 'cannot decide in this pose: no joint bears gravity well above its friction and noise'
UNLOADED_WORDS = (
    'cannot decide: the measured effort does not carry the arm (brakes, or no real measurement)')
NO_EFFORT = 'no measured effort'


@dataclass(frozen=True, eq=False)
class GravityVerdict:
    """
    The result of a static hold: the share k, its expected value, and the efforts it is based on.

    `measured` (on the joint side), `command` (zeros if there is no command) and `gravity` are (n,)
    [N·m] or [N], medians over the window; `used` (n,) marks the joints from which k is computed.
    """

    ratio: float
    expected: float
    tolerance: float
    measured: FloatArray
    command: FloatArray
    gravity: FloatArray
    used: BoolArray

    @property
    def excess(self) -> float:
        """Return k minus its expected value."""
        return self.ratio - self.expected

    @property
    def agrees(self) -> bool:
        return abs(self.excess) <= self.tolerance


class _Sample(NamedTuple):
    t: int
    effort: FloatArray
    command: FloatArray
    gravity: FloatArray


class GravityCheck:
    """
    Collects states until one static hold shows which effort carries the arm; for one thread.

    `waiting` states the condition that the check waits for.
    """

    def __init__(
        self, convention: EffortConvention, friction: JointFriction, actuators: Actuators | None,
        is_continuous: BoolArray, drive: EffortCalibration | None = None,
        report: EffortCalibration | None = None,
    ) -> None:
        """
        Take the known `friction` and `actuators` of the arm, which increase the tolerance.

        `is_continuous` (n,) marks the joints whose position may step by whole turns. `drive` are
        the drives of the arm if their command is not the torque, `report` if their report is not.
        """
        self._drive, self._report = drive, report
        self._is_continuous = is_continuous
        self._convention, self._actuators = convention, actuators
        self._friction = sum(friction.at_rest, start=np.zeros(len(is_continuous)))
        gears = actuators is not None and convention.measured_effort in MOTOR_SIDE
        self._gear_loss = 1.0 / actuators.efficiency - 1.0 if actuators is not None and gears \
            else np.zeros_like(self._friction)
        self.waiting = STILL
        self._unloaded_since: int | None = None
        self._samples: list[_Sample] = []
        self._first_position = np.zeros_like(self._friction)
        self._commanded = False
        self._last_time = 0

    def add(
        self, t: int, q: FloatArray, effort: FloatArray, command: FloatArray | None,
        gravity: FloatArray,
    ) -> GravityVerdict | None:
        """
        Take a state at the time t [ns]; return the verdict, or None until the check decides.

        `effort` (n,) is the effort that the robot reports, NaN for joints without a measurement;
        `command` (n,) is active at that time, None for no command; `gravity` (n,) is the gravity
        torque that the robot would compensate.
        """
        if not self._samples or not self._continues(t, q, command):
            self.waiting = STILL if self._samples else self.waiting
            self._samples.clear()
            self._first_position, self._commanded = q, command is not None
        self._last_time = t
        if self._samples and t - self._samples[-1].t < SAMPLE_PERIOD_NS:
            return None
        if command is None:
            command = np.zeros_like(q) if self._drive is None else self._drive.offset
        self._samples.append(_Sample(t, effort, command, gravity))
        if t - self._samples[0].t < WINDOW_NS or len(self._samples) < MIN_SAMPLES:
            return None
        verdict = self._judge()
        self._samples.clear()
        return verdict

    def _continues(self, t: int, q: FloatArray, command: FloatArray | None) -> bool:
        """Return whether the arm has stood still since the first sample of the window."""
        first = self._first_position
        way = np.abs(nearest_turn(q, first, self._is_continuous) - first)
        return (
            0 < t - self._last_time <= MAX_GAP_NS and (command is not None) == self._commanded
            and bool(way.max() <= STILL_BAND))

    def _judge(self) -> GravityVerdict | None:
        """Return the verdict of a whole window, or None and state the reason in `waiting`."""
        efforts, commands, gravities = (
            np.array([getattr(sample, name) for sample in self._samples])
            for name in ('effort', 'command', 'gravity'))
        measured = joint_effort_at_rest(
            self._convention.measured_effort, efforts, self._actuators)
        if self._report is not None:
            measured = _as_torque(
                self._report, measured, self._convention.lacks_gravity * gravities)
        if self._drive is not None:
            commands = _as_torque(
                self._drive, commands, self._convention.compensates_gravity * gravities)
        finite = np.isfinite(measured).all(axis=0)
        if not finite.any():
            self.waiting = NO_EFFORT
            return None
        # Medians: the first states of a hold may precede the effort that holds the arm.
        g = _median(gravities)
        measured = np.where(finite, measured, 0.0)
        beyond = np.where(finite, measured - commands, 0.0)
        used = finite & (np.abs(g) > np.maximum(MIN_GRAVITY, CLEARANCE * self._friction))
        half = len(beyond) // 2
        if used.any() and abs(_gravity_ratio(g, beyond[:half], used)
                              - _gravity_ratio(g, beyond[half:], used)) > MARGIN:
            self.waiting = STILL  # a command, or what opens brakes, has just begun to act
            return None
        band = self._friction + _deviation(beyond)
        used &= np.abs(g) > CLEARANCE * band
        if not used.any():
            self.waiting = POSE
            return None
        if not self._is_loaded(g, measured, used):
            return None
        band = (band + self._gear_loss * np.abs(g))[used]
        widened = float(np.abs(g[used]) @ band / (g[used] @ g[used]))
        return GravityVerdict(
            _gravity_ratio(g, beyond, used), self._convention.expected_ratio,
            TOLERANCE + min(widened, MARGIN),
            np.where(finite, _median(measured), np.nan),
            _median(commands), g, used)

    def _is_loaded(
        self, g: FloatArray, measured: FloatArray, used: BoolArray,
    ) -> bool:
        """Return whether the measured effort carries the arm, or a command was active for long."""
        missing = g if self._convention.lacks_gravity else np.zeros_like(g)
        if _gravity_ratio(g, measured + missing, used) >= MARGIN:
            self._unloaded_since = None
            return True
        self.waiting = UNLOADED_WORDS
        first, last = self._samples[0].t, self._samples[-1].t
        if not self._commanded:
            self._unloaded_since = None
            return False
        if self._unloaded_since is None or self._unloaded_since > last:
            self._unloaded_since = first
        return last - self._unloaded_since >= UNLOADED_PATIENCE_NS


def _as_torque(drive: EffortCalibration, effort: FloatArray, gravity: FloatArray) -> FloatArray:
    """
    Return the torque of the driver's effort (samples, n), without `gravity`.

    `gravity` (samples, n) is the gravity torque that the robot adds to the effort, or that the
    effort excludes. It passes the drive together with the effort.
    """
    return np.asarray(drive.torque(effort + gravity) - gravity)


def _gravity_ratio(g: FloatArray, efforts: FloatArray, used: BoolArray) -> float:
    """Return the least squares share of gravity in the median of efforts (samples, n)."""
    return float(g[used] @ _median(efforts)[used] / (g[used] @ g[used]))


def _deviation(efforts: FloatArray) -> FloatArray:
    """Return the standard deviation (n,) of normal noise with the median absolute deviation."""
    return np.asarray(1.4826 * _median(np.abs(efforts - _median(efforts))))


def _median(samples: FloatArray) -> FloatArray:
    """Return the median (n,) of samples (m, n); np.median loads a module at its first call."""
    m = len(samples)
    return np.asarray(np.sort(samples, axis=0)[[(m - 1) // 2, m // 2]].mean(axis=0))


def verdict_in_words(
    verdict: GravityVerdict, joint_names: tuple[str, ...], convention: EffortConvention,
) -> str:
    """Return one line with the numbers, their interpretation, and the parameters to change."""
    comparison = (
        f'in a static hold the measured effort exceeds the command by {verdict.ratio:.2f} times '
        f'g(q), expected {verdict.expected:.0f} (within {verdict.tolerance:.2f}) from '
        f'measured_effort {convention.measured_effort!r} and robot_compensates '
        f'{list(convention.robot_compensates)}')
    if verdict.agrees:
        return comparison
    numbers = '; '.join(
        f'{name}: measured {measured:.3f}, command {command:.3f}, g(q) {gravity:.3f}'
        + ('' if used else ' (not used)')
        for name, measured, command, gravity, used in zip(
            joint_names, verdict.measured.tolist(), verdict.command.tolist(),
            verdict.gravity.tolist(), verdict.used.tolist()))
    return f'{comparison}. {numbers}. {_advice(verdict, convention)}'


def _advice(verdict: GravityVerdict, convention: EffortConvention) -> str:
    reasons = []
    if verdict.excess > 0.0:
        if not convention.compensates_gravity:
            reasons.append(
                'the robot compensates gravity on its own, or another controller holds it, and '
                'gravity would be compensated twice: set robot_compensates: [gravity], or keep '
                'command: none')
        if convention.lacks_gravity:
            reasons.append(
                'the measured effort contains gravity: set measured_effort: joint_torque')
    else:
        if not convention.lacks_gravity:
            reasons.append(
                'gravity is not in the measured effort: set measured_effort: '
                'joint_torque_without_gravity')
            reasons.append(
                'brakes carry the arm, or the effort is not measured: release the brakes, or set '
                'measured_effort: none')
        if convention.compensates_gravity:
            reasons.append(
                'the robot does not compensate gravity: remove it from robot_compensates')
    reasons.append('load, URDF or measured_effort do not describe this robot')
    return 'Either ' + '; or '.join(reasons)
