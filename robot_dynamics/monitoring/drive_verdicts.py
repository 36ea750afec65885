# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
What the drives of an arm do instead of what the model says: one verdict and sentence per joint.

A wrong drive is named if its evidence exceeds that of all right drives, loads and pushes by
CERTAIN. Causes that explain the same data nearly as well are named together.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.effort_calibration import LARGEST_SCALE, LEAST_SCALE
from robot_dynamics.monitoring.drive_causes import (
    ALL,
    Cause,
    CLIPPED,
    GAINS,
    GRAVITY,
    Joints,
    NO_EFFECT,
    REVERSED,
    SCALE,
)
from robot_dynamics.monitoring.drive_comparison import Comparison, DELAYED, delayed, DELAYS
from robot_dynamics.monitoring.drive_samples import DriveWindow
from robot_dynamics.monitoring.drive_tilt import TILTED

CERTAIN, SIMILAR = 10.0, 4.0
"""Log evidence beyond right drives to name a wrong one; and of causes that are named together."""
SURE = 5.0
"""Log evidence of a right drive at a joint, beyond any wrong one."""
NEAR = 0.25
"""Largest error of the gain of a right drive, with two deviations."""
REST = 0.005
"""[rad] or [m] within which the joints stay at rest."""
LEAST_REST = 12
"""Samples of a rest."""
REPORT_ERROR, REPORT_SPREAD = 0.15, 0.1
"""Error of the scale of a report that is named, and largest residual of its fit."""
LEAST_REPORT = 0.02
"""Fraction of the effort limit: least command whose report is compared, least step to name."""
LATE_REPORT = 0.5
"""Largest residual of a late report by that of one in time."""
LEAST_LEVELS = 4
"""Levels of a report in steps: an arm at rest and its brakes are two."""
AGREES, UNKNOWN, REPORT, COARSE = 'agrees', 'not observable yet', 'report scale', 'coarse'
_REMEDIES = {
    REVERSED: 'set effort.command_scale to its negative value, or reverse the motor',
    NO_EFFECT: 'the drive is off, in another mode or braked, or the command does not reach it',
    SCALE: 'set effort.command_scale to this value',
    CLIPPED: 'something limits the effort: the limit or mode of the drive, <safety_controller>',
    GRAVITY: 'the robot or another controller compensates gravity: set robot_compensates: '
             '[gravity], or end the other controller',
    TILTED: 'set gravity, or mount the base as in the URDF',
    DELAYED: 'lower gains.natural_frequency, or shorten the way of the command'}


class Verdict(NamedTuple):
    """The verdict on one joint, for programs, and a sentence with its evidence."""

    verdict: str
    sentence: str

    @property
    def is_wrong(self) -> bool:
        """Return whether a cause is named."""
        return self.verdict not in (AGREES, UNKNOWN)


NOT_YET = Verdict(UNKNOWN, 'no motion has shown yet what the drive does')


def candidates(found: Comparison, joint: int | None = None) -> list[Cause]:
    """
    Return the wrong drives that explain the data, the best first; empty if none is certain.

    `joint` is the number of the joint whose drive is known to be wrong, or ALL, None if unknown.
    """
    if found.wrong[0].evidence < found.right + CERTAIN:
        return []
    wrong = [cause for cause in found.wrong if joint in (None, cause.joint)]
    best, similar = wrong[0], dict[str, Cause]()
    for cause in wrong:
        if cause.evidence > best.evidence - SIMILAR and (
                cause.joint in (best.joint, ALL) or best.joint == ALL):
            similar.setdefault(cause.name, cause)
    if SCALE in similar and _is_simpler(similar[SCALE], set(similar)):
        del similar[SCALE]
    return list(similar.values())


def _is_simpler(scale: Cause, names: set[str]) -> bool:
    """Return whether a cause that is named already is this scale."""
    return any(name in names and abs(scale.value - gain) < error
               for name, gain, error in ((REVERSED, -1.0, 0.5), (NO_EFFECT, 0.0, 0.1)))


def causes_verdicts(found: Comparison, causes: list[Cause]) -> dict[int, Verdict]:
    """Return the verdicts of causes that explain the data, by joint; see `candidates`."""
    if not causes:
        return {}
    best, verdicts = causes[0], {}
    for j in range(len(found.doubt)) if best.joint == ALL else [best.joint]:
        if found.at_joint(best, j).evidence < SIMILAR:
            continue
        own = [one for one in (found.at_joint(cause, j) for cause in causes)
               if one.evidence >= SIMILAR]
        words = [_word(cause) for cause in own] + [AGREES] * (len(own) < len(causes))
        sentence = '; '.join(_sentence(cause) for cause in own)
        verdicts[j] = Verdict(words[0], sentence) if len(words) == 1 and not (
            own[0].is_bound) else Verdict(
            f'unclear: {" or ".join(words)}',
            f'{sentence}; a motion with other torques at this joint separates them')
    return verdicts


def _word(cause: Cause) -> str:
    if cause.name == SCALE:
        return f'{SCALE} {round(cause.value, 2)}{" or more" if cause.is_bound else ""}'
    if cause.name == CLIPPED:
        return f'{CLIPPED} {round(cause.value, 1)}'
    if cause.name == TILTED:
        return f'{TILTED} {cause.value:.0f}'
    return f'{DELAYED} {cause.value:.3f}' if cause.name == DELAYED else cause.name


