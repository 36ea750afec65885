# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Likely causes why a recording contradicts the URDF of its arm.

The measured effort is regressed on the bodies, whose masses are those of the URDF with an error of
about a third, the last one with any load, and on rotors and friction. Each hypothesis changes this
regression: a delay, sign or unit of the effort, another vector of gravity, an offset of an
encoder, or a load from some time on. The one with the largest likelihood is accepted if it is
likelier by LEAST_GAIN per independent sample and joint, by the Bayesian information criterion
(G. Schwarz, The Annals of Statistics 6(2), 1978); then the others are tried with it. Friction that
drives the motion and negative rotors are left out, so that they cannot explain a wrong sign.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model import pseudo_inertia
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.regressor import inertial_parameters, TorqueRegressor
from robot_dynamics_tools.analysis.motion_filter import (
    filter_like,
    FilteredMotion,
    samples_per_independent_sample,
)

LEAST_GAIN, LEAST_GAIN_OF_OFFSET = 0.3, 0.03
"""
Smallest gain of log-likelihood per independent sample and joint that names a cause.

In pauses, friction that no term describes gives gains of up to 0.2, and 0.008 for an offset of an
encoder (docs/evidence/contradictions.md).
"""
LEAST_NOISE = 0.005
"""Residual, relative to the effort, below which nothing is explained."""
DELAYS = 0.01 * np.arange(-5, 31)
"""Candidate delays [s] of the effort."""
LEAST_TILT = np.radians(3.0)
LEAST_GRAVITY = 0.5
"""Size of gravity, by that of the URDF, below which the effort lacks it; a tilt keeps it."""
UNITS = (10.0, 100.0, 1000.0)
LEAST_OF_UNIT = 3.0
"""Candidate ratios of the recorded effort to N·m, at most this times that to the URDF's effort."""
LARGEST_OFFSET = np.radians(20.0)
"""Offset of an encoder [rad or m] up to which its effect counts as linear."""
LARGEST_TRAVEL = 20.0
"""Travel [rad] of a joint that may be in degrees."""
_REGULARIZATION = 10.0
_ANY_LOAD = 1e-3
_WIDTHS = (0.01, 0.05, 0.2)
_DISTANCES = (0.003, 0.03)  # rad; without presliding friction, a delay explains its hysteresis
_SPLITS = np.linspace(0.1, 0.9, 9)
_MOST_ROWS = 1500
_STEP = 1e-4
_LOAD = 4  # mass and first moments
_ROTOR, _SLIDING = 0, 2  # own columns of a joint: rotor, offset, then friction
_MOST_CAUSES = 8


@dataclass(frozen=True)
class _Hypothesis:
    """Further columns, delay [s] and unit of the effort, and joints of wrong sign."""

    columns: tuple[int, ...] = ()
    delay: float = 0.0
    flipped: frozenset[int] = frozenset()
    unit: float = 1.0

    @property
    def least_gain(self) -> float:
        return LEAST_GAIN_OF_OFFSET if len(self.columns) == 1 else LEAST_GAIN

    def __or__(self, other: '_Hypothesis') -> '_Hypothesis':
        return _Hypothesis(
            self.columns + other.columns, self.delay + other.delay, self.flipped ^ other.flipped,
            self.unit * other.unit)


def find_contradictions(arm: ArmModel, motion: FilteredMotion) -> tuple[float, tuple[str, ...]]:
    """
    Return the delay [s] of the effort, 0 for none, and the likely causes of a contradiction.

    `motion` has the effort at the joints of `arm`, in its order. Raises RecordingError if it is in
    degrees.
    """
    test = _Test(arm, motion)
    accepted, cost, least_gain = _Hypothesis(), test.fit(_Hypothesis())[0], 0.0
    _check_degrees(arm, motion, cost - test.freedom * LEAST_GAIN)
    for _ in range(_MOST_CAUSES if test.freedom else 0):
        # after a large cause, a small one may be an error of the large one
        trials = [(test.cost(accepted | each), max(least_gain, each.least_gain), accepted | each)
                  for each in test.hypotheses(accepted)]
        least, gain, best = min(trials, key=lambda trial: trial[0] + test.freedom * trial[1])
        if cost - least < test.freedom * gain:
            break
        accepted, cost, least_gain = best, least, gain
    return test.refined_delay(accepted), tuple(test.causes(accepted))


