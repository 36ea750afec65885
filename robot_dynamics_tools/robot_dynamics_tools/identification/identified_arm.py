# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The identified model as a URDF and as parameters of the node.

`dynamics_node` with the URDF of `fitted_urdf` and the parameters of `parameter_values`
computes what the fit predicts: rigid bodies, reflected inertia, friction of joints and gears, and
the offset of the effort.

A body of Pinocchio is a moving link with all links that are fixed to it. The identified inertial
of a body goes to the moving link. Links fixed to it, such as a hand or locked fingers, keep their
own inertials if the remainder is a valid mass distribution; otherwise they keep a fraction of
them (`kept_fractions`). The rest of the URDF is unchanged.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import ModelError
from robot_dynamics.joints.effort_calibration import LARGEST_OFFSET
from robot_dynamics.joints.friction import FRICTION_FIELDS, JointFriction, make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import body_names, COUNT, inertial_parameters
from robot_dynamics.urdf.inertials import LinkBody, read_bodies
from robot_dynamics.validation import lower_triangle
from robot_dynamics_tools.identification import friction_regressor
from robot_dynamics_tools.identification.regularized_fit import Fit
from robot_dynamics_tools.pseudo_inertia import is_consistent
from robot_dynamics_tools.urdf_editing import with_elements
from robot_dynamics_tools.yaml_output import dump_yaml, rounded

_LEAST = 1e-15
_MOST_HALVINGS = 12
_FixedLinks = dict[str, tuple[FloatArray, FloatArray]]
"""φ (10,) of links in their own frame and in that of the body that they are fixed to."""
_TENSOR = {'ixx': (0, 0), 'ixy': (0, 1), 'ixz': (0, 2), 'iyy': (1, 1), 'iyz': (1, 2),
           'izz': (2, 2)}


def fitted_urdf(urdf: str, arm: ArmModel, fit: Fit) -> str:
    """Return the URDF with bodies and friction of a fit; raise as `identified_urdf`."""
    friction = fitted_friction(arm, fit)
    return identified_urdf(
        urdf, arm, fit.parameters, friction.counterpart('damping'),
        friction.counterpart('friction'))


def identified_urdf(
    urdf: str, arm: ArmModel, parameters: FloatArray, viscous: FloatArray, dry: FloatArray,
) -> str:
    """
    Return the URDF with the bodies' parameters φ (10 × bodies,), of the arm that it describes.

    `viscous` and `dry` (n,) [N·m·s/rad, N·m] become `<dynamics damping friction>` of the joints.
    Bodies whose φ is unchanged keep their elements. Raises ModelError if a body is not physically
    consistent.
    """
    links: dict[str, str] = {}
    for main, phi, fixed, fraction in _bodies(urdf, arm, parameters):
        kept = fraction * sum((body for _, body in fixed.values()), start=np.zeros(COUNT))
        links[main] = _inertial(phi - kept)
        if fraction < 1.0:
            links |= {name: _inertial(fraction * own) for name, (own, _) in fixed.items()}
    dynamics = {
        name: {'damping': _text(damping), 'friction': _text(friction)}
        for name, damping, friction in zip(arm.joint_names, viscous, dry)}
    return with_elements(urdf, links, dynamics)


def kept_fractions(urdf: str, arm: ArmModel, parameters: FloatArray) -> dict[str, float]:
    """
    Return the fraction of its inertial that each fixed link keeps, of links that keep not all.

    The rest of the identified body is in the inertial of the moving link. Raises ModelError like
    `identified_urdf`.
    """
    return {
        link: fraction for _, _, fixed, fraction in _bodies(urdf, arm, parameters)
        if fraction < 1.0 for link in fixed}


def _bodies(urdf: str, arm: ArmModel, parameters: FloatArray) -> Iterator[
        tuple[str, FloatArray, _FixedLinks, float]]:
    """Yield main link, φ (10,), fixed links and their kept fraction, of each changed body."""
    before = inertial_parameters(arm.with_payloads(())).reshape(-1, COUNT)
    bodies = {body.name: body for body in read_bodies(urdf)}
    for i, (phi, old) in enumerate(zip(parameters.reshape(-1, COUNT), before)):
        if np.allclose(phi, old, rtol=1e-9, atol=1e-12):
            continue
        main = body_names(arm)[i]
        if not is_consistent(phi) or main not in bodies:
            raise ModelError(
                f'the parameters of the body {main!r} correspond to no mass distribution, '
                'expected a positive definite pseudo-inertia')
        fixed = _fixed_links(arm, i + 1, main, bodies)
        of_fixed = sum((body for _, body in fixed.values()), start=np.zeros(COUNT))
        fraction = next((0.5**k for k in range(_MOST_HALVINGS)
                         if is_consistent(phi - 0.5**k * of_fixed)), 0.0)
        yield main, phi, fixed, fraction


def _fixed_links(
    arm: ArmModel, joint: int, main: str, bodies: Mapping[str, LinkBody],
) -> _FixedLinks:
    """Return the massive links that are fixed to the main link of a body."""
    found: _FixedLinks = {}
    for frame in arm.pinocchio_model.frames:
        body = bodies.get(frame.name)
        if (frame.type != pin.FrameType.BODY or frame.parentJoint != joint or frame.name == main
                or body is None or not body.mass):
            continue
        own = pin.Inertia(body.mass, body.com, body.inertia)
        found[frame.name] = (
            own.toDynamicParameters(), frame.placement.act(own).toDynamicParameters())
    return found


