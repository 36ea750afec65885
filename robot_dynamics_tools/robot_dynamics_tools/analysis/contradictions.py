# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Likely causes why a recording contradicts the URDF of its arm.

The measured effort is regressed on the bodies, whose masses are those of the URDF with an error of
about a third, the last one with any load, and on rotors and friction. Each hypothesis changes this
regression: a delay, sign or unit of the effort, two joints in the wrong order, another vector of
gravity, an offset of an encoder, or a load from some time on. The one with the largest likelihood
is accepted if it is likelier by LEAST_GAIN per independent sample and joint that it changes, by
the Bayesian information criterion (G. Schwarz, The Annals of Statistics 6(2), 1978); then the
others are tried with it. Friction that drives the motion and negative rotors are left out, so that
they cannot explain a wrong sign. A residual that no cause reduces, and a gravity torque far from
that of the URDF, suggest another arm.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.regressor import COUNT, inertial_parameters, TorqueRegressor
from robot_dynamics_tools.analysis.gravity_ratio import (
    far_from_urdf,
    gravity_cause,
    gravity_ratios,
)
from robot_dynamics_tools.analysis.motion_filter import (
    filter_like,
    FilteredMotion,
    samples_per_independent_sample,
)
from robot_dynamics_tools.estimation.priors import body_prior

LEAST_GAIN, LEAST_GAIN_AT_REST = 0.3, 0.03
"""
Smallest gain of log-likelihood per independent sample and joint that names a cause.

In pauses, friction that no term describes gives gains of up to 0.2 for a delay or a load, and
0.008 for what acts at rest too, gravity and offsets of encoders (docs/evidence/contradictions.md).
"""
UNEXPLAINED = 0.15
"""Median residual of the joints, relative to the effort, that suggests another arm."""
LEAST_NOISE = 0.005
"""Residual, relative to the effort, below which nothing is explained."""
DELAYS = 0.01 * np.arange(-5, 31)
"""Candidate delays [s] of the effort."""
UNITS = (10.0, 100.0, 1000.0)
LEAST_OF_UNIT = 3.0
"""Candidate ratios of the recorded effort to N·m, at most this times that to the URDF's effort."""
LARGEST_OFFSET = np.radians(20.0)
"""Offset of an encoder [rad or m] up to which its effect counts as linear."""
LARGEST_TRAVEL = 20.0
"""Travel [rad] of a joint that may be in degrees."""
_REGULARIZATION = 10.0
_RELINEARIZATIONS = 2
_ANY_LOAD = 1e-3
_WIDTHS = (0.01, 0.05, 0.2)
_DISTANCES = (0.003, 0.03)  # rad; without presliding friction, a delay explains its hysteresis
_SPLITS = np.linspace(0.1, 0.9, 9)
_MOST_ROWS = 1500
_STEP = 1e-4
_POSES = 150
_LOAD = 4  # mass and first moments
_ROTOR, _SLIDING = 0, 2  # own columns of a joint: rotor, offset, then friction
_MOST_CAUSES = 8
_MOTION = ('position', 'velocity', 'acceleration')


@dataclass(frozen=True)
class _Hypothesis:
    """Further columns, delay [s] and unit of the effort, joints of wrong sign, swapped joints."""

    columns: tuple[int, ...] = ()
    delay: float = 0.0
    flipped: frozenset[int] = frozenset()
    unit: float = 1.0
    swapped: tuple[int, ...] = ()

    @property
    def least_gain(self) -> float:
        return LEAST_GAIN_AT_REST if len(self.columns) in (1, 3) else LEAST_GAIN

    def share(self, joint_count: int) -> float:
        """Return the share of the joints that it changes."""
        return (len(self.flipped | set(self.swapped)) or joint_count) / joint_count

    def __or__(self, other: '_Hypothesis') -> '_Hypothesis':
        return _Hypothesis(
            self.columns + other.columns, self.delay + other.delay, self.flipped ^ other.flipped,
            self.unit * other.unit, self.swapped + other.swapped)


class _Fit(NamedTuple):
    """
    Negative logarithm of the likelihood, and the values of the bodies and of further columns.

    `residual` is that of each measured joint, relative to its effort.
    """

    cost: float
    bodies: FloatArray
    values: FloatArray
    residual: FloatArray


