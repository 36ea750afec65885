# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
How often the estimators of the tools are right, on generated arms with known parameters.

Options: `--seeds FIRST COUNT`, then names of rows (all by default). Each seed is another arm of 3
to 6 joints, whose friction has a Stribeck curve and presliding. One line per row.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
import sys

from benchmarks.chains import chain_urdf, spatial_chain
import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import inertial_parameters, random_states
from robot_dynamics_tools.analysis.contradictions import find_contradictions
from robot_dynamics_tools.analysis.motion_filter import filter_motion, filter_motion_below
from robot_dynamics_tools.identification.identified_arm import fitted_urdf, parameter_values
from robot_dynamics_tools.identification.pipeline import identify
from robot_dynamics_tools.identification.written_uncertainty import uncertainty_values
from robot_dynamics_tools.payload_estimation import PayloadEstimator
from robot_dynamics_tools.payload_estimation.recordings import add_motion
from robot_dynamics_tools.pseudo_inertia import from_coordinates, pseudo_inertia_matrix
from robot_dynamics_tools.recordings.joint_series import JointSeries

NOISE = 0.004
"""White noise of the efforts, relative to the effort limits."""


class Case:
    """An arm, its URDF, the true masses, friction and rotors, and recordings of it."""

    def __init__(self, seed: int, wrong: float = 0.15) -> None:
        self.rng = np.random.default_rng([7, seed])
        self.n = int(self.rng.integers(3, 7))
        self.urdf = chain_urdf(spatial_chain(self.n, seed + 500))
        q = random_states(load_arm(self.urdf), 100)[0]
        gravity = np.abs(RigidBody(load_arm(self.urdf)).gravity_batch(q)).max(axis=0)
        self.limit = 2.5 * np.maximum(gravity, 0.1 * gravity.max())
        for limit in self.limit:
            self.urdf = self.urdf.replace('effort="1000" velocity="100"',
                                          f'effort="{limit}" velocity="4"', 1)
        self.arm = load_arm(self.urdf)
        self.true = self._changed(wrong)
        self.rotor = 0.003 * self.limit
        self.F, self.viscous = self.rng.uniform(0.01, 0.04, (2, self.n)) * self.limit

    def _changed(self, size: float) -> ArmModel:
        model = self.arm.unloaded_model.copy()
        for i, phi in enumerate(inertial_parameters(self.arm).reshape(-1, 10)):
            L = np.asarray(np.linalg.cholesky(pseudo_inertia_matrix(phi)))
            model.inertias[i + 1] = pin.Inertia.FromDynamicParameters(
                from_coordinates(L, size * self.rng.normal(size=10)))
        return replace(self.arm, pinocchio_model=model, unloaded_model=model)

    def sines(self, rate: float = 100.0, seconds: float = 30.0) -> FloatArray:
        """Return positions (m, n) of a sum of sines."""
        t = np.arange(0.0, seconds, 1.0 / rate)[:, None, None]
        w = 0.2 * np.pi * np.arange(1, 6)[:, None]
        size, phase = self.rng.normal(0.0, 0.4, (5, self.n)), self.rng.uniform(0, 7, (5, self.n))
        return np.asarray((size * np.sin(w * t + phase)).sum(axis=1))

    def moves(self, rate: float = 100.0, seconds: float = 30.0, sides: bool = False) -> FloatArray:
        """Return moves with pauses; with `sides`, 10 poses, approached from both directions."""
        pieces, at = list[FloatArray](), np.zeros(self.n)
        while sum(map(len, pieces)) < seconds * rate:
            pose = self.rng.uniform(-1.2, 1.2, self.n)
            for goal in [pose - 0.2, pose, pose + 0.2, pose] if sides else [pose]:
                s = np.linspace(0.0, 1.0, int((1.0 if sides else 2.0) * rate))[:, None]
                pieces.append(at + (goal - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
                pieces.append(np.tile(goal, (int((1.5 if goal is pose else 0.1) * rate), 1)))
                at = goal
        return np.concatenate(pieces)

    def series(
        self, q: FloatArray, rate: float = 100.0, arm: ArmModel | None = None,
        change: Callable[[FloatArray], FloatArray] = lambda effort: effort, quantum: float = 0.0,
        velocity_noise: float = 1e-3,
    ) -> JointSeries:
        """Return the recording; with a `quantum` [rad] of position, without velocity."""
        v = np.gradient(q, 1.0 / rate, axis=0)
        a = np.gradient(v, 1.0 / rate, axis=0)
        z = presliding_state(q, v, np.full(self.n, 0.003))
        effort = RigidBody(arm or self.true).inverse_dynamics_batch(q, v, a) + self.rotor * a + (
            self.F * (1.0 + 0.4 * np.exp(-(v / 0.05)**2)) * z + self.viscous * v)
        effort = change(effort + NOISE * self.limit * self.rng.normal(size=q.shape))
        stamps = np.round(1e9 * np.arange(len(q)) / rate).astype(np.int64)
        noise = self.rng.normal(size=(2, *q.shape))
        position = np.round(q / quantum) * quantum if quantum else q + 2e-5 * noise[0]
        return JointSeries(self.arm.joint_names, stamps, position, None if quantum else
                           v + velocity_noise * noise[1], effort, 0)


Figures = dict[str, list[float]]


def payload(seed: int) -> Figures:
    """Estimate a load on drives with wrong scales and offsets; the masses of the URDF are true."""
    case = Case(seed, wrong=0.0)
    load = make_payload(case.arm.link_names[-1], case.rng.uniform(0.3, 3.0), (0.05, -0.03, 0.08))
    scale = case.rng.uniform(0.7, 1.3, case.n)
    offset = case.rng.uniform(-0.03, 0.03, case.n) * case.limit
    motion = filter_motion_below(case.series(
        case.moves(25.0, 50.0, sides=True), 25.0, case.true.with_payloads([load]),
        lambda effort: effort / scale + offset), 5.0)
    estimator = PayloadEstimator(case.arm, load.link, 5.0)
    add_motion(estimator, motion)
    found = estimator.estimate(with_advice=False)
    error = found.mass - load.mass
    return {'error [%]': [100.0 * abs(error) / load.mass],
            '± 95 % [%]': [196.0 * found.deviations[0] / load.mass],
            'inside': [abs(error) < 1.96 * found.deviations[0]],
            'with a number': [found.verdicts[0] == 'observable']}


def interval(seed: int) -> Figures:
    """Share of samples of another motion within τ ± 2 σ, by third of speed, filtered and raw."""
    case, shares = Case(seed), {}
    path = case.moves if seed % 2 else case.sines
    found = identify(case.arm, [filter_motion(case.series(path()))])
    arm = arm_from_parameters(fitted_urdf(case.urdf, case.arm, found.models.consistent), {
        **parameter_values(case.arm, found.models.consistent), **uncertainty_values(found)})
    series = case.series(path())
    motion = filter_motion(series)
    dynamics, uncertainty = ArmDynamics(arm), arm.uncertainty
    assert uncertainty is not None
    assert series.effort is not None
    deviation = EffortDeviation(dynamics, uncertainty)
    model = dynamics.inverse_dynamics_batch(motion.position, motion.velocity, motion.acceleration)
    sigma = np.array([deviation(*each) for each in zip(
        motion.position, motion.velocity, motion.acceleration)])
    speed = np.abs(motion.velocity)
    for name, effort, band in (
            ('filtered', motion.measured_effort, uncertainty.noise_bandwidth),
            ('raw', series.effort, np.inf)):
        noise = uncertainty.noise(band, 0.01)
        inside = np.abs(effort - model) <= 2.0 * np.hypot(sigma, noise)
        for third, (low, high) in enumerate(((0, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 1))):
            part = (np.quantile(speed, low, axis=0) <= speed) & (
                speed <= np.quantile(speed, high, axis=0)) & motion.usable[:, None]
            shares[f'{name} {third + 1}'] = [(inside & part).sum() / part.sum()]
    return shares


def units(seed: int, negative: int = 0) -> Figures:
    """Identify from efforts in A with `auto`: currents, asked for, or a wrong fit."""
    case = Case(seed)
    gain = case.rng.uniform(2.0, 30.0) * case.rng.uniform(0.6, 1.6, case.n)
    gain[case.rng.permutation(case.n)[:negative]] *= -1.0
    motion = filter_motion(case.series(case.sines(), change=lambda effort: effort / gain))
    try:
        found = identify(case.arm, [motion], effort_is_current=True if negative else None)
    except RobotDynamicsError as error:
        return {'asked for, or an error that names the joints': ['current' in str(error)]}
    if found.gains is None:
        return {'fitted as a torque': [1.0]}
    ratio = found.gains.scale / gain
    return {'median of |gain / true|': [np.median(np.abs(ratio))],
            'gains within 25 %': (np.abs(ratio - 1.0) < 0.25).tolist()}


def negative(seed: int) -> Figures:
    """Identify from currents with two reversed drives."""
    return units(seed, 2)


def swapped(series: JointSeries, order: IntArray) -> JointSeries:
    """Return the recording with its joints in another order, under the same names."""
    return replace(series, **{
        name: getattr(series, name)[:, order] for name in ('position', 'velocity', 'effort')})


def contradictions(seed: int) -> Figures:
    """Name the likely cause of a contradiction between a recording and the URDF."""
    case = Case(seed)
    q = (case.moves if seed % 2 else case.sines)()
    j, k = case.rng.permutation(case.n)[:2]
    sign, swap = np.ones(case.n), np.arange(case.n)
    sign[j], swap[[j, k]] = -1.0, [k, j]
    rest = RigidBody(case.true).gravity_batch(q)
    late = np.concatenate([np.repeat(q[:1], 10, axis=0), q[:-10]])
    other = load_arm(chain_urdf(spatial_chain(case.n, seed + 900)))
    recorded = {
        'none': (case.series(q), ''),
        'late': (replace(case.series(late), position=q, velocity=np.gradient(q, 0.01, axis=0)),
                 'late'),
        'sign': (case.series(q, change=lambda e: sign * e), 'opposite sign at joint'),
        'all signs': (case.series(q, change=lambda e: -e), 'opposite sign at all'),
        'no gravity': (case.series(q, change=lambda e: e - rest), 'lacks gravity'),
        'gravity twice': (case.series(q, change=lambda e: e + rest), 'twice'),
        'tilt': (case.series(q, arm=case.true.with_gravity((-3.35, 0.0, -9.22))), 'tilt'),
        'other URDF': (case.series(q, arm=other), 'another arm'),
        'swapped efforts': (case.series(q, change=lambda e: e[:, swap]), 'swapped'),
        'swapped joints': (swapped(case.series(q), swap), 'swapped'),
        'mA': (case.series(q, change=lambda e: 60.0 * e), 'mA')}
    counts: Figures = {}
    for name, (series, word) in recorded.items():
        delay, causes = find_contradictions(case.arm, filter_motion(series))
        texts = [*causes, *(['late'] if delay > 0.02 else [])]
        counts[f'{name}: right'] = [not texts if not word else any(word in x for x in texts)]
        counts[f'{name}: wrong'] = [bool(texts) and not counts[f'{name}: right'][0]]
    return counts


def coverage(seed: int, rate: float = 100.0, quantum: float = 2.0 * np.pi / 4096.0) -> Figures:
    """Share of base parameters within ± 1.96 deviations, quantised position without velocity."""
    case = Case(seed)
    motion = filter_motion(case.series(
        case.sines(rate), rate, quantum=quantum, velocity_noise=0.02))
    found = identify(case.arm, [motion])
    truth = found.base.matrix @ np.concatenate([
        inertial_parameters(case.true), case.rotor])
    count = found.estimate.base_count
    error = (found.estimate.values[:count] - truth) / found.estimate.deviations[:count]
    return {'inside': (np.abs(error) < 1.96)[found.estimate.excited[:count]].tolist(),
            'cut-off [Hz]': [motion.cutoff_hz]}


def noisy(seed: int) -> Figures:
    """Share of base parameters at 1 kHz with noise of the velocity."""
    return coverage(seed, 1000.0, 0.0)


def short(seed: int) -> Figures:
    """Choose the cut-off frequency for 2 s at 1 kHz with little noise."""
    case = Case(seed)
    series = case.series(case.moves(1000.0, 2.0)[:2000], 1000.0, velocity_noise=1e-5)
    return {'cut-off [Hz]': [filter_motion(series).cutoff_hz]}


ROWS: dict[str, Callable[[int], Figures]] = {
    row.__name__: row for row in (
        payload, interval, units, negative, contradictions, coverage, noisy, short)}


def main(words: Sequence[str]) -> None:
    """Print mean, median and largest value of each figure."""
    first, count, names = 0, 5, words
    if words[:1] == ['--seeds']:
        first, count, names = int(words[1]), int(words[2]), words[3:]
    for name in names or ROWS:
        figures: Figures = {}
        for seed in range(first, first + count):
            for figure, values in ROWS[name](seed).items():
                figures.setdefault(figure, []).extend(map(float, values))
        for figure, values in figures.items():
            print(f'{name}: {figure}: mean {np.mean(values):.3g}, median {np.median(values):.3g}, '
                  f'max {max(values):.3g}, {len(values)} values', flush=True)


if __name__ == '__main__':
    main(sys.argv[1:])