def _check_degrees(arm: ArmModel, motion: FilteredMotion, cost: float) -> None:
    """Raise RecordingError if the fit with positions as degrees has less than this cost."""
    turns = np.array([kind != 'prismatic' for kind in arm.joint_kinds])
    if not (np.ptp(motion.position, axis=0)[turns] > LARGEST_TRAVEL).any():
        return
    unit = np.where(turns, np.radians(1.0), 1.0)
    if _Test(arm, replace(motion, **{name: unit * getattr(motion, name) for name in (
            'position', 'velocity', 'acceleration')})).fit(_Hypothesis())[0] < cost:
        raise RecordingError(
            'positions and velocities in degrees: as degrees, they explain the effort. '
            'Expected radians')


def corrected(arm: ArmModel, motion: FilteredMotion) -> tuple[FilteredMotion, tuple[str, ...]]:
    """Return a motion without the delay of its effort, and all causes that were found."""
    delay, causes = find_contradictions(arm, motion)
    if not delay:
        return motion, causes
    return without_delay(motion, delay), (delay_text(delay), *causes)


def delay_text(delay: float) -> str:
    """Return a sentence about a delay [s]."""
    return f'the effort is {1e3 * abs(delay):.0f} ms {"late" if delay > 0.0 else "early"}'


def without_delay(motion: FilteredMotion, delay: float) -> FilteredMotion:
    """Return a motion with the effort `delay` [s] later; its last samples have none, and end."""
    t = motion.times
    kept, effort = np.zeros(len(t), dtype=np.bool_), np.zeros_like(motion.measured_effort)
    for number in np.unique(motion.segment):
        rows = np.flatnonzero(motion.segment == number)
        at = t[rows] + delay
        kept[rows] = (at >= t[rows[0]]) & (at <= t[rows[-1]])
        for j, column in enumerate(motion.measured_effort.T):
            effort[rows, j] = np.interp(at, t[rows], column[rows])
    arrays = {field.name: getattr(motion, field.name)[kept] for field in fields(motion)
              if isinstance(getattr(motion, field.name), np.ndarray)}
    return replace(motion, **{**arrays, 'effort': effort[kept]})


