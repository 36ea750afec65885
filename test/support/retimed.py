# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Arms and paths of the tests of retiming, and an oracle of limits and distances."""

from dataclasses import replace

import numpy as np
from one_joint_arm import arm_of, inertial
import pinocchio as pin
from robot_dynamics.joints import make_actuators, make_friction
from robot_dynamics.model.arm import ArmModel, JointLimits, load_arm
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.segments import TrajectorySegments

OPEN = np.inf
INERTIA = 0.5


def hinge(effort: float = 2.0, velocity: float = OPEN, kind: str = 'revolute') -> ArmModel:
    """Return an arm of one joint along gravity, or of a slide across it."""
    axis = '0 0 1' if kind == 'revolute' else '1 0 0'
    limit = '<limit lower="-5" upper="5" effort="100" velocity="2"/>'
    arm = load_arm(arm_of(inertial(0.5, (0.1, 0.1, INERTIA)), limit, kind, axis=axis))
    return replace(arm, limits=JointLimits(
        arm.limits.lower, arm.limits.upper, np.array([velocity]), np.array([effort])))


def speed_up_and_down(up: float, down: float, way: float = 1.5) -> float:
    """Return the time of a motion from rest to rest with these accelerations."""
    v = np.sqrt(2.0 * way / (1.0 / up + 1.0 / down))
    return float(v / up + v / down)


def frictionless(arm: ArmModel) -> ArmModel:
    return arm.with_friction(make_friction(arm.joint_names))


def poses(arm: ArmModel, count: int, rng: np.random.Generator, scale: float = 0.7) -> np.ndarray:
    low, high = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    return 0.5 * (low + high) + 0.5 * scale * (high - low) * rng.uniform(
        -1.0, 1.0, (count, arm.joint_count))


def sampled(trajectory: JointTrajectory, count: int = 9) -> tuple[np.ndarray, ...]:
    segments = TrajectorySegments(trajectory)
    k = segments.count
    return segments.sample(np.repeat(np.arange(k), count), np.tile(np.linspace(0, 1, count), k))


def largest_ratio(arm: ArmModel, trajectory: JointTrajectory, share: float = 1.0) -> float:
    """Return the largest |value| / limit: Pinocchio's RNEA, friction and motors by formula."""
    q, v, a = sampled(trajectory)
    model, G, q0 = arm.pinocchio_model, arm.coordinates.G, arm.coordinates.q0
    data = model.createData()
    load = np.array([
        G.T @ pin.rnea(model, data, G @ one + q0, G @ two, G @ three)
        for one, two, three in zip(q, v, a)])
    f = arm.friction
    dry = f.coulomb + (f.static - f.coulomb) * np.exp(-(v / f.stribeck_velocity)**2)
    gears = (f.sigmoid + f.load_coefficient * np.abs(load)) * np.tanh(v / f.sigmoid_velocity)
    tau = load + f.viscous * v + dry * np.sign(v) + f.offset + gears
    ratios = [np.abs(v) / arm.limits.velocity, np.abs(tau) / arm.limits.effort / share]
    if arm.actuators is not None:
        m = arm.actuators
        rotor = m.gear_ratio**2 * m.rotor_inertia * a
        passed = tau - rotor
        gain = np.where(passed * v < 0.0, 1.0 / m.efficiency, m.efficiency)
        current = (rotor + passed / gain) / (m.gear_ratio * m.torque_constant)
        voltage = m.resistance * current + m.back_emf_constant * m.gear_ratio * v
        ratios += [np.abs(current) / m.current_limit / share,
                   np.abs(voltage) / m.voltage_limit / share]
    return float(max(one.max() for one in ratios))


def distance_from_lines(samples: np.ndarray, q: np.ndarray) -> float:
    """Return the largest distance of positions (m, n) from the lines between dense samples."""
    way = np.diff(samples, axis=0)
    kept = np.linalg.norm(way, axis=1) > 1e-12
    start, way = samples[:-1][kept], way[kept]
    largest = 0.0
    for one in q:
        near = int(np.argmin(((start - one)**2).sum(axis=1)))
        rows = slice(max(near - 2, 0), near + 2)
        share = np.clip(((one - start[rows]) * way[rows]).sum(axis=1) / (
            way[rows]**2).sum(axis=1), 0.0, 1.0)
        gaps = np.linalg.norm(start[rows] + share[:, np.newaxis] * way[rows] - one, axis=1)
        largest = max(largest, float(gaps.min()))
    return largest


def with_friction_and_motors(arm: ArmModel, kind: str, room: np.ndarray) -> ArmModel:
    """Return an arm whose friction takes a part of the effort that gravity leaves."""
    names = arm.joint_names
    v = np.where(np.isfinite(arm.limits.velocity), np.minimum(arm.limits.velocity, 10.0), 3.0)
    if kind == 'stribeck':
        return arm.with_friction(make_friction(
            names, 0.1 * room / v, 0.1 * room, 0.2 * room, 0.05, 0.02 * room, sigmoid=0.1 * room,
            load_coefficient=0.05))
    current = np.maximum(arm.limits.effort, 1.0) / (50.0 * 0.05 * 0.7)
    current = np.where(np.isfinite(current), current, 40.0)
    return arm.with_friction(make_friction(names, (), 0.1 * room)).with_actuators(make_actuators(
        names, 0.05, -50.0, resistance=0.5, rotor_inertia=2e-6, efficiency=0.7,
        current_limit=current, voltage_limit=0.55 * current + 2.5 * v))
