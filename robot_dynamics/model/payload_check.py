# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Plausibility of payloads, which finds mistakes in units and digits before they have an effect.

A payload is implausible if the arm can hold it almost nowhere, or if its centre of mass is far
outside the arm. g(q) is linear in the mass m of a payload, g_0(q) + m g_1(q), so that each pose
gives the interval of masses for which no joint exceeds its effort limit.
"""

from collections.abc import Sequence
from dataclasses import replace
import math

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.worst_gravity import sample_positions, search_box

REACH_MULTIPLE = 2.0
"""
Largest distance of a centre of mass from the origin of its link, as a multiple of the reach.

The centre of mass of a tool as long as the arm itself is within half the reach. A length in
millimetres instead of metres is outside by orders of magnitude.
"""
LEAST_DISTANCE = 1.0
"""Distance [m] that is always permitted, because links in a URDF may have no extent."""
POSES = 1000
"""Number of poses, spread evenly over the workspace."""
HELD_FRACTION = 0.01
"""
Fraction of the poses in which an arm has to hold its payload.

It is not 0, because an arm that hangs straight down holds any mass.
"""
_NEEDED = math.ceil(HELD_FRACTION * POSES)
_ROUNDING = 1e-9


def check_payloads(arm: ArmModel, payloads: Sequence[Payload], remedy: str = '') -> None:
    """
    Raise InvalidInputError for loads that the arm cannot carry, or for an unknown link.

    `payloads` are all loads of the arm, each of which is checked together with those before it.
    The message names mass, distance and what the arm can hold, and ends with `remedy`.
    """
    for i, payload in enumerate(payloads):
        loaded = arm.with_payloads(payloads[:i])
        loaded.link_frame(payload.link, 'payload.header.frame_id')
        _check_distance(loaded, payload, remedy)
        _check_mass(loaded, payload, remedy)


def check_held_at(
    arm: ArmModel, payloads: Sequence[Payload], q: FloatArray, remedy: str = '',
) -> None:
    """
    Raise InvalidInputError for loads that the arm cannot hold in its configuration q (n,).

    `arm` is without loads. A joint whose effort limit gravity exceeds already without these loads
    is no reason if they do not increase the effort.
    """
    without, g = (RigidBody(each).gravity(q) for each in (arm, arm.with_payloads(payloads)))
    limit = arm.limits.effort
    excess = np.where(np.abs(g) > np.abs(without), np.abs(g) - limit, -np.inf)
    worst = int(np.argmax(excess))
    if excess[worst] > _ROUNDING:
        raise InvalidInputError(
            f'payload.inertia.m is {payloads[-1].mass:.6g} kg on {payloads[-1].link!r}: in the '
            f'present configuration gravity at {arm.joint_names[worst]!r} is then '
            f'{abs(g[worst]):.4g}, expected at most its effort limit {limit[worst]:.4g}{remedy}')


def reach(arm: ArmModel) -> float:
    """Return the largest possible distance [m] of a link or a centre of mass from the base."""
    model = arm.unloaded_model
    slides = _travel(arm)
    lengths = [0.0] * model.njoints
    for joint in range(1, model.njoints):
        lengths[joint] = lengths[model.parents[joint]] + slides[joint] + float(
            np.linalg.norm(model.jointPlacements[joint].translation))
    ends = [(frame.parentJoint, frame.placement.translation) for frame in model.frames
            if frame.type == pin.FrameType.BODY]
    ends += [(joint, model.inertias[joint].lever) for joint in range(1, model.njoints)]
    return float(max(lengths[joint] + np.linalg.norm(offset) for joint, offset in ends))


def holdable_mass(arm: ArmModel, payload: Payload) -> float:
    """
    Return the largest mass [kg] at the position of a payload that the arm holds, ∞ for any mass.

    The arm holds a mass if gravity exceeds no effort limit in HELD_FRACTION of the poses, together
    with its present loads.
    """
    lower, upper = _held_masses(arm, payload)
    is_enough = _held_count(lower, upper, upper) >= _NEEDED
    return max(float(np.max(upper, where=is_enough, initial=0.0)), 0.0)


def _check_distance(arm: ArmModel, payload: Payload, remedy: str) -> None:
    distance, length = float(np.linalg.norm(payload.com)), reach(arm)
    limit = max(REACH_MULTIPLE * length, LEAST_DISTANCE)
    if distance > limit:
        raise InvalidInputError(
            f'payload.inertia.com is {distance:.6g} m from the origin of {payload.link!r}, '
            f'expected at most {limit:.3g} m, since the reach of the arm is {length:.3g} m'
            f'{remedy}')


def _check_mass(arm: ArmModel, payload: Payload, remedy: str) -> None:
    lower, upper = _held_masses(arm, payload)
    if _held_count(lower, upper, np.array([payload.mass]))[0] >= _NEEDED:
        return
    raise InvalidInputError(
        f'payload.inertia.m is {payload.mass:.6g} kg on {payload.link!r}, expected at most '
        f'{holdable_mass(arm, payload):.3g} kg: with more, gravity exceeds the effort limits in '
        f'more than {100.0 * (1.0 - HELD_FRACTION):.0f} % of the poses of the arm{remedy}')


def _held_masses(arm: ArmModel, payload: Payload) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and largest held mass, (poses,) each, of poses that hold any mass."""
    q = sample_positions(arm, POSES)
    unit = replace(payload, mass=1.0, inertia=np.zeros((3, 3)))
    without, with_unit = (RigidBody(each).gravity_batch(q) for each in (
        arm, arm.with_payloads([*arm.payloads, unit])))
    per_mass = with_unit - without
    limit = arm.limits.effort + _ROUNDING
    with np.errstate(divide='ignore', invalid='ignore'):
        ends = np.stack([(-limit - without) / per_mass, (limit - without) / per_mass])
    is_independent = np.abs(per_mass) <= _ROUNDING
    lower = np.where(is_independent, -np.inf, ends.min(axis=0)).max(axis=1)
    upper = np.where(is_independent, np.inf, ends.max(axis=0)).min(axis=1)
    fails = np.any(is_independent & (np.abs(without) > limit), axis=1)
    is_held = ~fails & (lower <= upper)
    return lower[is_held], upper[is_held]


def _held_count(lower: FloatArray, upper: FloatArray, mass: FloatArray) -> IntArray:
    """Return the number of poses (m,) in which masses (m,) are held."""
    m = mass[:, np.newaxis]
    return np.asarray(((lower <= m) & (m <= upper)).sum(axis=1))


def _travel(arm: ArmModel) -> list[float]:
    """Return the largest travel [m] of each Pinocchio joint from its zero, 0 if it turns."""
    low, high = search_box(arm)
    travel = [0.0] * arm.unloaded_model.njoints
    for name, kind, *limits in zip(arm.joint_names, arm.joint_kinds, low, high):
        if kind == 'prismatic':
            travel[arm.unloaded_model.getJointId(name)] = max(map(abs, limits))
    return travel