class _Test:
    """The regression of a motion, reduced to the products of all columns, for any hypothesis."""

    def __init__(self, arm: ArmModel, motion: FilteredMotion) -> None:
        self.arm, n = arm, arm.joint_count
        rows = np.flatnonzero(motion.usable)
        count = len(rows) / samples_per_independent_sample(motion.cutoff_hz, motion.sample_rate_hz)
        rows = rows[::max(1, len(rows) // _MOST_ROWS)]
        body, t, v = RigidBody(arm), motion.times, motion.velocity
        load = np.abs(body.inverse_dynamics_batch(motion.position, v, motion.acceleration))
        sliding = np.stack([
            v, *(np.tanh(v / width) for width in _WIDTHS), load * np.tanh(v / _WIDTHS[1]),
            *(presliding_state(motion.position, v, np.full(n, d)) for d in _DISTANCES)], axis=2)
        sliding = filter_like(motion, sliding.reshape(len(v), -1)).reshape(sliding.shape)
        q, v, a = (each[rows] for each in (motion.position, v, motion.acceleration))
        Y = TorqueRegressor(arm)(q, v, a)
        self.times = np.quantile(t[rows], _SPLITS)
        own = np.concatenate([a[:, :, np.newaxis], np.ones((*a.shape, 1)), sliding[rows]], axis=2)
        gravity = [RigidBody(arm.with_gravity(axis)).gravity_batch(q) for axis in np.eye(3)]
        offsets = [(body.inverse_dynamics_batch(q - step, v, a)
                    - body.inverse_dynamics_batch(q + step, v, a)) / (2.0 * _STEP)
                   for step in _STEP * np.eye(n)]
        loads = [column * (t[rows] > time)[:, np.newaxis] for time in self.times
                 for column in np.moveaxis(Y[:, :, -pseudo_inertia.COUNT:][:, :, :_LOAD], 2, 0)]
        efforts = [np.stack([np.interp(t[rows] + delay, t, column)
                             for column in motion.measured_effort.T], axis=1) for delay in DELAYS]
        Z = np.concatenate([own, Y, np.stack(
            [*gravity, *offsets, *loads, *efforts], axis=2)], axis=2)
        self._products = np.einsum('mja,mjb->jab', Z, Z, optimize=True) / len(rows)
        self._own, self._p = own.shape[2], Y.shape[2]
        self.gravity, self.effort = self._p, Z.shape[2] - self._own - len(DELAYS)
        roots = pseudo_inertia.regularizing_roots(inertial_parameters(arm))
        self._prior = np.concatenate(
            [pseudo_inertia.parameters_of(root @ root.T) for root in roots])
        self._regularization = np.zeros((self._p, self._p))
        for i, root in enumerate(roots):
            W = pseudo_inertia.relative_rows(root)
            part = slice(len(W) * i, len(W) * (i + 1))
            self._regularization[part, part] = W.T @ W * (
                _ANY_LOAD if i == len(roots) - 1 else _REGULARIZATION)
        power = self._products.diagonal(axis1=1, axis2=2)[:, -len(DELAYS):]
        self.measured = np.flatnonzero(power.min(axis=1) > 0.0).tolist()
        described = np.einsum(
            'a,jab,b->j', self._prior, self._products[:, own.shape[2]:, own.shape[2]:][
                :, :self._p, :self._p], self._prior)
        strongest = int(np.argmax(described))
        self._ratio = float(np.sqrt(
            power[strongest].max() / max(float(described[strongest]), 1e-300)))
        self._count = min(count, len(rows))
        self.freedom = self._count * len(self.measured)
        self._reduced: dict[tuple[int, bool, bool], tuple[FloatArray, FloatArray]] = {}

    def hypotheses(self, accepted: _Hypothesis) -> Iterator[_Hypothesis]:
        """Yield the hypotheses to add to an accepted one."""
        first, last = self.gravity + 3, self.gravity + 3 + self.arm.joint_count
        groups = [range(self.gravity, first), *(range(k, k + 1) for k in range(first, last)),
                  *(range(k, k + _LOAD) for k in range(last, self.effort, _LOAD))]
        yield from (_Hypothesis(tuple(columns)) for columns in groups
                    if columns[0] not in accepted.columns)
        if not accepted.delay:
            yield from (_Hypothesis(delay=float(delay)) for delay in DELAYS if delay)
        if accepted.unit == 1.0:
            yield from (
                _Hypothesis(unit=unit) for unit in UNITS if unit < LEAST_OF_UNIT * self._ratio)
        if not accepted.flipped:
            yield _Hypothesis(flipped=frozenset(self.measured))
        yield from (_Hypothesis(flipped=frozenset([j])) for j in self.measured
                    if j not in accepted.flipped)

    def _without_own(self, j: int, rotor: bool, sliding: bool) -> tuple[FloatArray, FloatArray]:
        """Return the products after the best own values of a joint, and these values."""
        key = (j, rotor, sliding)
        if key not in self._reduced:
            G, own = self._products[j], self._own
            used = np.array([rotor, True, *[sliding] * (own - 2)])
            A = G[:own, :own][np.ix_(used, used)]
            values = np.zeros((own, len(G) - own))
            values[used] = np.linalg.solve(
                A + np.diag(1e-9 * np.diag(A) + 1e-30), G[:own, own:][used])
            self._reduced[key] = G[own:, own:] - G[own:, :own] @ values, values
        return self._reduced[key]

    def fit(self, hypothesis: _Hypothesis) -> tuple[float, FloatArray]:
        """Return the negative logarithm of the likelihood, and the values of the columns."""
        p, y = self._p, self.effort + int(np.argmin(np.abs(DELAYS - hypothesis.delay)))
        columns = np.array([*range(p), *hypothesis.columns, y])
        own = self._own
        gains = {j: (-1.0 if j in hypothesis.flipped else 1.0) / hypothesis.unit
                 for j in self.measured}
        powers = {j: gain**2 * self._products[j][own + y, own + y] for j, gain in gains.items()}
        is_used = dict.fromkeys(self.measured, (True, True))
        variance = dict.fromkeys(self.measured, 0.01)  # relative to the power
        x = np.zeros(len(columns))
        for _ in range(12):
            H, change = np.zeros((len(columns), len(columns))), 0.0
            H[:p, :p], H[:p, -1] = self._regularization, self._regularization @ self._prior
            for j in self.measured:
                S = self._without_own(j, *is_used[j])[0][np.ix_(columns, columns)]
                S[-1] *= gains[j]
                S[:, -1] *= gains[j]
                H += self._count / (variance[j] * powers[j]) * S
            scale = 1.0 / np.sqrt(np.maximum(np.diag(H)[:-1], 1e-300))
            x[:-1] = scale * np.linalg.solve(
                scale[:, np.newaxis] * H[:-1, :-1] * scale + 1e-9 * np.eye(len(scale)),
                scale * H[:-1, -1])
            for j in self.measured:
                x[-1] = -gains[j]
                S, values = self._without_own(j, *is_used[j])
                G = self._products[j]
                found = max(float(x @ S[np.ix_(columns, columns)] @ x) / powers[j], LEAST_NOISE**2)
                joint = -values[:, columns] @ x
                sliding = joint[_SLIDING:] @ G[_SLIDING:own, _SLIDING] >= 0.0
                now = (is_used[j][0] and joint[_ROTOR] >= 0.0, is_used[j][1] and bool(sliding))
                change = max(change, abs(np.log(found / variance[j])), float(now != is_used[j]))
                variance[j], is_used[j] = found, now
            if change < 0.02:
                break
        error = x[:p] - self._prior
        return float(
            0.5 * self._count * np.log(list(variance.values())).sum()
            + 0.5 * error @ self._regularization @ error
            + 0.5 * len(hypothesis.columns) * np.log(max(self._count, 1.0))), x[p:-1]

    def cost(self, hypothesis: _Hypothesis) -> float:
        """Return the cost of `fit`, ∞ if an offset of an encoder is implausibly large."""
        cost, values = self.fit(hypothesis)
        first = self.gravity + 3
        is_offset = [first <= k < first + self.arm.joint_count for k in hypothesis.columns]
        return np.inf if (np.abs(values[is_offset]) > LARGEST_OFFSET).any() else cost

    def refined_delay(self, accepted: _Hypothesis) -> float:
        """Return the minimum of the parabola through the costs of three delays."""
        if not accepted.delay:
            return 0.0
        step = float(DELAYS[1] - DELAYS[0])
        low, middle, high = (self.fit(replace(accepted, delay=accepted.delay + change))[0]
                             for change in (-step, 0.0, step))
        curvature = low - 2.0 * middle + high
        return accepted.delay + (0.5 * step * (low - high) / curvature if curvature > 0.0 else 0.0)

    def causes(self, accepted: _Hypothesis) -> Iterator[str]:
        """Yield a sentence per accepted cause."""
        names, first = self.arm.joint_names, self.gravity
        found = dict(zip(accepted.columns, self.fit(accepted)[1].tolist()))
        if accepted.unit != 1.0:
            yield ('the effort is far larger than that of the URDF: effort in mA or in another '
                   'unit than N·m (`identify --effort current`, or `effort.report_scale`)')
        if accepted.flipped:
            listed = 'all joints' if accepted.flipped == set(self.measured) else ', '.join(
                names[j] for j in sorted(accepted.flipped))
            yield f'the effort has the opposite sign at {listed}'
        if first in found:
            g = np.asarray(self.arm.pinocchio_model.gravity.linear)
            yield _of_gravity(g, g + np.array([found[first + axis] for axis in range(3)]))
        for j, name in enumerate(names):
            if first + 3 + j in found:
                value, unit = found[first + 3 + j], 'm'
                if self.arm.joint_kinds[j] != 'prismatic':
                    value, unit = float(np.degrees(value)), '°'
                yield (f'the position of {name} is {value:+.2g} {unit} too large: offset of the '
                       'encoder, masses of the URDF, or a tilted base')
        for k, time in enumerate(self.times.tolist()):
            place = first + 3 + len(names) + _LOAD * k
            if place in found:
                yield (f'the load at the last link changes by {found[place]:+.2g} kg '
                       f'after about {time:.3g} s')


def _of_gravity(g: FloatArray, found: FloatArray) -> str:
    """Return the cause if gravity `found` (3,) fits better than that of the model, g (3,)."""
    size = float(np.linalg.norm(found) / np.linalg.norm(g))
    if size < LEAST_GRAVITY:
        return ('the effort lacks gravity (`measured_effort: joint_torque_without_gravity`), or '
                'the robot compensates it')
    angle = float(np.arccos(np.clip(found @ g / np.linalg.norm(g)**2 / size, -1.0, 1.0)))
    if angle < LEAST_TILT:
        return (f'the effort of gravity is {size:.2g} times that of the URDF: another arm, '
                'a load, or another unit of the effort')
    listed = ', '.join(f'{x:.3g}' for x in found)
    return (f'the base is tilted by {np.degrees(angle):.0f}°: gravity is about ({listed}) m/s² '
            'in its frame (parameter `gravity`)')
