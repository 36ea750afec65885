# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The measured efforts of an arm at rest, compared with g(q): scale, sign, mount of the base.

At a hold, the report e_j of joint j is k_j g_j(q; γ), with the ratio k_j and gravity γ in the base
frame. Each hypothesis states which k_j differ from 1, and whether the base is tilted. They are
compared by the evidence of the holds, with noise of unknown size (a normal distribution whose
variance has an inverse gamma prior), and the penalty of the Bayesian information criterion
(G. Schwarz, The Annals of Statistics 6(2), 1978) for each free value.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.effort_calibration import LARGEST_SCALE, LEAST_SCALE
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody

NOISE, NOISE_WEIGHT = 0.005, 2.0
"""Prior of the noise at rest: a fraction of the effort limit, and how many holds it counts as."""
SURPRISE = 6.0
"""Log odds against a wrong joint and a tilted base: one of 400."""
SIMILAR = 4.0
"""Log evidence within which hypotheses are named together."""
ROUNDS = 5
"""Of the alternation between ratios and gravity."""
OBSERVABLE = 0.1
"""Largest relative deviation of a ratio that is stated."""
MOST_JOINTS = 7
"""Up to so many joints any of them may be wrong, with more joints two of them, or all."""
ABSENT = 0.15
"""Ratio below which a report does not contain gravity."""


class Explanation(NamedTuple):
    """
    A hypothesis with its best values.

    `gravity` (3,) [m/s²] is in the base frame; `ratio` (n,) is that of the report to g(q), and
    `deviation` (n,) its standard deviation, due to `noise` (n,) of the efforts [N·m] or [N];
    `is_wrong` (n,) marks joints whose ratio is not 1;
    `cost` is the negative log evidence, `angle` the tilt and its deviation [rad], 0 without one.
    """

    gravity: FloatArray
    ratio: FloatArray
    deviation: FloatArray
    noise: FloatArray
    is_wrong: BoolArray
    cost: float
    angle: tuple[float, float] = (0.0, 0.0)

    @property
    def is_observable(self) -> BoolArray:
        """Marks the joints that bear enough gravity to show their ratio."""
        return np.asarray(self.deviation < OBSERVABLE * np.maximum(np.abs(self.ratio), ABSENT))

    @property
    def least(self) -> FloatArray:
        """The gravity (n,) [N·m] or [N] at one hold that shows a ratio of 1."""
        return np.asarray(self.noise / OBSERVABLE)

    def words(self, joint_names: Sequence[str]) -> str:
        """Return what the hypothesis says."""
        wrong = [f'{name} {ratio:.2f}' for name, ratio, is_shown in zip(
            joint_names, self.ratio, self.is_wrong & self.is_observable) if is_shown]
        said = [f'effort / g(q) is {", ".join(wrong)}'] if wrong else []
        if self.angle[0]:
            listed = ', '.join(f'{x:.2f}' for x in self.gravity)
            said.append(f'the base is tilted by {np.degrees(self.angle[0]):.0f}° ± '
                        f'{np.degrees(2.0 * self.angle[1]):.1f}°, gravity ({listed})')
        return ' and '.join(said) or 'effort is g(q)'