def _sentence(cause: Cause) -> str:
    gain = f'{cause.value:.2f} ± {2.0 * cause.deviation:.2f}'
    if cause.is_bound:
        return (f'the motion needs at least {cause.value:.2f} of the command, because the drive '
                'reaches its effort limit')
    evidence = {
        **dict.fromkeys(GAINS, f'the motion needs {gain} of the command'),
        CLIPPED: f'the motion needs no more than {gain}, whatever is commanded',
        GRAVITY: 'the motion needs g(q) more than the command at all joints',
        TILTED: f'the motion needs a gravity of {np.round(cause.gravity, 1).tolist()} m/s² in the '
                f'base frame, tilted by {cause.value:.0f}°',
        DELAYED: f'the motion follows the command {cause.value:.3f} s late'}
    return f'{evidence[cause.name]}: {_REMEDIES[cause.name]}'


def resting_verdicts(
    window: DriveWindow, joints: Joints, is_commanded: bool,
) -> dict[int, Verdict]:
    """
    Return the verdicts of a rest in which the command does not carry the arm.

    Without a command, the report has to show that the drives carry it, and not the brakes.
    """
    if len(window.time) < LEAST_REST or np.ptp(window.position[-LEAST_REST:], axis=0).max() > REST:
        return {}
    u, g, r = (values[-LEAST_REST:].mean(axis=0) for values in (
        window.commanded, window.gravity, window.reported))
    heavy = np.abs(g) > joints.visible
    if heavy.sum() < 2 or not (np.abs(u) < 0.5 * joints.visible + 0.1 * np.abs(g))[heavy].all():
        return {}
    share = float(u[heavy] @ g[heavy] / (g[heavy] @ g[heavy]))
    if not is_commanded and not r[heavy] @ g[heavy] > 0.75 * g[heavy] @ g[heavy]:
        return {}
    error = float(np.linalg.norm(joints.friction[1][heavy]) / np.linalg.norm(g[heavy]))
    sentence = (f'the command that holds the arm is {share:.2f} g(q) ± {error:.2f}, expected 1: '
                f'{_REMEDIES[GRAVITY]}')
    return {j: Verdict(GRAVITY, sentence) for j in range(len(g))}


def _report_delay(t: FloatArray, u: FloatArray, r: FloatArray) -> float:
    """Return by how much [s] reports r (k,) follow commands u (k,) late, out of DELAYS, or 0."""
    left = {}
    for d in (0.0, *DELAYS):
        late = delayed(t, u[:, np.newaxis], d)[:, 0]
        left[d] = float(np.linalg.norm(r - (late @ r) / (late @ late) * late))
    best = min(left, key=lambda d: left[d])
    return best if left[best] < LATE_REPORT * left[0.0] else 0.0


def report_verdicts(
    window: DriveWindow, joints: Joints, agrees: BoolArray,
) -> dict[int, Verdict]:
    """Return the verdicts of joints whose report differs from a command that is understood."""
    verdicts = {}
    for j in range(len(agrees)):
        u, r = window.in_force[:, j], window.reported[:, j]
        used = np.isfinite(r + u) & (np.abs(u) > LEAST_REPORT * joints.limit[j])
        if used.sum() < LEAST_REST:
            continue
        t, u, r = window.time[used], u[used], r[used]
        ratio, step = float(r @ u / (u @ u)), _step(r)
        delay = _report_delay(t, u, r) if u.std() > LEAST_REPORT * joints.limit[j] else 0.0
        left = float(np.linalg.norm(r - ratio * u) / np.linalg.norm(u))
        if step > LEAST_REPORT * joints.limit[j]:
            verdicts[j] = Verdict(f'{COARSE} {round(step, 2)}', (
                f'the drive reports steps of {step:.2g}: use a unit of torque that it resolves'))
        elif delay > 0.0:
            verdicts[j] = Verdict(f'{DELAYED} {delay:.3f}', (
                f'the report follows the command {delay:.3f} s late: {_REMEDIES[DELAYED]}'))
        elif abs(ratio - 1.0) > REPORT_ERROR and left < REPORT_SPREAD * max(abs(ratio), 0.2):
            verdicts.update(_scaled(j, ratio, agrees[j]))
    return verdicts


def _scaled(j: int, ratio: float, agrees: bool) -> dict[int, Verdict]:
    """Return the verdict on a report that is `ratio` times the command."""
    value = round(ratio, 2)
    if agrees:
        remedy = f'set effort.report_scale to {1.0 / ratio:.3g}' if (
            LEAST_SCALE <= abs(ratio) <= LARGEST_SCALE) else 'set measured_effort, or its unit'
        return {j: Verdict(f'{REPORT} {value}', (
            f'the report is {ratio:.3g} of a command that the motion confirms: {remedy}'))}
    if abs(ratio) < REPORT_ERROR:  # brakes, or no real measurement
        return {}
    return {j: Verdict(f'unclear: {REPORT} {value} or {SCALE} {value}', (
        f'the report is {ratio:.3g} of the command, and no motion has confirmed the command yet; '
        'a motion separates them'))}


def _step(r: FloatArray) -> float:
    """Return the step of reports (k,) on few levels that are its multiples, 0 without one."""
    levels = np.unique(np.round(r, 6))
    if not LEAST_LEVELS <= len(levels) <= len(r) // 2:
        return 0.0
    step = float(np.diff(levels).min())
    return step if (np.abs(levels / step - np.round(levels / step)) < 0.05).all() else 0.0


def right_verdict(gain: float, deviation: float) -> Verdict:
    """Return the verdict on a drive whose motion confirms its command."""
    return Verdict(AGREES, f'the motion needs {gain:.2f} ± {2.0 * deviation:.2f} of the command')


def agreeing(found: Comparison) -> BoolArray:
    """Return which joints (n,) a motion has shown to be right."""
    gain, deviation = found.gains.gain, found.gains.deviation
    return np.asarray((found.doubt < -SURE) & (np.abs(gain - 1.0) + 2.0 * deviation < NEAR))
