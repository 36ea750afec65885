# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The causes that explain the torque of a motion by the command, compared for the arm as a whole.

Each cause is a linear model of the torque y that the motion needs (`drive_samples`),

    y = k x − F sgn(v) − J a + noise,

with a normal prior of the gain k, and of the dry friction F and the rotor J that the model lacks.
x is the command u, or what the cause makes of it. The evidence of a cause, log ∫ p(y | k, F, J)
p(k, F, J), punishes causes that could have explained anything, such as a push, by itself (D. J. C.
MacKay, *Information Theory, Inference, and Learning Algorithms*, Cambridge 2003, chapter 28).
A cause at one joint explains the arm with all other drives right; a cause at all joints has the
sum of their evidences. A push is a torque at each joint that walks at random; a load is one mass
at one point of the last link.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.monitoring.drive_samples import DriveWindow, FIRST_INTERVAL, SLOW

FRICTION = 0.03, 0.02
"""Dry friction of usual gearboxes as a fraction of the effort limit, and its deviation."""
KNOWN_FRICTION = 0.3
"""Deviation of known friction, as a fraction of it: it changes with temperature and load."""
ROTOR = 1.5e-3, 1e-3
"""
Inertia of rotors that the model lacks by the effort limit [s²], and its deviation.

Most drives reach 170 to 700 rad/s² at their limit, slow ones 17 (`model_check.rotor_check`).
"""
HEAVY_ROTOR = 0.02, 0.02
"""The same of slow drives, which a right drive may have too."""
MODEL = 0.08
"""Deviation of k of a right drive: masses and torque constants of data sheets."""
SPEED_NOISE = 0.003
"""[rad/s] or [m/s], deviation of a velocity."""
DELAY = 0.004
"""[s] by which a command of a right drive may act late."""
LATE = 0.5
"""Deviation of the delay of the first command by DELAY; brakes hold the arm before it acts."""
VIBRATES, LARGEST = 0.4, 1.2
"""
Share of turns of the acceleration from which a joint vibrates, and torque by the effort limit that
no drive delivers: gearboxes that yield look so.
"""
STEADY = 0.5
"""Least distance by way of a joint that does not vibrate."""
PUSH = 0.15
"""Deviation of a push as a fraction of the effort limit."""
LOAD_ODDS = 8.0
"""Log odds of an unknown load, against a wrong drive."""
PUSH_RATE = 0.7
"""Deviation of its change in 1 s [1/√s]: 0.1 of the effort limit within 20 ms."""
LOAD = 0.15
"""Deviation of the torque of a load, as a fraction of the effort limit of some joint."""
LOAD_REACH = 0.15
"""[m], deviation of the centre of mass of a load from the last link."""

GOOD, PUSHED, LOADED = 'agrees', 'a push or a contact', 'a load'
GRAVITY = 'adds gravity'
REVERSED, NO_EFFECT, SCALE, CLIPPED = 'reversed', 'no effect', 'command scale', 'clipped at'
GAINS = {REVERSED: (-1.0, 0.1), NO_EFFECT: (0.0, 0.03), SCALE: (1.5, 1.5)}
"""Mean and deviation of k of the causes that scale the command."""

LEAST_CLIP = 0.05
"""Least clipped torque as a fraction of the effort limit: less is no effect beyond friction."""
CLIP = 0.1, 0.1
"""Mean and deviation of a clipped torque as a fraction of the effort limit."""
AGAINST = 3.0
"""Log evidence against a value, or at a joint against a cause of the whole arm, or for it."""
SCALES = 0.25 * np.arange(1, 25)
"""Scales of the command that are compared if the drive reaches its limit."""
POOR = 2.0
"""Log evidence per sample below which a cause does not explain it: three times the noise."""
ALL = -1
"""Instead of a joint: all joints."""


class Cause(NamedTuple):
    """
    A cause, the joint that has it, or ALL, and its log evidence beyond that of right drives.

    `value` is the gain, the clipped torque [N·m] or [N], or an angle [°], `deviation` its standard
    deviation, `gravity` (3,) that of a tilted base [m/s²].
    """

    name: str
    joint: int
    evidence: float
    value: float = 0.0
    deviation: float = 0.0
    gravity: tuple[float, ...] = ()

    @property
    def is_bound(self) -> bool:
        """Whether the data show only that the value is not less."""
        return not np.isfinite(self.deviation)


