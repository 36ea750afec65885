# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Efforts of arms with hidden loads, friction and noise, for the tests of payload estimation."""

from typing import NamedTuple

from arm_motions import fourier_motion
import numpy as np
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model import ArmModel, make_payload, Payload, RigidBody
from robot_dynamics.model.regressor import LoadRegressor
from robot_dynamics_tools.payload_estimation import PayloadEstimate, PayloadEstimator
from robots import arm_without_gripper, effort_limit

LINKS = {'ur10': 'tool0', 'panda': 'panda_hand', 'xarm7': 'link7', 'default': 'tool0'}
"""The link that carries the load, by the name of the robot."""
RATE, CUTOFF = 25.0, 5.0
"""Rate and cut-off frequency of the filtered samples [Hz]."""
NOISE, FRICTION = 0.004, 0.01
"""Deviation of the filtered effort noise, and dry friction, relative to the effort limits."""
SAG, SAG_TIME = 2e-3, 0.25
"""Displacement [rad] of a joint that yields to the load, and its time constant [s]."""
SECONDS = 1.2
"""Duration of a hold and of a motion to it."""


class Case(NamedTuple):
    """The model without the load, its link, and the load."""

    arm: ArmModel
    link: str
    load: Payload
    seed: int


class Samples(NamedTuple):
    """Times (m,), all others (m, n); `rest` is the friction at rest, NaN in motion."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    rest: np.ndarray


def hidden_load(name: str, seed: int, friction: float = FRICTION) -> Case:
    """Return an arm with friction and a random load of up to 5 kg on its last link."""
    arm = arm_without_gripper(name)
    rng = np.random.default_rng(seed)
    limit = effort_limit(arm)
    arm = arm.with_friction(make_friction(
        arm.joint_names, viscous=0.5 * friction * limit, coulomb=friction * limit))
    mass = rng.uniform(0.0, 5.0)
    half = rng.uniform(0.03, 0.1, 3)  # of a box
    inertia = mass / 3.0 * np.diag(half @ half - half**2)
    com = rng.uniform(-0.1, 0.1, 3)
    if name == 'default':  # whose motion is in a plane
        com[1] = 0.0
    return Case(arm, LINKS[name], make_payload(LINKS[name], mass, com, inertia), seed)


def holds(case: Case, count: int, both_sides: bool) -> Samples:
    """Return holds in random poses within the limits, approached from one or both directions."""
    rng = np.random.default_rng(case.seed + 10_000)
    n, band = case.arm.joint_count, case.arm.friction.static
    low, high = np.clip([case.arm.limits.lower, case.arm.limits.upper], -2.5, 2.5)
    at, q, rest = np.zeros(n), [], []
    for pose in low + (high - low) * rng.uniform(0.2, 0.8, (count, n)):
        sides = (-1.0, 1.0) if both_sides else (rng.choice([-1.0, 1.0]),)
        for side in sides:
            for goal in (pose + 0.3 * side, pose):
                s = np.linspace(0.0, 1.0, int(SECONDS * RATE))[:, None]
                q.append(at + (goal - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
                rest.append(np.full((len(s), n), np.nan))
                at = goal
            size = rng.uniform(0.8, 1.0, n) * -side if both_sides else rng.uniform(-1.0, 1.0, n)
            q.append(np.tile(pose, (int(SECONDS * RATE), 1)))
            rest.append(np.tile(band * size, (int(SECONDS * RATE), 1)))
    position, friction = np.concatenate(q), np.concatenate(rest)
    moves = np.isnan(friction)
    v = moves * np.gradient(position, 1.0 / RATE, axis=0)
    a = moves * np.gradient(v, 1.0 / RATE, axis=0)
    return Samples(np.arange(len(position)) / RATE, position, v, a, friction)


def held_by(case: Case, samples: Samples) -> np.ndarray:
    """Return the effort (m, n) that the load needs at rest."""
    zero = np.zeros_like(samples.q)
    return np.asarray(
        LoadRegressor(case.arm, case.link)(samples.q, zero, zero)
        @ case.load.body.toDynamicParameters())


def sagging(case: Case, samples: Samples) -> Samples:
    """Return holds in which every joint yields slowly to the load, against dry friction."""
    still, load = ~np.isnan(samples.rest[:, 0]), held_by(case, samples)
    q, v, rest = samples.q.copy(), samples.v.copy(), samples.rest.copy()
    begins = np.flatnonzero(still & ~np.r_[False, still[:-1]])
    for begin in begins.tolist():
        count = int(np.argmin(np.r_[still[begin:], False]))
        part, t = slice(begin, begin + count), np.arange(count) / RATE
        direction = -np.sign(load[begin])
        decay = np.exp(-t / SAG_TIME)[:, None]
        q[part] += SAG * direction * (1.0 - decay)
        v[part] = SAG / SAG_TIME * direction * decay
        rest[part] = case.arm.friction.static * direction
    return samples._replace(q=q, v=v, rest=rest)


def with_compensated_friction(case: Case, samples: Samples) -> Samples:
    """Return holds in which the controller compensates friction in the direction of the sag."""
    push = 0.45 * case.arm.friction.static * np.sign(held_by(case, samples))
    return samples._replace(rest=0.55 * samples.rest + push)


def samples_of(case: Case, kind: str) -> Samples:
    """Return `motion`, or holds from one direction (`singles`) or both (`pairs`)."""
    return motion(case, 20.0) if kind == 'motion' else holds(case, 8, kind == 'pairs')


def motion(case: Case, seconds: float) -> Samples:
    """Return a sum of sines."""
    states = fourier_motion(case.arm, RATE, seconds, case.seed)
    return Samples(states.times, states.q, states.v, states.a, np.full(states.q.shape, np.nan))


def measured(case: Case, samples: Samples, noise: float = NOISE, gain: float = 1.0) -> np.ndarray:
    """Return the effort (m, n) of the loaded arm, whose friction differs from the model."""
    rng = np.random.default_rng(case.seed + 20_000)
    arm, friction = case.arm.with_payloads([case.load]), case.arm.friction
    effort = RigidBody(arm).inverse_dynamics_batch(samples.q, samples.v, samples.a)
    change = rng.uniform(0.7, 1.3, (2, arm.joint_count))
    sliding = change[0] * friction.viscous * samples.v + (
        change[1] * friction.coulomb * np.sign(samples.v))
    effort = effort + np.where(np.isnan(samples.rest), sliding, samples.rest)
    decay = np.exp(-2.0 * np.pi * CUTOFF / RATE)
    white = rng.normal(size=effort.shape) * np.sqrt(1.0 - decay**2)
    colored = np.empty_like(effort)
    value = rng.normal(size=arm.joint_count)
    for i, step in enumerate(white):  # noise after a low-pass filter of the first order
        value = decay * value + step
        colored[i] = value
    return gain * (effort + noise * effort_limit(arm) * colored)


def estimated(
    case: Case, samples: Samples, effort: np.ndarray, with_advice: bool = False,
    scale_deviation: float = 0.0,
) -> PayloadEstimate:
    """Return the estimate of the load of a case, by default with exact effort scales."""
    estimator = PayloadEstimator(case.arm, case.link, CUTOFF, scale_deviation)
    estimator.add(samples.t, samples.q, samples.v, samples.a, effort)
    return estimator.estimate(with_advice)


def errors_in_deviations(case: Case, estimate: PayloadEstimate) -> dict[int, float]:
    """Return (estimate − truth) / deviation of the observable parameters, by their index."""
    truth = case.load.body.toDynamicParameters()
    return {
        i: float((estimate.values[i] - truth[i]) / estimate.deviations[i])
        for i, verdict in enumerate(estimate.verdicts) if verdict == 'observable'}