def find_contradictions(
    arm: ArmModel, motion: FilteredMotion, has_load: bool = False,
) -> tuple[float, tuple[str, ...]]:
    """
    Return the delay [s] of the effort, 0 for none, and the likely causes of a contradiction.

    `motion` has the effort at the joints of `arm`, in its order. With `has_load`, the last link
    may carry any load. Raises RecordingError if the motion is in degrees.
    """
    test, given = _Test(arm, motion), arm.gravity
    accepted, cost, least_gain = _Hypothesis(), test.fit(_Hypothesis()).cost, 0.0
    _check_degrees(arm, motion, cost - test.freedom * LEAST_GAIN)
    for _ in range(_MOST_CAUSES if test.freedom else 0):
        # after a large cause, a small one may be an error of the large one
        trials = [(test.cost(accepted | each), max(least_gain, each.least_gain), each)
                  for each in test.hypotheses(accepted)]
        needed = [test.freedom * gain * each.share(len(test.measured)) for _, gain, each in trials]
        best = int(np.argmin([least + more for (least, *_), more in zip(trials, needed)]))
        least, gain, each = trials[best]
        if cost - least < needed[best]:
            break
        accepted, cost, least_gain = accepted | each, least, gain
    if test.freedom and test.is_slow and np.median(test.fit(accepted).residual) > UNEXPLAINED:
        return 0.0, (_swapped_joints(arm, motion, cost - test.freedom * LEAST_GAIN),)
    for _ in range(_RELINEARIZATIONS if test.gravity[0] in accepted.columns else 0):
        # the error of a mass has to act along the gravity that was found
        found = test.arm.gravity + test.gravity_change(accepted)
        test = _Test(arm.with_gravity(found), motion)
    far = _far_gravity(test, accepted, has_load)
    if far:  # bodies of another arm, whose inertia and gravity differ by other factors
        accepted = replace(accepted, columns=tuple(
            column for column in accepted.columns if column not in test.gravity))
    return test.refined_delay(accepted), (*test.causes(accepted, given), *far)


def _swapped_joints(arm: ArmModel, motion: FilteredMotion, cost: float) -> str:
    """Return the two joints in the wrong order, if the fit then has less than this cost."""
    names, best = arm.joint_names, ''
    for i, j in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[i, j]] = j, i
        found = _cost_of_changed(
            arm, motion, ('effort', *_MOTION), partial(np.take, indices=order, axis=1))
        if found < cost:
            cost, best = found, f'{names[i]} and {names[j]} are swapped in the recording'
    return best or ('the URDF does not explain the effort: another arm, another URDF, or joints '
                    'in another order')


def _cost_of_changed(
    arm: ArmModel, motion: FilteredMotion, names: tuple[str, ...],
    change: Callable[[FloatArray], Any],
) -> float:
    """Return the cost of the fit to a motion with a change of the arrays with these names."""
    return _Test(arm, replace(motion, **{
        name: change(getattr(motion, name)) for name in names})).fit(_Hypothesis()).cost


def _far_gravity(test: '_Test', accepted: _Hypothesis, has_load: bool) -> tuple[str, ...]:
    """Return a sentence if the gravity torque is far from that of the URDF."""
    if accepted.unit != 1.0 or not (test.freedom and test.is_slow):
        return ()
    phi = test.fit(accepted).bodies
    if has_load:
        phi = np.concatenate([phi[:-COUNT], test.prior[-COUNT:]])
    return far_from_urdf(test.arm.joint_names, gravity_ratios(test.arm, phi, test.positions))


def _check_degrees(arm: ArmModel, motion: FilteredMotion, cost: float) -> None:
    """Raise RecordingError if the fit with positions as degrees has less than this cost."""
    turns = np.array([kind != 'prismatic' for kind in arm.joint_kinds])
    if not (np.ptp(motion.position, axis=0)[turns] > LARGEST_TRAVEL).any():
        return
    unit = np.where(turns, np.radians(1.0), 1.0)
    if _cost_of_changed(arm, motion, _MOTION, lambda x: unit * x) < cost:
        raise RecordingError(
            'positions and velocities in degrees: as degrees, they explain the effort. '
            'Expected radians')


def corrected(
    arm: ArmModel, motion: FilteredMotion, has_load: bool = False,
) -> tuple[FilteredMotion, tuple[str, ...]]:
    """Return a motion without the delay of its effort, and all causes that were found."""
    delay, causes = find_contradictions(arm, motion, has_load)
    if not delay:
        return motion, causes
    return motion.without_delay(delay), (
        f'the effort is {1e3 * abs(delay):.0f} ms {"late" if delay > 0.0 else "early"}', *causes)