class _Test:
    """Efforts (N, n) at positions (N, n), and the limits of an arm."""

    def __init__(self, arm: ArmModel, q: FloatArray, effort: FloatArray) -> None:
        self.arm, self.effort = arm, effort
        self.floor = NOISE * np.where(
            np.isfinite(arm.limits.effort), arm.limits.effort, np.abs(effort).max())
        self.columns = np.stack([
            RigidBody(arm.with_gravity(axis)).gravity_batch(q) for axis in np.eye(3)], axis=2)

    def _tilted(self, is_wrong: BoolArray) -> tuple[FloatArray, tuple[float, float]]:
        """
        Return gravity, of the known size, if the joints `is_wrong` (n,) have ratios.

        Also return the angle of the tilt, and its standard deviation [rad].
        """
        g = found = self.arm.gravity
        size = float(np.linalg.norm(g))
        used, ratio, noise = ~is_wrong, np.ones(len(is_wrong)), self.floor
        inverse: FloatArray = np.eye(3)
        for _ in range(ROUNDS):
            A = (ratio / noise)[:, None] * self.columns
            rows, b = A[:, used].reshape(-1, 3), (self.effort / noise)[:, used].ravel()
            weak = 1e-6 * max(float(np.linalg.norm(rows)), 1e-9)
            inverse = np.asarray(np.linalg.inv(rows.T @ rows + weak**2 * np.eye(3)))
            found = g + inverse @ rows.T @ (b - rows @ g)
            found *= size / max(float(np.linalg.norm(found)), 1e-9)
            x = self.columns @ found
            ratio = np.where(is_wrong, self._ratios(x), 1.0)
            noise = self._noise(self.effort - ratio * x)
            used = np.ones(len(is_wrong), dtype=bool)  # a ratio leaves a direction
        away = g - (g @ found) * found / size**2
        away /= max(float(np.linalg.norm(away)), 1e-9)
        return found, (float(np.arccos(np.clip(g @ found / size**2, -1.0, 1.0))),
                       float(np.sqrt(away @ inverse @ away)) / size)

    def _ratios(self, x: FloatArray) -> FloatArray:
        """Return the ratio (n,) of each joint for g(q) of x (N, n)."""
        return np.asarray((x * self.effort).sum(axis=0) / np.maximum((x**2).sum(axis=0), 1e-12))

    def _noise(self, residual: FloatArray) -> FloatArray:
        """Return the deviation (n,) of the efforts."""
        return np.asarray(np.sqrt(
            (NOISE_WEIGHT * self.floor**2 + (residual**2).sum(axis=0))
            / (NOISE_WEIGHT + len(residual) - 1.0)))

    def explained(
        self, wrong: Sequence[int], is_tilted: bool, is_common: bool = False,
    ) -> Explanation:
        """Return the best values if the joints `wrong` have a ratio, a common one or each."""
        N, n = self.effort.shape
        is_wrong = np.isin(np.arange(n), wrong)
        gravity, angle = self._tilted(is_wrong) if is_tilted else (self.arm.gravity, (0.0, 0.0))
        x = self.columns @ gravity
        own, squares = self._ratios(x), np.maximum((x**2).sum(axis=0), 1e-12)
        ratio = np.where(is_wrong, own, 1.0)
        if is_common:
            weight = squares / self.floor**2
            ratio[:] = weight @ own / weight.sum()
        causes = 1 if is_common else len(wrong)
        error = ((self.effort - ratio * x)**2).sum(axis=0)
        evidence = 0.5 * (NOISE_WEIGHT + N) * np.log1p(error / (NOISE_WEIGHT * self.floor**2))
        noise = self._noise(self.effort - own * x)
        return Explanation(
            gravity, own, noise / np.sqrt(squares), noise, is_wrong,
            float(evidence.sum() + SURPRISE * (causes + is_tilted)
                  + 0.5 * (causes + 3 * is_tilted) * np.log(N)), angle)

    def hypotheses(self, may_tilt: bool) -> Iterator[Explanation]:
        """Yield the explanations."""
        n = self.effort.shape[1]
        for size in range(n + 1) if n <= MOST_JOINTS else (0, 1, 2, n):
            for wrong in combinations(range(n), size):
                yield self.explained(wrong, False)
                if may_tilt and size < n:
                    yield self.explained(wrong, True)
        yield self.explained(range(n), False, is_common=True)


def explanations(
    arm: ArmModel, q: FloatArray, effort: FloatArray, may_tilt: bool = True,
) -> list[Explanation]:
    """
    Return what explains efforts (N, n) at rest at positions (N, n), the best first.

    Others have similar evidence, and do not only add causes to the best. Without `may_tilt`,
    gravity is that of `arm`.
    """
    best, *others = sorted(_Test(arm, q, effort).hypotheses(may_tilt), key=lambda one: one.cost)
    return [best, *(one for one in others if one.cost < best.cost + SIMILAR and not (
        (one.is_wrong | ~best.is_wrong).all() and bool(one.angle[0]) >= bool(best.angle[0])))]


def is_scale(ratio: float) -> bool:
    """Return whether a ratio is that of a drive, and not of another unit."""
    return abs(ratio) > ABSENT and LEAST_SCALE <= abs(1.0 / ratio) <= LARGEST_SCALE
