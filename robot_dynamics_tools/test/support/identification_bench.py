# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of arms with known parameters, for the tests of identification."""


from arm_motions import States, with_inertial_parameters
import numpy as np
from robot_dynamics.model import ArmModel, RigidBody
from robot_dynamics.model.regressor import inertial_parameters
from robot_dynamics_tools.analysis.motion_filter import filter_motion, FilteredMotion
from robot_dynamics_tools.pseudo_inertia import from_coordinates, pseudo_inertia_matrix
from robot_dynamics_tools.recordings.joint_series import JointSeries

ROTORS = np.array([0.3, 0.1])
F_V, F_A, F_B = np.array([1.0, 0.5]), np.array([2.0, 1.0]), np.array([0.2, -0.1])
WIDTH = 0.1
"""Rotors and smooth friction of the planar arm, whose URDF has none."""


def one_way(states: States, joint: int, seed: int = 0, speed: float = 0.12) -> States:
    """
    Return a motion in which one joint only moves backward, at about this speed [rad/s].

    It rests in the first and the last 3 % of the motion.
    """
    rng = np.random.default_rng(100 + seed)
    t, interval = states.times, states.times[1] - states.times[0]
    w, phase = 2.0 * np.pi * 0.1, rng.uniform(0.0, 2.0 * np.pi)
    ramp = np.clip(np.minimum(t - 0.03 * t[-1], 0.97 * t[-1] - t), 0.0, 1.0)
    ramp = ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)
    speeds = 1.0 + 0.35 * np.sin(w * t + phase) + 0.2 * np.sin(3.0 * w * t + 2.0 * phase)
    q, v, a = states.q.copy(), states.v.copy(), states.a.copy()
    v[:, joint] = -speed * speeds * ramp
    q[:, joint] = 1.0 + interval * np.concatenate(
        [[0.0], np.cumsum(0.5 * (v[1:, joint] + v[:-1, joint]))])
    a[:, joint] = np.gradient(v[:, joint], interval)
    return States(t, q, v, a)


def smooth_friction(v: np.ndarray) -> np.ndarray:
    """Return viscous friction, dry friction with a sigmoid, and an offset, of two joints."""
    return np.asarray(F_V * v + F_A * np.tanh(v / WIDTH) + F_B)


def lugre_friction(states: States, seed: int = 0) -> np.ndarray:
    """
    Return friction (m, n) that no friction model of the identification describes.

    The LuGre model with the Stribeck curve, and viscous friction proportional to |v|^0.8.
    """
    rng = np.random.default_rng(seed)
    n = states.q.shape[1]
    F_c = rng.uniform(0.5, 1.5, n)
    F_s, v_s, stiffness = 1.5 * F_c, rng.uniform(0.02, 0.1, n), F_c / rng.uniform(0.001, 0.01, n)
    z, rows = np.zeros(n), []
    for moved, v in zip(np.diff(states.q, axis=0, prepend=states.q[:1]), states.v):
        g = F_c + (F_s - F_c) * np.exp(-(v / v_s)**2)
        end = g * np.sign(moved) / stiffness
        z = end + (z - end) * np.exp(-stiffness * np.abs(moved) / g)
        rows.append(stiffness * z + F_c * np.sign(v) * np.abs(v)**0.8)
    return np.array(rows)


def changed_arm(arm: ArmModel, size: float, seed: int = 0) -> ArmModel:
    """Return an arm with physically consistent bodies that differ by about this fraction."""
    rng = np.random.default_rng(seed)
    return with_inertial_parameters(arm, np.concatenate([
        from_coordinates(
            np.linalg.cholesky(pseudo_inertia_matrix(phi)), size * rng.normal(size=10))
        for phi in inertial_parameters(arm).reshape(-1, 10)]))


def rigid_effort(arm: ArmModel, states: States, rotors: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the effort (m, n) of bodies and rotors."""
    return np.asarray(RigidBody(arm).inverse_dynamics_batch(
        states.q, states.v, states.a) + rotors * states.a)


def recorded(
    arm: ArmModel, states: States, effort: np.ndarray, noise: np.ndarray | float = 0.0,
    seed: int = 0, quantum: float = 0.0, has_velocity: bool = True,
) -> FilteredMotion:
    """Return the filtered motion of a recording with white noise on the effort."""
    rng = np.random.default_rng(seed)
    q = states.q if quantum == 0.0 else np.round(states.q / quantum) * quantum
    return filter_motion(series_of(
        arm, states._replace(q=q, v=states.v if has_velocity else None),
        effort + noise * rng.normal(size=effort.shape)))


def series_of(arm: ArmModel, states: States, effort: np.ndarray | None) -> JointSeries:
    """Return the joint states of a recording, without velocity if it is None."""
    stamps = np.asarray(np.round(states.times * 1e9), dtype=np.int64)
    return JointSeries(arm.joint_names, stamps, states.q, states.v, effort, 0)