class _Test:
    """The regression of a motion, reduced to the products of all columns, for any hypothesis."""

    def __init__(self, arm: ArmModel, motion: FilteredMotion) -> None:
        self.arm, n = arm, arm.joint_count
        rows = np.flatnonzero(motion.usable)
        count = len(rows) / samples_per_independent_sample(motion.cutoff_hz, motion.sample_rate_hz)
        rows = rows[::max(1, len(rows) // _MOST_ROWS)]
        body, t, v = RigidBody(arm), motion.times, motion.velocity
        effort = body.inverse_dynamics_batch(motion.position, v, motion.acceleration)
        load, removed = np.abs(effort), effort - filter_like(motion, effort)
        # of a motion that is too fast for the filter, the effort cannot be judged
        self.is_slow = np.median(np.std(removed, axis=0)) < UNEXPLAINED * np.median(
            np.std(effort, axis=0))
        sliding = np.stack([
            v, *(np.tanh(v / width) for width in _WIDTHS), load * np.tanh(v / _WIDTHS[1]),
            *(presliding_state(motion.position, v, np.full(n, d)) for d in _DISTANCES)], axis=2)
        sliding = filter_like(motion, sliding.reshape(len(v), -1)).reshape(sliding.shape)
        q, v, a = motion.state(rows)
        Y = TorqueRegressor(arm)(q, v, a)
        self.times = np.quantile(t[rows], _SPLITS)
        own = np.concatenate([a[:, :, np.newaxis], np.ones((*a.shape, 1)), sliding[rows]], axis=2)
        gravity = [RigidBody(arm.with_gravity(axis)).gravity_batch(q) for axis in np.eye(3)]
        offsets = [(body.inverse_dynamics_batch(q - step, v, a)
                    - body.inverse_dynamics_batch(q + step, v, a)) / (2.0 * _STEP)
                   for step in _STEP * np.eye(n)]
        loads = [column * (t[rows] > time)[:, np.newaxis] for time in self.times
                 for column in np.moveaxis(Y[:, :, -COUNT:][:, :, :_LOAD], 2, 0)]
        efforts = [np.stack([np.interp(t[rows] + delay, t, column)
                             for column in motion.measured_effort.T], axis=1) for delay in DELAYS]
        others = [np.tile(column[:, np.newaxis], n) for column in motion.measured_effort[rows].T]
        Z = np.concatenate([own, Y, np.stack(
            [*gravity, *offsets, *loads, *efforts, *others], axis=2)], axis=2)
        self.positions = q[::max(1, len(q) // _POSES)]
        self._products = np.einsum('mja,mjb->jab', Z, Z, optimize=True) / len(rows)
        self._own, self._p = own.shape[2], Y.shape[2]
        last = self._p + 3 + n
        self.gravity, self.encoders = range(self._p, self._p + 3), range(self._p + 3, last)
        self.loads = [range(last + k, last + k + _LOAD) for k in range(0, len(loads), _LOAD)]
        self._effort = last + len(loads)
        self._others = self._effort + len(DELAYS)
        prior = body_prior(inertial_parameters(arm))
        weights = np.full(self._p, _REGULARIZATION)
        weights[-COUNT:] = _ANY_LOAD
        self.prior = prior.parameters
        self._regularization = prior.rows.T * weights @ prior.rows
        sizes = np.sqrt(np.mean(np.stack([motion.measured_effort, effort])[:, rows]**2, axis=1))
        self.measured = np.flatnonzero(sizes[0]).tolist()
        strongest = int(np.argmax(sizes[1]))
        self._ratio = float(sizes[0, strongest] / max(sizes[1, strongest], 1e-150))
        self._count = min(count, len(rows))
        self.freedom = self._count * len(self.measured)
        self._reduced: dict[tuple[int, bool, bool], tuple[FloatArray, FloatArray]] = {}

    def hypotheses(self, accepted: _Hypothesis) -> Iterator[_Hypothesis]:
        """Yield the hypotheses to add to an accepted one."""
        groups = [self.gravity, *([k] for k in self.encoders), *self.loads]
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
        if not accepted.delay:
            yield from (_Hypothesis(swapped=pair) for pair in combinations(self.measured, 2)
                        if not set(pair) & set(accepted.swapped))

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

    def _efforts(self, hypothesis: _Hypothesis) -> tuple[IntArray, FloatArray]:
        """Return the column of the effort of each measured joint, and its gain."""
        column = self._effort + int(np.argmin(np.abs(DELAYS - hypothesis.delay)))
        pairs = list(zip(hypothesis.swapped[::2], hypothesis.swapped[1::2]))
        partners = {**dict(pairs), **{j: i for i, j in pairs}}
        return (
            np.array([self._others + partners[j] if j in partners else column
                      for j in self.measured]),
            np.array([(-1.0 if j in hypothesis.flipped else 1.0) / hypothesis.unit
                      for j in self.measured]))

    def fit(self, hypothesis: _Hypothesis) -> _Fit:
        """Return the fit of a hypothesis."""
        p, own, (effort, gains) = self._p, self._own, self._efforts(hypothesis)
        powers = gains**2 * self._products[self.measured, own + effort, own + effort]
        joints = list(zip(self.measured, (
            np.array([*range(p), *hypothesis.columns, column]) for column in effort)))
        # (rotor, sliding) and the variance of each joint, relative to the power
        used, variance = [(True, True)] * len(joints), np.full(len(joints), 0.01)
        x, W = np.zeros(p + len(hypothesis.columns) + 1), self._regularization
        for _ in range(12):
            H = np.zeros((len(x), len(x)))
            H[:p, :p], H[:p, -1] = W, W @ self.prior
            for i, (j, columns) in enumerate(joints):
                S = self._without_own(j, *used[i])[0][np.ix_(columns, columns)]
                S[-1] *= gains[i]
                S[:, -1] *= gains[i]
                H += self._count / (variance[i] * powers[i]) * S
            scale = 1.0 / np.sqrt(np.maximum(np.diag(H)[:-1], 1e-300))
            x[:-1] = scale * np.linalg.solve(
                scale[:, np.newaxis] * H[:-1, :-1] * scale + 1e-9 * np.eye(len(scale)),
                scale * H[:-1, -1])
            before, were_used = variance.copy(), list(used)
            for i, (j, columns) in enumerate(joints):
                x[-1] = -gains[i]
                S, values = self._without_own(j, *used[i])
                squares = float(x @ S[np.ix_(columns, columns)] @ x)
                variance[i] = max(squares / powers[i], LEAST_NOISE**2)
                joint = -values[:, columns] @ x
                drives = joint[_SLIDING:] @ self._products[j, _SLIDING:own, _SLIDING] < 0.0
                used[i] = (used[i][0] and bool(joint[_ROTOR] >= 0.0), used[i][1] and not drives)
            if used == were_used and (np.abs(np.log(variance / before)) < 0.02).all():
                break
        error = x[:p] - self.prior
        return _Fit(float(
            0.5 * self._count * np.log(variance).sum() + 0.5 * error @ W @ error
            + 0.5 * len(hypothesis.columns) * np.log(max(self._count, 1.0))),
            x[:p], x[p:-1], np.sqrt(variance))

    def cost(self, hypothesis: _Hypothesis) -> float:
        """Return the cost of `fit`, ∞ if an offset of an encoder is implausibly large."""
        cost, _, values, _ = self.fit(hypothesis)
        is_offset = [k in self.encoders for k in hypothesis.columns]
        return np.inf if (np.abs(values[is_offset]) > LARGEST_OFFSET).any() else cost

    def refined_delay(self, accepted: _Hypothesis) -> float:
        """Return the minimum of the parabola through the costs of three delays."""
        if not accepted.delay:
            return 0.0
        step = float(DELAYS[1] - DELAYS[0])
        low, middle, high = (self.fit(replace(accepted, delay=accepted.delay + change)).cost
                             for change in (-step, 0.0, step))
        curvature = low - 2.0 * middle + high
        return accepted.delay + (0.5 * step * (low - high) / curvature if curvature > 0.0 else 0.0)

    def gravity_change(self, accepted: _Hypothesis) -> FloatArray:
        """Return what an accepted vector of gravity has more than that of `arm` (3,)."""
        found = dict(zip(accepted.columns, self.fit(accepted).values.tolist()))
        return np.array([found[k] for k in self.gravity])

    def causes(self, accepted: _Hypothesis, given: FloatArray) -> Iterator[str]:
        """Yield a sentence per accepted cause; `given` is the gravity of the URDF (3,)."""
        names = self.arm.joint_names
        found = dict(zip(accepted.columns, self.fit(accepted).values.tolist()))
        if accepted.unit != 1.0:
            yield ('the effort is far larger than that of the URDF: effort in mA or in another '
                   'unit than N·m (`identify --effort current`, or `effort.report_scale`)')
        if accepted.flipped:
            listed = 'all joints' if accepted.flipped == set(self.measured) else ', '.join(
                names[j] for j in sorted(accepted.flipped))
            yield f'the effort has the opposite sign at {listed}'
        for i, j in zip(accepted.swapped[::2], accepted.swapped[1::2]):
            yield f'the efforts of {names[i]} and {names[j]} are swapped'
        if self.gravity[0] in found:
            yield gravity_cause(given, self.arm.gravity + self.gravity_change(accepted))
        for k, name, kind in zip(self.encoders, names, self.arm.joint_kinds):
            if k in found:
                value, unit = (found[k], 'm') if kind == 'prismatic' else (
                    float(np.degrees(found[k])), '°')
                yield (f'the position of {name} is {value:+.2g} {unit} too large: offset of the '
                       'encoder, masses of the URDF, or a tilted base')
        for (mass, *_), time in zip(self.loads, self.times.tolist()):
            if mass in found:
                yield (f'the load at the last link changes by {found[mass]:+.2g} kg '
                       f'after about {time:.3g} s')
