# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Two independent engines, MuJoCo and Drake, behind one interface: the reference of the tests.

Nothing here uses `robot_dynamics` or Pinocchio. An engine computes with all movable joints of
the tree, including mimic joints as independent ones; `Projected` maps them to actuated joints.
Conventions are those of the manipulator equation M a + C v + g − Jᵀ f = tau. A wrench has a
link, a force (3,) [N] and a torque (3,) [N·m], which act at the origin of the link, in its frame.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from optional_library import library

Array = npt.NDArray[np.float64]
MOVING = ('revolute', 'continuous', 'prismatic')
GRAVITY = (0.0, 0.0, -9.81)


class PointMotion(NamedTuple):
    """
    Translation (3,), rotation (3, 3), J (6, n) and J̇ q̇ (6,) of a point of a link.

    Linear first, along the axes of the base frame.
    """

    translation: Array
    rotation: Array
    jacobian: Array
    bias: Array


def bare_urdf(urdf: str) -> ElementTree.Element:
    """Return links with their inertials, and joints without limits or mimic; nothing else."""
    root = ElementTree.fromstring(urdf)
    bare = ElementTree.Element('robot', {'name': 'robot'})
    for link in root.findall('link'):
        ElementTree.SubElement(bare, 'link', link.attrib).extend(link.findall('inertial'))
    for joint in root.findall('joint'):
        copy = ElementTree.SubElement(bare, 'joint', joint.attrib)
        for tag in ('origin', 'parent', 'child', 'axis'):
            copy.extend(joint.findall(tag))
    return bare


class Engine:
    """
    Dynamics of the whole tree; vectors are (m,) in the order of `joint_names`.

    An engine builds its model from `self.bare`, and has `inverse_dynamics`, `mass_matrix`, and the
    `point_motion` of a point in the frame of its link; Drake also has the energies.
    """

    def __init__(self, urdf: str) -> None:
        self.bare = bare_urdf(urdf)
        joints = self.bare.findall('joint')
        self.joint_names = [j.attrib['name'] for j in joints if j.attrib['type'] in MOVING]
        self.build()

    def gravity(self, q: Array) -> Array:
        return self.inverse_dynamics(q, 0.0 * q, 0.0 * q)

    def coriolis(self, q: Array, v: Array) -> Array:
        """Return C v."""
        return self.inverse_dynamics(q, v, 0.0 * q) - self.gravity(q)

    def external(self, q: Array, wrenches: Sequence[Any]) -> Array:
        """Return −Jᵀ f."""
        return self.inverse_dynamics(q, 0.0 * q, 0.0 * q, wrenches) - self.gravity(q)


class MujocoEngine(Engine):
    """MuJoCo, with its constraint solver off and its bounds on mass and inertia unset."""

    def build(self) -> None:
        self.mj = library('mujoco')
        options = ElementTree.SubElement(self.bare, 'mujoco')
        ElementTree.SubElement(options, 'compiler', {
            'fusestatic': 'false', 'discardvisual': 'true', 'balanceinertia': 'false'})
        self.model = self.mj.MjModel.from_xml_string(
            ElementTree.tostring(self.bare, encoding='unicode'))
        self.model.opt.gravity = GRAVITY
        self.model.opt.disableflags = self.mj.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = self.mj.MjData(self.model)
        joints = [self.model.joint(name) for name in self.joint_names]
        self.position = np.array([joint.qposadr[0] for joint in joints])
        self.velocity = np.array([joint.dofadr[0] for joint in joints])

    def _set(self, q: Array, v: Array | None = None) -> Any:
        data = self.data
        self.mj.mj_resetData(self.model, data)
        data.qpos[self.position] = q
        if v is not None:
            data.qvel[self.velocity] = v
        return data

    def _world(self, wrench: Any) -> tuple[int, Any, Any]:
        body = self.model.body(wrench.link).id
        rotation = self.data.xmat[body].reshape(3, 3)
        return body, rotation @ wrench.force, rotation @ wrench.torque

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, wrenches: Sequence[Any] = ()) -> Array:
        data = self._set(q, v)
        data.qacc[self.velocity] = a
        self.mj.mj_inverse(self.model, data)
        tau = data.qfrc_inverse[self.velocity]
        return np.asarray(tau + self.external(q, wrenches) if wrenches else tau)

    def mass_matrix(self, q: Array) -> Array:
        data, m = self._set(q), self.model.nv
        self.mj.mj_forward(self.model, data)
        M = np.zeros((m, m))
        for row, unit in zip(M, np.eye(m)):
            self.mj.mj_mulM(self.model, data, row, unit)
        return M[np.ix_(self.velocity, self.velocity)]

    def point_motion(self, q: Array, v: Array, link: str, point: Array) -> PointMotion:
        data, body, n = self._set(q, v), self.model.body(link).id, self.model.nv
        self.mj.mj_forward(self.model, data)
        rotation = data.xmat[body].reshape(3, 3).copy()
        place = data.xpos[body] + rotation @ point
        J, J_dot = np.zeros((2, 3, n)), np.zeros((2, 3, n))
        self.mj.mj_jac(self.model, data, J[0], J[1], place, body)
        self.mj.mj_jacDot(self.model, data, J_dot[0], J_dot[1], place, body)
        return PointMotion(
            place, rotation, J.reshape(6, n)[:, self.velocity],
            J_dot.reshape(6, n)[:, self.velocity] @ v)

    def external(self, q: Array, wrenches: Sequence[Any]) -> Array:
        data = self._set(q)
        self.mj.mj_forward(self.model, data)
        pushed = np.zeros(self.model.nv)
        for wrench in wrenches:
            body, force, torque = self._world(wrench)
            self.mj.mj_applyFT(
                self.model, data, force, torque, data.xpos[body].copy(), body, pushed)
        return np.asarray(-pushed[self.velocity])


