# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The damping of an arm in a fault."""

import math

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.gains.gain_scaling import LOOP_DELAY
from robot_dynamics.control.gate import DECAY

FAULT_DAMPING = 0.5
"""Fraction of K_d with which a joint is damped in a fault."""


def braked(
    controller: Controller, q: FloatArray, v: FloatArray, holding: FloatArray,
    ahead: FloatArray | None = None, returns: bool = False, lost: BoolArray | None = None,
    planned: FloatArray | float = 0.0,
) -> FloatArray:
    """
    Return `holding` (n,), that of q, with a torque −M D v that brakes, within the effort limits.

    M and g are those of the position `ahead` when the effort acts, with slow states later than q
    unless it is given: the gravity of moving joints changes by more than light joints can bear.
    If the arm `returns`, joints beyond a position limit are pulled back to it by M K_p. A `lost`
    joint (n,) is braked with at most the `planned` speeds (n,) of the others: what it does to them
    must not drive it further.
    """
    drive = controller.arm.drive
    torque = holding if drive is None else drive.torque(holding)
    with controller.lock, np.errstate(all='ignore'):
        body, limit = controller.dynamics.rigid_body, controller.arm.limits.effort
        ahead = q + controller.gains.lag * v if ahead is None else ahead
        torque = torque + (body.gravity(ahead) - body.gravity(q))
        M = body.mass_matrix(ahead)
        K_p, K_d = controller.laws.feedback_gains
        a, limits = FAULT_DAMPING * K_d * v, controller.arm.limits
        if returns:
            a = a + K_p * (q - np.clip(q, limits.lower, limits.upper))
        damping = M @ a
        if lost is not None:
            plan = FAULT_DAMPING * K_d * np.clip(v, -planned, planned)
            rest = _inertia_without(M, lost, 1.0 / (FAULT_DAMPING * K_d.max() * (
                LOOP_DELAY + np.max(controller.gains.lag)))) @ np.where(lost, 0.0, a - plan)
            damping = M @ plan + np.where(lost, 0.0, rest)
        clipped = torque - np.clip(torque - damping, -limit, limit)
        free = np.maximum(limit - np.where(damping > 0.0, -torque, torque), 0.0)
        share = np.where(damping != 0.0, free / np.abs(damping), 1.0)
        scaled = min(1.0, float(share.min(initial=1.0))) * damping
        # The damping of one joint alone may accelerate the others.
        torque = torque - (clipped if v @ clipped > v @ scaled else scaled)
        if not np.isfinite(torque).all():
            return holding
        return torque if drive is None else drive.command(torque)


def _inertia_without(M: FloatArray, lost: BoolArray, largest: float) -> FloatArray:
    """
    Return the inertia (n, n) that damps the joints which are not `lost` (n,).

    A lost joint moves freely: then a light joint with a parallel axis, damped with the
    inertia of both, would stop within the delay of the loop, and oscillate. So its damping is at
    most `largest` times that of the joint alone.
    """
    c = M[:, lost]
    taken = c @ np.linalg.pinv(c[lost]) @ c.T  # by lost joints that are free
    growth = float((taken / (M - taken)).diagonal()[~lost].max(initial=0.0))
    return M - max(0.0, 1.0 - max(largest - 1.0, 0.0) / max(growth, 1e-9)) * taken


def braking_share(
    controller: Controller, damping: FloatArray, wanted: FloatArray,
) -> FloatArray:
    """Return the share (n,) of the wanted damping that acts, with the known dry friction."""
    arm = controller.arm
    friction = np.abs(arm.friction.at_rest.static / arm.given_drive.scale) * np.sign(wanted)
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.where(
            wanted != 0.0, np.clip((damping + friction) / wanted, 0.0, 1.0), 1.0)


def coasting(
    controller: Controller, holding: FloatArray, passed: float, since: float,
) -> FloatArray:
    """
    Return the effort (n,) that brakes and holds an arm of which no states arrive.

    `holding` (n,) is that of the last state, `passed` [s] ago. Until `since` [s] after it the arm
    has moved on; then its velocity decays as by the damping of `braked`.
    """
    if controller.state is None:
        return holding
    _, q, v = controller.state
    left = math.exp(-DECAY * max(passed - since, 0.0))
    ahead = q + v * (min(passed, since) + (1.0 - left) / DECAY)
    return braked(controller, q, left * v, holding, ahead)