class Fits(NamedTuple):
    """Log evidence, mean and deviation of k, and mean of J, of each joint (n,)."""

    evidence: FloatArray
    gain: FloatArray
    deviation: FloatArray
    rotor: FloatArray


class Joints(NamedTuple):
    """
    Effort limit, and the priors (mean, deviation) of what the model lacks, each (n,).

    `tip` is the mass [kg] of the last link with its tool.
    """

    limit: FloatArray
    friction: tuple[FloatArray, FloatArray]
    rotor: tuple[FloatArray, FloatArray]
    tip: float

    @classmethod
    def of_arm(cls, arm: ArmModel, without: float) -> 'Joints':
        """
        Return those of an arm; `without` [N·m] or [N] is the limit of joints without one.

        The friction of an identified arm has the deviation of the live residual.
        """
        limit = np.where(np.isfinite(arm.limits.effort) & (arm.limits.effort > 0.0),
                         arm.limits.effort, without)
        dry, found = arm.friction.at_rest.static, arm.uncertainty
        is_known = arm.reflected_inertia > 0.0
        error = np.zeros_like(limit) if found is None else np.hypot(
            found.friction_deviation, found.noise_deviation)
        usual = np.where(error > 0.0, 0.0, FRICTION[0] * limit)
        spread = np.where(error > 0.0, error, FRICTION[1] * limit)
        return cls(
            limit, (np.maximum(usual, dry), np.maximum(spread, KNOWN_FRICTION * dry)),
            (np.where(is_known, 0.0, ROTOR[0] * limit), ROTOR[1] * limit),
            arm.pinocchio_model.inertias[arm.joint_count].mass)

    @property
    def visible(self) -> FloatArray:
        """The torque (n,) beyond g(q) from which a motion shows its drive: more than friction."""
        return self.friction[0] + 2.0 * self.friction[1]


