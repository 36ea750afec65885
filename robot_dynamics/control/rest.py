# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The arm at rest: its stiffness, the dry friction that may hold it, and its shortfall."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.drive_check import DriveCheck
from robot_dynamics.control.gains.oscillation import REST_SPEED
from robot_dynamics.control.gate import LEFT
from robot_dynamics.control.laws.law_table import NO_COMMAND
from robot_dynamics.control.trajectory_goal import GOAL_TOLERANCE, LATE
from robot_dynamics.joints.units import units_of

USUAL_FRICTION, SURPLUS = 0.05, 0.4
"""Dry friction of usual gearboxes, as a fraction of the effort limit; and the share of known
friction that may be more than its compensation."""


class RestStiffness(NamedTuple):
    """
    The closed loop of a law that follows references, at rest, each (n,).

    `stiffness` K_j [N·m/rad] or [N/m] is the effort of the feedback per position error of the
    joint, with scaled gains: of computed torque M_jj K_p, with rotors as far as they are known.
    `friction_error` [rad] or [m] is the position error up to which the known dry friction F_s can
    hold the joint against the feedback and against the compensation of F_s over the width w
    (`tracking_effort`), if it acts at rest: F_s / (K_j + F_s / w). It is NaN if no dry friction
    is known.
    """

    stiffness: FloatArray
    friction_error: FloatArray


def rest_stiffness(controller: Controller) -> RestStiffness | None:
    """Return the stiffness at the last state, None without a state or a law that follows."""
    with controller.lock:
        laws, state = controller.laws, controller.state
        if state is None or not laws.follows or controller.options.command == NO_COMMAND:
            return None
        M = controller.dynamics.rigid_body.mass_matrix(state[1])
        K = laws.with_reference.stiffness(M)
    friction = controller.dynamics.arm.friction
    F_s = friction.at_rest.static
    is_compensated = controller.options.friction_compensation == 'reference'
    spring = F_s / friction.tracking_width if is_compensated else 0.0
    with np.errstate(divide='ignore', invalid='ignore'):
        return RestStiffness(K, np.where(F_s > 0.0, F_s / (K + spring), np.nan))


def is_held(controller: Controller, q: FloatArray, error: FloatArray) -> BoolArray:
    """
    Return at which joints (n,) dry friction can hold the arm against the feedback, at rest.

    `q` and `error`, the reference minus q, are (n,) [rad] or [m]. Known friction is compensated
    but for SURPLUS; other friction is assumed to be as large as usual in gearboxes. A further
    error of LEFT is tolerated.
    """
    friction, limit = controller.arm.friction, controller.arm.limits.effort
    usual = np.where(np.isfinite(limit), USUAL_FRICTION * limit, 0.0)
    with controller.lock:
        M = controller.dynamics.rigid_body.mass_matrix(q)
        K_p, K_d = controller.laws.feedback_gains
    drives = controller.options.drive_stiffness
    viscous = friction.viscous * K_p / np.maximum(K_d, 1e-9)
    K = M * K_p + np.diag(viscous) if drives is None else np.diag(drives)
    known = friction.at_rest.static + np.abs(friction.offset)
    holding = np.where(known > 0.0, SURPLUS * known, usual) + LEFT * np.diagonal(K)
    return np.asarray(np.abs(K @ error) <= holding)


def shortfall(controller: Controller, drives: DriveCheck) -> str:
    """
    Return which joint rests most beyond GOAL_TOLERANCE from the end of its reference, and why.

    Friction, loads and contacts are named only if the motion has confirmed the drive of the joint.
    The result is empty if there is none, while this joint moves, and until LATE seconds after the
    reference ended.
    """
    with controller.lock:
        trajectory, state = controller.trajectory, controller.state
        if trajectory is None or state is None or (
                state[0] < trajectory.end_ns + 1e9 * LATE):
            return ''
        stamp_ns, q, v = state
        e = controller.position_error(trajectory.sample(stamp_ns).position, q)
        j = int(np.argmax(np.abs(e)))
        if not abs(e[j]) > GOAL_TOLERANCE or abs(v[j]) > REST_SPEED:
            return ''
        arm, body = controller.dynamics.arm, controller.dynamics.rigid_body
        K = body.mass_matrix(q) * controller.laws.feedback_gains[0]
        feedback: FloatArray = K @ e
        needed = feedback[j] + body.gravity(q)[j]
        limit, may_hold = arm.limits.effort[j], is_held(controller, q, e)[j]
    units = units_of(arm.joint_kinds[j])
    if abs(needed) > limit:
        cause = f'its effort limit of {limit:g} {units.effort} does not suffice'
    elif not drives.is_right(j):
        cause = 'the drive is not known (status drive): its effort, the model or friction holds it'
    elif may_hold and arm.friction.at_rest.static[j] > 0.0:
        cause = (
            'dry friction can hold it: identify friction and rotor, or give '
            'friction.presliding_distance')
    elif may_hold:
        cause = 'dry friction, which the model lacks, can hold it: identify friction and rotor'
    else:
        cause = 'a load that the model does not contain, or a contact, holds it'
    others = [arm.joint_names[k] for k in np.flatnonzero(np.abs(e) > GOAL_TOLERANCE) if k != j]
    too = f' ({", ".join(others)} too)' if others else ''
    return (
        f'{arm.joint_names[j]!r} rests {units.error_text(abs(e[j]))} from its goal, expected at '
        f'most {units.error_text(GOAL_TOLERANCE)}{too}: the feedback is {feedback[j]:.3g} '
        f'{units.effort}, its stiffness {K[j, j]:.3g} {units.effort}/{units.position}; {cause}')
