# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The comparison of the causes of `drive_causes`: right drives, pushes and loads; wrong drives."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.monitoring.drive_causes import (
    AGAINST,
    ALL,
    Cause,
    CLIPPED,
    DriveModel,
    Fits,
    GAINS,
    GOOD,
    GRAVITY,
    LOADED,
    MODEL,
    NO_EFFECT,
    PUSHED,
    REVERSED,
    SCALE,
)
from robot_dynamics.monitoring.drive_samples import INTERVAL

RIGHT = GOOD, PUSHED, LOADED
PUSH_ODDS = -9.0, 0.0, 12.0
"""
Log odds of a push, against a wrong drive: at the first command, within START, and later.

A push at the first command is a coincidence, such as each further scale that differs; a drive
does not become wrong later.
"""
DELAYED = 'delayed by'
DELAY_MARGIN = 40.0
"""Log evidence that a delay needs more: loads and rotors in a fast motion look like one."""
DELAYS = 0.03, 0.04, 0.06, 0.08
"""[s]: shorter ones cannot be told from the model in samples of 40 ms."""


class Comparison(NamedTuple):
    """
    All causes, the best first, the gains of the drives, and the doubt (n,); see `compare`.

    The doubt is the log evidence of a reversed drive or none, beyond that of a right one.
    """

    causes: list[Cause]
    gains: Fits
    doubt: FloatArray

    @property
    def wrong(self) -> list[Cause]:
        """The causes that are wrong drives."""
        return [cause for cause in self.causes if cause.name not in RIGHT]

    @property
    def right(self) -> float:
        """The log evidence of the best right cause."""
        return max(cause.evidence for cause in self.causes if cause.name in RIGHT)

    def at_joint(self, cause: Cause, j: int) -> Cause:
        """Return the same cause with its value at one joint."""
        return next(
            (one for one in self.causes if one.name == cause.name and one.joint == j), cause)


def compare(
    model: DriveModel, columns: FloatArray, tilted: Cause, is_thorough: bool = False,
) -> Comparison:
    """
    Return the comparison.

    `columns` are those of `DriveModel.load`, `tilted` is the cause of `drive_tilt`.

    `is_thorough` adds delays, and makes gains and doubt those of the whole motion.
    """
    window, u = model.window, model.window.commanded
    gain = 1.0, MODEL
    good, push = model.right(), PUSH_ODDS[0 if model.is_start and model.at_once else (
        1 if model.is_start else 2)]
    base = float(good.evidence.sum())
    pushed = np.maximum(model.fit(u, gain, is_pushed=True).evidence, good.evidence)
    gravity, load = model.fit(u, gain, window.needed - window.gravity), model.load(columns)
    found = [
        Cause(GOOD, ALL, 0.0), Cause(PUSHED, ALL, push + float(pushed.sum()) - base),
        load._replace(evidence=load.evidence - base),
        Cause(GRAVITY, ALL, float(gravity.evidence.sum()) - base if (
            model.explains_arm(gravity)) else -np.inf),
        tilted._replace(evidence=tilted.evidence - base)]
    doubt = np.full(len(good.gain), -np.inf)
    for name, fits in (
            *((name, model.fit(u, GAINS[name])) for name in (REVERSED, NO_EFFECT)),
            (SCALE, model.scaled()), (CLIPPED, model.clipped())):
        more = np.where(model.explains(fits), fits.evidence - good.evidence, -np.inf)
        doubt = np.maximum(doubt, more)
        own = np.where(model.moved_first | (not model.is_start), more, np.minimum(more, 0.0))
        found += [
            Cause(name, j, float(own[j]), float(fits.gain[j]), float(fits.deviation[j]))
            for j in range(len(own))]
        found.append(Cause(name, ALL, float(np.maximum(more, -1e3).sum()) + (
            _count_others(more, fits) * PUSH_ODDS[0] if name in (SCALE, CLIPPED) else 0.0)))
    if is_thorough:
        good, doubt, late = _in_motion(model, columns)
        right = Comparison(found, good, doubt).right - push
        found += [cause._replace(evidence=right + cause.evidence) for cause in late
                  if not model.is_start]
    return Comparison(sorted(found, key=lambda cause: -cause.evidence), good, doubt)


def _count_others(more: FloatArray, fits: Fits) -> int:
    """Return at how many joints log evidence (n,) shows another value than at the best one."""
    best = int(np.argmax(more))
    error = 2.0 * (fits.deviation + fits.deviation[best])
    return int(((more > AGAINST) & (np.abs(fits.gain - fits.gain[best]) > error)).sum())


def _in_motion(model: DriveModel, columns: FloatArray) -> tuple[Fits, FloatArray, list[Cause]]:
    """
    Return the fits of free gains, the doubt (n,), and the delays, compared with a push or load.

    All samples in motion count: a contact does not look like a right drive.
    """
    window, u, right = model.window, model.window.commanded, (1.0, MODEL)
    before = model.counts
    model.only(model.moves)
    good, free = model.right(), model.fit(u, GAINS[SCALE])
    doubt = np.maximum(*(model.fit(u, GAINS[name]).evidence for name in (REVERSED, NO_EFFECT)))
    doubt = np.where(model.explains(good), doubt, np.inf)
    pushed = np.maximum(model.fit(u, right, is_pushed=True).evidence, good.evidence)
    known = max(float(pushed.sum()), model.load(columns).evidence)
    fits = [(d, model.fit(delayed(window.time, u, d), right)) for d in DELAYS]
    late = [
        Cause(DELAYED, ALL, float(one.evidence.sum()) - known - DELAY_MARGIN, d, 0.25 * INTERVAL)
        for d, one in fits if model.explains_arm(one) and _iscommon(
            one.evidence - good.evidence)]
    model.only(before)
    return free, doubt - good.evidence, late


def _iscommon(more: FloatArray) -> bool:
    """Return whether log evidence (n,) favours a cause at several joints, opposes it at none."""
    return bool((more > -AGAINST).all() and (more > AGAINST).sum() >= min(3, len(more)))


def delayed(time: FloatArray, command: FloatArray, delay: float) -> FloatArray:
    """Return a command (k, n) at times (k,) [s], a delay [s] earlier."""
    return np.stack([np.interp(time - delay, time, u) for u in command.T], axis=1)
