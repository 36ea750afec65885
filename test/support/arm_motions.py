# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Motions of arms, and arms with other inertial parameters."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from robot_dynamics.model import ArmModel

HARMONICS, BASE_FREQUENCY = 5, 0.1


class States(NamedTuple):
    """A motion: times (m,), all others (m, n)."""

    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def fourier_motion(arm: ArmModel, rate: float, duration: float, seed: int = 0) -> States:
    """Return a sum of sines, approximately within the limits of an arm."""
    t = np.arange(0.0, duration, 1.0 / rate)
    n = arm.joint_count
    rng = np.random.default_rng(seed)
    q, v, a = (np.zeros((len(t), n)) for _ in range(3))
    for k in range(1, HARMONICS + 1):
        w = 2.0 * np.pi * BASE_FREQUENCY * k
        A, B = rng.normal(size=(2, n)) * 0.5
        sine, cosine = np.sin(w * t)[:, np.newaxis], np.cos(w * t)[:, np.newaxis]
        q += A * sine + B * cosine
        v += w * (A * cosine - B * sine)
        a -= w**2 * (A * sine + B * cosine)
    return States(t, q, v, a)


def moves_with_pauses(arm: ArmModel, rate: float, duration: float, seed: int = 0) -> States:
    """Return minimum-jerk moves between near positions, with pauses, as in teleoperation."""
    rng = np.random.default_rng(seed)
    n, fine = arm.joint_count, 1000.0
    pieces, at = [], np.zeros(n)
    while sum(len(piece) for piece in pieces) < duration * fine:
        goal = rng.uniform(-0.4, 0.4, n) * (rng.uniform(size=n) < 0.7)
        s = np.linspace(0.0, 1.0, int(rng.uniform(0.8, 2.5) * fine))[:, np.newaxis]
        pieces.append(at + (goal - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
        pieces.append(np.tile(goal, (int(rng.uniform(0.0, 0.8) * fine), 1)))
        at = goal
    q = np.concatenate(pieces)[:int(duration * fine)]
    v = np.gradient(q, 1.0 / fine, axis=0)
    a = np.gradient(v, 1.0 / fine, axis=0)
    rows = np.round(np.arange(0.0, len(q) - 1, fine / rate)).astype(int)
    return States(rows / fine, q[rows], v[rows], a[rows])


def with_inertial_parameters(arm: ArmModel, parameters: np.ndarray) -> ArmModel:
    """Return the arm with these inertial parameters (10 × bodies,), without a payload."""
    model = arm.unloaded_model.copy()
    for i, phi in enumerate(parameters.reshape(-1, 10)):
        model.inertias[i + 1] = pin.Inertia.FromDynamicParameters(phi)
    return replace(arm, pinocchio_model=model, unloaded_model=model, payloads=())