class DriveModel:
    """The samples of a window, ready for the comparison of causes."""

    def __init__(
        self, window: DriveWindow, joints: Joints, moved_first: BoolArray, at_once: bool,
    ) -> None:
        """
        Take a window of samples.

        Samples in which the motion needs no torque beyond g(q) say nothing, because a contact may
        hold the arm, unless it is a start: some joints (n,) `moved_first`, perhaps `at_once`.
        """
        self.window, self.joints, limit = window, joints, joints.limit
        self.moved_first, self.at_once = moved_first, at_once
        self.is_start = bool(moved_first.any())
        sign = np.where(np.abs(window.velocity) > SLOW, np.sign(window.velocity), 0.0)
        passed = np.diff(window.time)
        duration = np.maximum(np.append(passed[:1], passed) if len(passed) else np.array(
            [FIRST_INTERVAL]), 1e-3)[:, np.newaxis]
        held = self.is_start * DELAY / duration * (window.needed - window.gravity)
        held[1:] = 0.0  # brakes hold the arm until the first command acts
        self._passive = np.stack((-sign, -window.acceleration, -held), axis=-1)
        late = np.abs(np.diff(window.commanded, axis=0, prepend=window.commanded[:1]))
        at_rest = np.where(sign == 0.0, sum(joints.friction), 0.0)
        change = SPEED_NOISE + 1.4 * window.error  # of two velocities, by that of their mean
        self.noise = np.sqrt(
            (window.inertia * change / duration)**2 + (0.005 * limit)**2
            + (0.03 * window.needed)**2 + (DELAY / duration * late)**2 + at_rest**2)
        turns = np.zeros_like(sign, dtype=bool)
        turns[1:] = window.acceleration[1:] * window.acceleration[:-1] < 0.0
        turns |= turns.mean(axis=0) > VIBRATES
        turns[:-1] |= turns[1:]
        turns |= np.abs(window.needed) > LARGEST * limit
        self.moves = (sign != 0.0) & ~turns
        """Marks the samples (k, n) in a motion that is no vibration."""
        way = window.velocity * duration
        steady = np.abs(way.cumsum(axis=0)) > STEADY * np.abs(way).cumsum(axis=0)
        accelerates = np.abs(window.needed - window.gravity) > joints.visible
        counts = self.moves & steady
        if not self.is_start:
            counts &= accelerates
        else:  # friction at rest is one value, whatever the number of samples
            error = np.abs(window.needed[-1] - window.commanded[-1])
            counts[-1] |= ~accelerates[-1] & (error < joints.visible)
        self._noise, self.counts = self.noise, counts
        self.only(counts)

    def only(self, counts: BoolArray) -> None:
        """Let only these samples (k, n) count."""
        self.counts, self.noise = counts, np.where(counts, self._noise, 1e6 * self.joints.limit)

    def _priors(self, gain: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return mean and deviation (n, 4) of k, F, J and the late begin."""
        joints, both = self.joints, np.empty((2, len(self.joints.limit), 4))
        both[..., 0], both[..., 1] = np.transpose([gain]), joints.friction
        both[..., 2], both[..., 3] = joints.rotor, [[0.0], [LATE]]
        return both[0], both[1]

    def fit(
        self, x: FloatArray, gain: tuple[float, float], y: FloatArray | None = None,
        is_pushed: bool = False,
    ) -> Fits:
        """Return the fits of y (k, n), by default the needed torque, by x (k, n) and `gain`."""
        y = self.window.needed if y is None else y
        mean, spread = self._priors(gain)
        A = np.concatenate((x[..., np.newaxis], self._passive), axis=-1)
        r = (y - (A * mean).sum(axis=-1)) / self.noise
        A = A * spread / self.noise[..., np.newaxis]
        log_volume = np.zeros(y.shape[1])
        if is_pushed:
            A, r, log_volume = self._without_pushes(A, r)
        P = np.eye(A.shape[-1]) + np.einsum('kni,knj->nij', A, A)
        h = np.einsum('kni,kn->ni', A, r)
        variance = np.linalg.inv(P)
        d = np.einsum('nij,nj->ni', variance, h)
        evidence = -0.5 * (
            (r * r).sum(axis=0) - (h * d).sum(axis=1) + np.linalg.slogdet(P)[1] + log_volume)
        deviation = spread[:, 0] * np.sqrt(variance[:, 0, 0])
        k, rotor = mean[:, 0] + spread[:, 0] * d[:, 0], mean[:, 2] + spread[:, 2] * d[:, 2]
        return Fits(evidence, k, deviation, rotor)

    def explains(self, fits: Fits) -> BoolArray:
        """Return at which joints (n,) the residuals are those of the noise."""
        return np.asarray(fits.evidence > -POOR * (self.counts.sum(axis=0) + 5.0))

    def explains_arm(self, fits: Fits) -> bool:
        """Return whether the residuals of all joints together are those of the noise."""
        return bool(fits.evidence.sum() > -POOR * (self.counts.sum(axis=0) + 5.0).sum())

    def right(self) -> Fits:
        """Return the fits of right drives, with the rotor that fits better and is not negative."""
        light, joints = self.fit(self.window.commanded, (1.0, MODEL)), self.joints
        self.joints = joints._replace(rotor=(
            HEAVY_ROTOR[0] * joints.limit, HEAVY_ROTOR[1] * joints.limit))
        heavy = self.fit(self.window.commanded, (1.0, MODEL))
        self.joints = joints
        return light._replace(evidence=np.where(
            heavy.rotor > 0.0, np.maximum(heavy.evidence, light.evidence), light.evidence))

    def _without_pushes(
        self, A: FloatArray, r: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A and r whitened by a push that walks at random, and its log volume (n,)."""
        t = self.window.time - self.window.time[0]
        K = PUSH**2 + PUSH_RATE**2 * np.minimum(t, t[:, np.newaxis])
        w = (self.joints.limit / self.noise).T
        C = np.linalg.cholesky(np.eye(len(t)) + K * w[:, :, np.newaxis] * w[:, np.newaxis, :])
        columns = np.concatenate((A, r[..., np.newaxis]), axis=-1).swapaxes(0, 1)
        both = np.asarray(np.linalg.solve(C, columns), dtype=np.float64)
        volume = 2.0 * np.log(np.diagonal(C, axis1=1, axis2=2)).sum(axis=1)
        return both[..., :-1].swapaxes(0, 1), both[..., -1].T, np.asarray(volume)

    def scaled(self) -> Fits:
        """
        Return the fits of a scaled command.

        Scales at which the drive reaches its limit are compared one by one. If the data show only
        that a scale is not less, it has the deviation ∞.
        """
        u, limit, (mean, spread) = self.window.commanded, self.joints.limit, GAINS[SCALE]
        fits = self.fit(u, GAINS[SCALE])
        largest = np.abs(np.where(self.counts, fits.gain * u, 0.0)).max(axis=0)
        if (largest + self.joints.visible < limit).all():
            return fits
        k = np.sign(fits.gain) * SCALES[:, np.newaxis]
        likelihood = np.stack([self.fit(np.clip(x * u, -limit, limit), (1.0, MODEL)).evidence
                               for x in k])
        evidence = likelihood - 0.5 * ((k - mean) / spread)**2
        weight = np.exp(evidence - evidence.max(axis=0))
        volume = weight.sum(axis=0)
        gain = (weight * k).sum(axis=0) / volume
        deviation = np.sqrt((weight * (k - gain)**2).sum(axis=0) / volume)
        is_bound = deviation > 1.5 * MODEL * np.abs(gain)
        possible = likelihood > likelihood.max(axis=0) - AGAINST
        least = k[possible.argmax(axis=0), range(len(gain))]
        return Fits(
            evidence.max(axis=0) + np.log(volume * SCALES[0] / (spread * np.sqrt(2.0 * np.pi))),
            np.where(is_bound, least, gain), np.where(is_bound, np.inf, deviation), fits.rotor)

    def clipped(self) -> Fits:
        """Return the fits of a torque that is clipped; their gain is the clipped torque (n,)."""
        u, limit = self.window.commanded, self.joints.limit
        largest = np.abs(np.where(self.counts, u, 0.0)).max(axis=0)
        noise, self.noise = self.noise, np.where(
            np.abs(u) < 0.5 * largest, 1e6 * limit, self.noise)
        first = self.fit(np.sign(u) * limit, CLIP)
        self.noise = noise
        at = limit * np.maximum(first.gain, LEAST_CLIP)
        fits = self.fit(np.clip(u, -at, at), (1.0, MODEL))
        volume = np.log(CLIP[1] / np.minimum(first.deviation, CLIP[1]))
        return Fits(np.where(at < largest, fits.evidence - volume, -np.inf), at, limit * (
            first.deviation), fits.rotor)

    def load(self, columns: FloatArray) -> Cause:
        """
        Return the cause of a load; `columns` (k, n, 4) are torques per m and m c.

        A negative mass is that of a tool that the model has and the arm has not, which is rarer;
        it is at most that of the last link.
        """
        reach = np.array((1.0, *3 * (LOAD_REACH,)))
        lever = (np.abs(columns) * reach / self.joints.limit[:, np.newaxis]).max(initial=1e-9)
        heaviest = LOAD / lever
        evidence, (mass, *_) = self.common(-columns, heaviest * reach)
        odds = LOAD_ODDS if mass > -0.5 * heaviest else 0.0 if mass > -self.joints.tip else -np.inf
        return Cause(LOADED, ALL, evidence + odds)

    def common(self, columns: FloatArray, spread: FloatArray) -> tuple[float, FloatArray]:
        """
        Return the log evidence and the mean of parameters (m,) that act at all joints.

        `columns` (k, n, m) are torques per parameter, `spread` (m,) are the
        deviations of their priors, whose means are 0.
        """
        k, n, m = columns.shape
        own = (self.window.commanded, *np.moveaxis(self._passive, -1, 0))
        diagonals = [x[..., np.newaxis] * np.eye(n) for x in own]
        A = np.concatenate((*diagonals, columns), axis=-1)
        mean, of_joints = (values.T.ravel() for values in self._priors((1.0, MODEL)))
        mean, spread = np.append(mean, np.zeros(m)), np.append(of_joints, spread)
        A, noise = A.reshape(k * n, -1), self.noise.reshape(-1)
        r = (self.window.needed.reshape(-1) - A @ mean) / noise
        A = A * (spread / noise[:, np.newaxis])
        P, h = np.eye(len(mean)) + A.T @ A, A.T @ r
        d = np.linalg.solve(P, h)
        evidence = -0.5 * (r @ r - h @ d + np.linalg.slogdet(P)[1])
        return float(evidence), (mean + spread * d)[-m:]