class DrakeEngine(Engine):
    """
    Drake's MultibodyPlant in continuous time, its root link welded to the world.

    Its parser replaces a physically impossible inertia of a link, and only warns.
    """

    def build(self) -> None:
        multibody = library('pydrake.multibody.plant')
        parsing = library('pydrake.multibody.parsing')
        self.tree = library('pydrake.multibody.tree')
        self.force_of = library('pydrake.multibody.math').SpatialForce
        self.plant = multibody.MultibodyPlant(0.0)
        parsing.Parser(self.plant).AddModelsFromString(
            ElementTree.tostring(self.bare, encoding='unicode'), 'urdf')
        children = {child.attrib['link'] for child in self.bare.iterfind('joint/child')}
        links = {link.attrib['name'] for link in self.bare.findall('link')}
        root, = links - children
        if root != 'world':
            self.plant.WeldFrames(self.plant.world_frame(), self._body(root).body_frame())
        self.plant.mutable_gravity_field().set_gravity_vector(GRAVITY)
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        joints = [self.plant.GetJointByName(name) for name in self.joint_names]
        self.position = np.array([joint.position_start() for joint in joints])
        self.velocity = np.array([joint.velocity_start() for joint in joints])

    def _body(self, link: str) -> Any:
        return self.plant.GetBodyByName(link)

    def _full(self, value: Array, index: Any) -> Array:
        full = np.zeros(len(value))
        full[index] = value
        return full

    def _set(self, q: Array, v: Array | None = None) -> Any:
        v = np.zeros(len(q)) if v is None else v
        self.plant.SetPositions(self.context, self._full(q, self.position))
        self.plant.SetVelocities(self.context, self._full(v, self.velocity))
        return self.context

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, wrenches: Sequence[Any] = ()) -> Array:
        context = self._set(q, v)
        forces = self.tree.MultibodyForces(self.plant)
        self.plant.CalcForceElementsContribution(context, forces)
        for wrench in wrenches:
            body, force = self._body(wrench.link), self.force_of(wrench.torque, wrench.force)
            body.AddInForce(context, np.zeros(3), force, body.body_frame(), forces)
        tau = self.plant.CalcInverseDynamics(context, self._full(a, self.velocity), forces)
        return np.asarray(tau[self.velocity])

    def mass_matrix(self, q: Array) -> Array:
        M = self.plant.CalcMassMatrix(self._set(q))
        return np.asarray(M[np.ix_(self.velocity, self.velocity)])

    def point_motion(self, q: Array, v: Array, link: str, point: Array) -> PointMotion:
        context, frame = self._set(q, v), self._body(link).body_frame()
        pose = self.plant.EvalBodyPoseInWorld(context, self._body(link))
        world, wrt = self.plant.world_frame(), self.tree.JacobianWrtVariable.kV
        J = self.plant.CalcJacobianSpatialVelocity(context, wrt, frame, point, world, world)
        bias = self.plant.CalcBiasSpatialAcceleration(context, wrt, frame, point, world, world)
        return PointMotion(
            pose.multiply(point), pose.rotation().matrix(),
            np.roll(J, 3, axis=0)[:, self.velocity],
            np.concatenate([bias.translational(), bias.rotational()]))

    def kinetic_energy(self, q: Array, v: Array) -> float:
        return float(self.plant.CalcKineticEnergy(self._set(q, v)))

    def potential_energy(self, q: Array) -> float:
        return float(self.plant.CalcPotentialEnergy(self._set(q)))


class Projected(Engine):
    """An engine in actuated joints: q_tree = G q + q0; efforts are mapped back with Gᵀ."""

    def __init__(self, engine: Engine, G: Array, q0: Array) -> None:
        self.engine, self.G, self.q0 = engine, G, q0

    def tree(self, q: Array) -> Array:
        """Return the positions of all joints of the tree."""
        return self.G @ q + self.q0

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, wrenches: Sequence[Any] = ()) -> Array:
        return self.G.T @ self.engine.inverse_dynamics(
            self.tree(q), self.G @ v, self.G @ a, wrenches)

    def mass_matrix(self, q: Array) -> Array:
        return self.G.T @ self.engine.mass_matrix(self.tree(q)) @ self.G

    def point_motion(self, q: Array, v: Array, link: str, point: Array) -> PointMotion:
        motion = self.engine.point_motion(self.tree(q), self.G @ v, link, point)
        return motion._replace(jacobian=motion.jacobian @ self.G)

    def kinetic_energy(self, q: Array, v: Array) -> float:
        return self.engine.kinetic_energy(self.tree(q), self.G @ v)

    def potential_energy(self, q: Array) -> float:
        return self.engine.potential_energy(self.tree(q))
