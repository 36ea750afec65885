# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A joint that does not follow: it rests away from the end of its reference."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.braking import is_held
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.joints.units import units_of

TOLERANCE = 0.01
"""[rad] or [m] that a joint may rest away from the end of its reference."""
PATIENCE = 0.5
"""[s] after the end of a reference."""


def shortfall(loop: ControlLoop) -> str:
    """
    Return which joint rests most beyond TOLERANCE from the end of its reference, and why.

    Friction, loads and contacts are named only if the motion has confirmed the drive of the joint.
    The result is empty if there is none, during a motion, and for PATIENCE seconds afterwards.
    """
    controller = loop.controller
    with controller.lock:
        trajectory, state, reference = (
            controller.trajectory, controller.state, controller.reference)
        if trajectory is None or state is None or reference is None or (
                state[0] < trajectory.end_ns + 1e9 * PATIENCE):
            return ''
        q = state[1]
        e = controller.position_error(reference.position, q)
        j = int(np.argmax(np.abs(e)))
        if not abs(e[j]) > TOLERANCE:
            return ''
        arm, body = controller.dynamics.arm, controller.dynamics.rigid_body
        K = body.mass_matrix(q) * controller.feedback_gains[0]
        feedback: FloatArray = K @ e
        needed = feedback[j] + body.gravity(q)[j]
        limit, may_hold = arm.limits.effort[j], is_held(controller, q, e)[j]
    units = units_of(arm.joint_kinds[j])
    if abs(needed) > limit:
        cause = f'its effort limit of {limit:g} {units.effort} does not suffice'
    elif not loop.drives.is_right(j):
        cause = 'the drive is not known (status drive): its effort, the model or friction holds it'
    elif may_hold and arm.friction.at_rest.static[j] > 0.0:
        cause = (
            'dry friction can hold it: identify friction and rotor, or give '
            'friction.presliding_distance')
    elif may_hold:
        cause = 'dry friction, which the model lacks, can hold it: identify friction and rotor'
    else:
        cause = 'a load that the model does not contain, or a contact, holds it'
    others = [arm.joint_names[k] for k in np.flatnonzero(np.abs(e) > TOLERANCE) if k != j]
    too = f' ({", ".join(others)} too)' if others else ''
    return (
        f'{arm.joint_names[j]!r} rests {units.error_text(abs(e[j]))} from its goal, expected at '
        f'most {units.error_text(TOLERANCE)}{too}: the feedback is {feedback[j]:.3g} '
        f'{units.effort}, its stiffness {K[j, j]:.3g} {units.effort}/{units.position}; {cause}')
