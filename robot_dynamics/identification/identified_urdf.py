# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
A URDF with the inertials, and the friction, that were identified; all else stays as it is.

The bodies of Pinocchio are a link that moves and all that is fixed to it. The parameters of
a body go to the link that moves; links fixed to it keep their own inertials, as long as the
rest is a mass distribution, and give theirs up otherwise.
"""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import ModelError
from robot_dynamics.identification.identified_arm import joint_estimates
from robot_dynamics.identification.regularized_fit import Fit
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.pseudo_inertia import COUNT, is_consistent
from robot_dynamics.model.regressor import body_names, inertial_parameters
from robot_dynamics.urdf.editing import with_elements
from robot_dynamics.urdf.inertials import LinkBody, read_bodies

_LEAST = 1e-15
_TENSOR = {'ixx': (0, 0), 'ixy': (0, 1), 'ixz': (0, 2), 'iyy': (1, 1), 'iyz': (1, 2),
           'izz': (2, 2)}


def fitted_urdf(urdf: str, arm: ArmModel, fit: Fit) -> str:
    """Return the URDF with bodies and friction of a fit; raise as `identified_urdf`."""
    joints = joint_estimates(arm, fit)
    return identified_urdf(
        urdf, arm, fit.parameters, np.array([joint.viscous for joint in joints]),
        np.array([joint.coulomb + joint.sigmoid for joint in joints]))


def identified_urdf(
    urdf: str, arm: ArmModel, parameters: FloatArray, viscous: FloatArray, dry: FloatArray,
) -> str:
    """
    Return the URDF with the bodies' parameters φ (10 × bodies,), of the arm that it describes.

    `viscous` and `dry` (n,) [N·m·s/rad, N·m] become `<dynamics damping friction>` of the joints.
    Bodies whose φ are as before keep their elements. Raises ModelError where a body is not
    physically consistent.
    """
    links = {
        name: None if phi is None else _inertial(phi)
        for name, phi in _changed_links(urdf, arm, parameters).items()}
    dynamics = {
        name: f'<dynamics damping="{_text(damping)}" friction="{_text(friction)}"/>'
        for name, damping, friction in zip(arm.joint_names, viscous, dry)}
    return with_elements(urdf, links, dynamics)


def _changed_links(urdf: str, arm: ArmModel, parameters: FloatArray) -> (
        dict[str, FloatArray | None]):
    """Return φ (10,) of each link whose inertial changes; None where it loses it."""
    before = inertial_parameters(arm.with_payloads(())).reshape(-1, COUNT)
    bodies = {body.name: body for body in read_bodies(urdf)}
    changed: dict[str, FloatArray | None] = {}
    for i, (phi, old) in enumerate(zip(parameters.reshape(-1, COUNT), before)):
        if np.allclose(phi, old, rtol=1e-9, atol=1e-12):
            continue
        main = body_names(arm)[i]
        if not is_consistent(phi) or main not in bodies:
            raise ModelError(
                f'the parameters of the body {main!r} belong to no mass distribution, expected '
                'a positive definite pseudo-inertia')
        fixed = _fixed_links(arm, i + 1, main, bodies)
        rest = phi - sum(fixed.values(), start=np.zeros(COUNT))
        if is_consistent(rest):
            changed[main] = rest
        else:
            changed[main] = phi
            changed.update(dict.fromkeys(fixed))
    return changed


def _fixed_links(
    arm: ArmModel, joint: int, main: str, bodies: Mapping[str, LinkBody],
) -> dict[str, FloatArray]:
    """Return φ (10,), in the body's frame, of the links with mass fixed to a body's main link."""
    found: dict[str, FloatArray] = {}
    for frame in arm.pinocchio_model.frames:
        body = bodies.get(frame.name)
        if (frame.type != pin.FrameType.BODY or frame.parentJoint != joint or frame.name == main
                or body is None or not body.mass):
            continue
        own = pin.Inertia(body.mass, body.com, body.inertia)
        found[frame.name] = frame.placement.act(own).toDynamicParameters()
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