def _inertial(phi: FloatArray) -> str:
    body = pin.Inertia.FromDynamicParameters(phi)
    tensor = np.asarray(body.inertia)
    entries = ' '.join(f'{name}="{_text(tensor[place])}"' for name, place in _TENSOR.items())
    return '\n      '.join([
        '<inertial>', f'<origin rpy="0 0 0" xyz="{" ".join(_text(x) for x in body.lever)}"/>',
        f'<mass value="{_text(body.mass)}"/>', f'<inertia {entries}/>']) + '\n    </inertial>'


def _text(value: float) -> str:
    return f'{value if abs(value) > _LEAST else 0.0:.12g}'


_INERTIAS = ('actuator.rotor_inertia', 'actuator.reflected_inertia')


def fitted_friction(arm: ArmModel, fit: Fit) -> JointFriction:
    """Return the friction of the joints; the width of a term that is not used is its default."""
    scale = friction_regressor.scales_of(arm.joint_kinds)
    values: dict[str, Any] = {field.name: scale * (field.default or 0.0)
                              for field in FRICTION_FIELDS if field.heading}
    for i, column in enumerate(friction_regressor.FRICTION_COLUMNS, 1):
        if i in friction_regressor.OFFSET:
            continue
        values[column.parameter.name] = values[column.parameter.name] + fit.joint_values[:, i]
        if column.width:
            is_used = [i in structure.columns for structure in fit.structures]
            values[column.width.name] = np.where(
                is_used, scale * column.candidate, values[column.width.name])
    return make_friction(arm.joint_names, **values)


def fitted_offset(fit: Fit) -> FloatArray:
    """Return the offset F_b (n,) of the effort, as a torque at the joint [N·m] or [N]."""
    return np.asarray(fit.joint_values[:, friction_regressor.OFFSET].sum(axis=1))


def parameter_values(
    arm: ArmModel, fit: Fit, drive_gain: Sequence[float] | None = None,
    given: Mapping[str, object] | None = None, is_stiffness: bool = False,
) -> dict[str, Any]:
    """
    Return the parameters of `dynamics_node`, by name, that belong to the identified URDF.

    `drive_gain` (n,) [N·m/A] or [N/A] is the joint effort per unit of recorded effort, if the
    effort is a current; a negative one becomes a negative effort scale. With `is_stiffness` it is
    that of position drives [N·m/rad] or [N/m]. `given` are the previous parameters; those that the
    identification does not determine are kept.
    """
    friction, offset = fitted_friction(arm, fit), fitted_offset(fit)

    replaced = ('friction.', 'robot_description', 'uncertainty.', *(
        ('actuator.',) if arm.actuators is None else _INERTIAS))
    kept = {name: value for name, value in (given or {}).items() if not name.startswith(replaced)}
    values: dict[str, Any] = {
        'command': kept.get('command', 'none'),
        'joints': list(arm.joint_names),
        'gravity': [float(x) for x in arm.pinocchio_model.gravity.linear],
        **{f'friction.{field.name}': rounded(getattr(friction, field.name))
           for field in FRICTION_FIELDS if field.heading},
    }
    if any(rotors := rounded(fit.joint_values[:, friction_regressor.INERTIA])):
        values['actuator.reflected_inertia'] = rotors
    gain = np.ones(arm.joint_count) if drive_gain is None else np.asarray(drive_gain)
    sign, gain = np.sign(gain), np.abs(gain)
    if drive_gain is not None and is_stiffness:
        values['drive.stiffness'] = rounded(gain)
    elif drive_gain is not None:
        # N = 1: only N K_t was identified.
        values['actuator.gear_ratio'] = [1.0]
        values['actuator.torque_constant'] = rounded(gain)
    if arm.drive is not None:
        values |= {'effort.command_scale': rounded(arm.drive.scale),
                   'effort.command_offset': rounded(arm.drive.offset)}
    if arm.report is not None or (sign < 0.0).any() or offset.any():
        given_report = arm.given_report
        report = replace(
            given_report, scale=sign * given_report.scale, offset=gain * given_report.offset)
        values['effort.report_scale'] = rounded(report.scale)
        most = LARGEST_OFFSET * report.limit
        values['effort.report_offset'] = rounded(
            np.clip(report.offset + offset / report.scale, -most, most))
        if report.covariance is not None:
            slope = np.concatenate([sign, gain])
            C = report.covariance * np.outer(slope, slope)
            values['effort.report_covariance'] = lower_triangle(C)
    if drive_gain is not None:
        values['measured_effort'] = 'none' if is_stiffness else 'motor_current'
    return {**kept, **values}


def parameter_file(values: Mapping[str, object], comments: Sequence[str] = ()) -> str:
    """Return a parameter file of ROS 2 for `dynamics` and `simulated_arm`, comments first."""
    parameters: dict[str, Any] = {}
    for name, value in values.items():
        group, _, field = name.rpartition('.')
        (parameters.setdefault(group, {}) if group else parameters)[field] = value
    return dump_yaml({'/**': {'ros__parameters': parameters}}, comments, 'a parameter file')
