# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An arm as a model of MuJoCo (MJCF): bodies, joints, motors, gravity; no geometry, no contact.

MuJoCo computes the same M(q), C(q, v) v, g(q), reflected rotor inertia (`armature`) and viscous
friction (`damping`). Its `frictionloss` is a soft constraint with the bound F_c + F_a, while this
package has a law of the velocity; other friction terms have no counterpart. Source: MuJoCo's
documentation, chapter "XML reference".
"""

from collections.abc import Iterable
import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import body_names

TIME_STEP = 0.001
"""[s]"""
SMALLEST = 1e-15
"""Mass [kg] and moment [kg·m²] up to which MuJoCo refuses a moving body."""
TRIANGLE_TOLERANCE = 1e-9
"""Fraction of the largest moment by which it may exceed the sum of the others (rounding)."""


def arm_to_mjcf(arm: ArmModel) -> str:
    """
    Return the MJCF of an arm with its payloads, rotors, friction, limits and gravity.

    Each body is a moving link with all links that are fixed to it, and has a site per fixed link.
    A mimic joint becomes an equality constraint, a locked joint a fixed body. The control of a
    motor is the joint effort [N·m] or [N], or the motor torque [N·m] if the arm has actuators.
    Raises ModelError that names the body if MuJoCo would refuse its mass or inertia.
    """
    root = Element('mujoco', model=arm.name)
    root.append(ElementTree.Comment(_comment(arm)))
    SubElement(root, 'compiler', angle='radian', autolimits='true')
    SubElement(
        root, 'option', gravity=_text(arm.pinocchio_model.gravity.linear),
        timestep=_text([TIME_STEP]), integrator='implicitfast')
    world = SubElement(root, 'worldbody')
    _add_sites(world, arm, 0)
    bodies = [world]
    for i in range(1, arm.pinocchio_model.njoints):
        bodies.append(_add_body(bodies[arm.pinocchio_model.parents[i]], arm, i))
    if arm.mimic_joints:
        _add_equalities(SubElement(root, 'equality'), arm)
    _add_motors(SubElement(root, 'actuator'), arm)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding='unicode') + '\n'


def _comment(arm: ArmModel) -> str:
    omitted = arm.friction.omitted
    control = 'motor torque' if arm.actuators else 'joint effort'
    lines = [f'Control: {control}. Velocity limits and geometry are not part of this file.']
    if omitted:
        lines.append(f'Without counterpart in MuJoCo: {", ".join(omitted)}.')
    return f' {" ".join(lines)} '


def _add_body(parent: Element, arm: ArmModel, i: int) -> Element:
    """Add the body of joint i of Pinocchio to its parent."""
    model, name = arm.pinocchio_model, body_names(arm)[i - 1]
    row = model.joints[i].idx_v
    G, q0 = arm.coordinates.G[row], arm.coordinates.q0
    data = model.joints[i].createData()
    model.joints[i].calc(data, q0 if not G.any() else np.zeros(model.nq))
    placement = model.jointPlacements[i] * data.M
    body = SubElement(parent, 'body', {'name': name, **_pose(placement)})
    _add_inertial(body, name, model.inertias[i], moves=bool(G.any()))
    if G.any():
        SubElement(body, 'joint', _joint(arm, i, np.asarray(data.S)))
    _add_sites(body, arm, i)
    return body


def _add_inertial(body: Element, name: str, inertia: pin.Inertia, *, moves: bool) -> None:
    moments = np.asarray(np.linalg.eigvalsh(inertia.inertia))
    if moves and (inertia.mass <= SMALLEST or moments[0] <= SMALLEST):
        raise ModelError(
            f'body {name!r} has a mass of {inertia.mass:g} kg and a smallest principal moment of '
            f'inertia of {moments[0]:g} kg·m², expected both above {SMALLEST:g} for MuJoCo')
    if moments[2] - moments[0] - moments[1] > TRIANGLE_TOLERANCE * moments[2]:
        raise ModelError(
            f'the largest principal moment of inertia of body {name!r} is {moments[2]:.4g} kg·m², '
            f'expected at most the sum of the others, {moments[0] + moments[1]:.4g}, for MuJoCo')
    if inertia.mass <= SMALLEST:
        return
    tensor = np.asarray(inertia.inertia)
    SubElement(
        body, 'inertial', pos=_text(inertia.lever), mass=_text([inertia.mass]),
        fullinertia=_text(tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]))


def _joint(arm: ArmModel, i: int, subspace: FloatArray) -> dict[str, str]:
    """Return the attributes of a joint with the motion subspace (6,), linear part first."""
    name = arm.pinocchio_model.names[i]
    slides = bool(subspace[:3].any())
    values = {
        'name': name, 'type': 'slide' if slides else 'hinge',
        'axis': _text(subspace[:3] if slides else subspace[3:])}
    if name not in arm.joint_names:
        return values
    j = arm.joint_names.index(name)
    low, high = arm.limits.lower[j], arm.limits.upper[j]
    if math.isfinite(low) and math.isfinite(high):
        values['range'] = _text([low, high])
    armature = arm.pinocchio_model.armature[arm.pinocchio_model.joints[i].idx_v]
    friction = arm.friction
    return {
        **values, 'armature': _text([armature]),
        'damping': _text([friction.counterpart('damping')[j]]),
        'frictionloss': _text([friction.counterpart('friction')[j]])}


def _add_sites(body: Element, arm: ArmModel, i: int) -> None:
    """Add a site for each link that is fixed to the body of joint i, at the frame of the link."""
    for frame in arm.pinocchio_model.frames:
        if frame.type == pin.FrameType.BODY and frame.parentJoint == i and (
                frame.name != body.get('name')):
            SubElement(body, 'site', {'name': frame.name, **_pose(frame.placement)})


def _add_equalities(equality: Element, arm: ArmModel) -> None:
    for mimic in arm.mimic_joints:
        SubElement(
            equality, 'joint', joint1=mimic.name, joint2=mimic.leader,
            polycoef=_text([mimic.offset, mimic.multiplier, 0.0, 0.0, 0.0]))


def _add_motors(actuator: Element, arm: ArmModel) -> None:
    n = arm.joint_count
    gear = np.ones(n) if arm.actuators is None else arm.actuators.gear_ratio
    for name, ratio, limit in zip(arm.joint_names, gear, arm.limits.effort):
        motor = SubElement(actuator, 'motor', name=name, joint=name, gear=_text([ratio]))
        if math.isfinite(limit):
            bound = limit / abs(ratio)
            motor.set('ctrlrange', _text([-bound, bound]))


def _pose(placement: pin.SE3) -> dict[str, str]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {'pos': _text(placement.translation), 'quat': _text([w, x, y, z])}


def _text(values: Iterable[float]) -> str:
    return ' '.join(repr(float(value) + 0.0) for value in values)
