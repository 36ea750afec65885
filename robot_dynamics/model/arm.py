# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The arm model of the package: joint names, limits, links, and payloads."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import os
import reprlib

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.joints.actuator import Actuators, make_reflected_inertia
from robot_dynamics.joints.effort_calibration import EffortCalibration
from robot_dynamics.joints.friction import JointFriction, make_friction
from robot_dynamics.model.payload import Payload
from robot_dynamics.model.uncertainty import ModelUncertainty
from robot_dynamics.urdf.description_file import urdf_text
from robot_dynamics.urdf.parser import parse_urdf, resolve_mimic, UrdfJoint, UrdfRobot
from robot_dynamics.urdf.transmissions import gear_ratio, Reductions
from robot_dynamics.validation import check_unique, check_vector

STANDARD_GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True, eq=False)
class JointLimits:
    """
    Limits of n joints, each (n,); infinite for no limit. [rad, m], [/s], [N·m, N].

    `effort` is the torque at the joint that the drive can deliver (`ArmModel.with_drive`).
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    effort: FloatArray


@dataclass(frozen=True)
class MimicJoint:
    """A joint that follows an actuated one: position = multiplier × leader + offset."""

    name: str
    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class JointCoordinates:
    """
    The map from n actuated joints to the m joints of the whole tree: q_tree = G q + q0.

    `G` (m, n) sorts the joints, makes mimic joints follow their leaders (their row contains the
    multiplier), and locks joints that are not actuated (their row is zero); `q0` is (m,). By the
    principle of virtual work, efforts are mapped back with Gᵀ. Because G is constant,
    M = Gᵀ M_tree G and C = Gᵀ C_tree G.
    """

    G: FloatArray
    q0: FloatArray

    def __post_init__(self) -> None:
        m, n = self.G.shape
        identity = m == n and np.array_equal(self.G, np.eye(n)) and not self.q0.any()
        permutation = m == n and np.array_equal(self.G.T @ self.G, np.eye(n)) and (
            np.isin(self.G, (0.0, 1.0)).all())
        object.__setattr__(self, 'is_identity', bool(identity))
        object.__setattr__(self, 'is_permutation', bool(permutation))

    is_identity: bool = False
    is_permutation: bool = False

    def position(self, q: FloatArray) -> FloatArray:
        """Positions of the tree, shape (m,), or (samples, m) from (samples, n)."""
        return q if self.is_identity else q @ self.G.T + self.q0

    def rate(self, v: FloatArray) -> FloatArray:
        """Velocities or accelerations of the tree, shape (m,) or (samples, m)."""
        return v if self.is_identity else v @ self.G.T

    def effort(self, tau: FloatArray) -> FloatArray:
        """Efforts at the actuated joints, (n,) or (samples, n), for efforts at all joints."""
        return tau if self.is_identity else tau @ self.G

    def jacobian(self, J: FloatArray) -> FloatArray:
        """
        J G (k, n): a Jacobian (k, m) over all joints of the tree, over the actuated joints.

        Pinocchio returns a flat array (k,) for a tree of one joint.
        """
        J = J.reshape(-1, len(self.G))
        return J if self.is_identity else J @ self.G

    def form(self, A: FloatArray) -> FloatArray:
        """Gᵀ A G: a matrix over all joints of the tree mapped to the actuated joints."""
        return A if self.is_identity else self.G.T @ A @ self.G


@dataclass(frozen=True, eq=False)
class ArmModel:
    """
    An arm with a fixed base and n actuated joints, in the order of `joint_names`.

    The model is immutable: `with_payloads` returns another one. `pinocchio_model` contains the
    whole tree, whose joints `joint_coordinates` maps to the actuated ones.
    """

    name: str
    joint_names: tuple[str, ...]
    joint_kinds: tuple[str, ...]
    limits: JointLimits
    friction: JointFriction
    mimic_joints: tuple[MimicJoint, ...]
    locked_joints: dict[str, float]
    link_names: tuple[str, ...]
    coordinates: JointCoordinates
    pinocchio_model: pin.Model
    unloaded_model: pin.Model
    payloads: tuple[Payload, ...] = ()
    actuators: Actuators | None = None
    reductions: Reductions = field(default_factory=dict)
    drive: EffortCalibration | None = None
    report: EffortCalibration | None = None
    uncertainty: ModelUncertainty | None = None

    def __repr__(self) -> str:
        loads = ''.join(f', {payload!r}' for payload in self.payloads)
        return (f'<ArmModel {self.name!r}, {self.joint_count} joints '
                f'{reprlib.repr(self.joint_names)}{loads}>')

    @property
    def joint_count(self) -> int:
        return len(self.joint_names)

    @property
    def gravity(self) -> FloatArray:
        """Acceleration of gravity (3,) in the base frame [m/s²]."""
        return np.array(self.pinocchio_model.gravity.linear)

    @property
    def is_continuous(self) -> BoolArray:
        """Marks the continuous joints, (n,): a whole turn of them is no displacement."""
        return np.array([kind == 'continuous' for kind in self.joint_kinds], dtype=np.bool_)

    @property
    def gear_ratios(self) -> dict[str, float]:
        """
        The gear ratios N in the transmissions of the URDF, by joint; a joint may have no ratio.

        Raises ModelError if a ratio is zero, non-numeric, or stated with different values.
        """
        ratios = {name: gear_ratio(name, self.reductions) for name in self.joint_names}
        return {name: ratio for name, ratio in ratios.items() if ratio is not None}

    def link_frame(self, link: str, field: str = 'frame_id') -> pin.Frame:
        """Return Pinocchio's frame of a link; raise InvalidInputError for an unknown one."""
        if link not in self.link_names:
            raise InvalidInputError(
                f'{field} is {link!r}, expected one of the links {list(self.link_names)}')
        model = self.pinocchio_model
        return model.frames[model.getFrameId(link, pin.FrameType.BODY)]

    def with_friction(self, friction: JointFriction) -> 'ArmModel':
        """Return this arm with this friction instead of that of the URDF."""
        return replace(self, friction=friction)

    def with_actuators(self, actuators: Actuators) -> 'ArmModel':
        """Return this arm with these motors, whose reflected inertia becomes part of M(q)."""
        return replace(self._with_armature(actuators.reflected_inertia), actuators=actuators)

    @property
    def reflected_inertia(self) -> FloatArray:
        """The reflected rotor inertias (n,) [kg·m²] or [kg] in M(q); 0 if not known."""
        model = self.pinocchio_model
        return np.array([model.armature[model.joints[model.getJointId(name)].idx_v]
                         for name in self.joint_names])

    def with_reflected_inertia(self, inertia: npt.ArrayLike) -> 'ArmModel':
        """
        Return this arm with these reflected rotor inertias [kg·m²] or [kg], without motors.

        `inertia` is (n,) or one number for all joints; motors have their own (`make_actuators`).
        Raises InvalidInputError for another number of values, and for a negative or non-finite
        value.
        """
        J = make_reflected_inertia(self.joint_names, inertia)
        return replace(self._with_armature(J), actuators=None)

    def with_drive(self, drive: EffortCalibration | None) -> 'ArmModel':
        """
        Return this arm with these drives, None for drives whose effort is the torque.

        The effort limits become those of the torque (`EffortCalibration.torque_limit`).
        """
        if drive is None:
            return self
        return replace(
            self, drive=drive, limits=replace(self.limits, effort=drive.torque_limit()))

    @property
    def given_drive(self) -> EffortCalibration:
        """The drives; scale 1 and offset 0, both exact, if `drive` is not set."""
        return self.drive or self._exact

    @property
    def given_report(self) -> EffortCalibration:
        """The report of the drives; scale 1 and offset 0, both exact, if `report` is not set."""
        return self.report or replace(
            self._exact, limit=self.given_drive.limit)

    @property
    def _exact(self) -> EffortCalibration:
        n = self.joint_count
        return EffortCalibration(np.ones(n), np.zeros(n), self.limits.effort)

    def with_rotors_apart(self, apart: BoolArray) -> 'ArmModel':
        """Return this arm without the rotors of the joints for which `apart` (n,) is true."""
        return self._with_armature(np.where(apart, 0.0, self.reflected_inertia))

    def _with_armature(self, inertias: FloatArray) -> 'ArmModel':
        models = self.pinocchio_model.copy(), self.unloaded_model.copy()
        for model in models:
            for name, inertia in zip(self.joint_names, inertias):
                model.armature[model.joints[model.getJointId(name)].idx_v] = inertia
        return replace(self, pinocchio_model=models[0], unloaded_model=models[1])

    def with_gravity(self, gravity: npt.ArrayLike) -> 'ArmModel':
        """
        Return this arm with this gravity (3,) in the base frame [m/s²].

        Raises InvalidInputError for another number of values or a non-finite value.
        """
        g = check_vector('gravity', gravity, 3, ('x', 'y', 'z'))
        models = self.pinocchio_model.copy(), self.unloaded_model.copy()
        for model in models:
            model.gravity.linear = g
        return replace(self, pinocchio_model=models[0], unloaded_model=models[1])

    def with_payloads(self, payloads: Sequence[Payload]) -> 'ArmModel':
        """
        Return this arm with these loads instead of its present loads.

        Each load is added to the inertia of its link. Raises InvalidInputError for an unknown
        link.
        """
        model = self.unloaded_model.copy()
        loads = tuple(payload for payload in payloads if payload.mass > 0.0)
        for payload in loads:
            frame = self.link_frame(payload.link, 'payload.header.frame_id')
            model.inertias[frame.parentJoint] += frame.placement.act(payload.body)
        return replace(self, pinocchio_model=model, payloads=loads)


def load_arm(
    urdf: str | os.PathLike[str],
    joints: Sequence[str] = (),
    gravity: npt.ArrayLike = STANDARD_GRAVITY,
) -> ArmModel:
    """
    Return the arm that a URDF describes.

    `urdf` is the path of a URDF or xacro file, also with `file://` or `package://`, or the text
    of a URDF: a string with `<`. Raises ModelError if the file cannot be read, and like
    `arm_from_urdf`, which has the other parameters.
    """
    return arm_from_urdf(urdf_text(urdf), joints, gravity)


def arm_from_urdf(
    urdf: str, joints: Sequence[str] = (), gravity: npt.ArrayLike = STANDARD_GRAVITY,
) -> ArmModel:
    """
    Return the arm that the text of a URDF describes; it is never the path of a file.

    `joints` names the actuated joints in the wanted order; empty means all moving joints that are
    no mimic joints and may leave the position 0, in the order of the document. Other moving joints
    are locked at 0, or at the limit nearest to 0, and keep their mass. `gravity` [m/s²] is
    expressed in the base frame.

    Raises ModelError if the URDF cannot be used, InvalidInputError for wrong names or gravity.
    """
    robot = parse_urdf(urdf)
    g = check_vector('gravity', gravity, 3, ('x', 'y', 'z'))
    actuated = _actuated_joints(robot, joints)
    index = {joint.name: i for i, joint in enumerate(actuated)}
    locked = {
        joint.name: float(np.clip(0.0, joint.lower, joint.upper)) for joint in robot.joints
        if joint.moves and joint.mimic is None and joint.name not in index}
    relations = {
        joint.name: resolve_mimic(joint, robot.joints) for joint in robot.joints if joint.moves}
    still = {
        name: multiplier * locked[leader] + offset
        for name, (leader, multiplier, offset) in relations.items() if leader in locked}
    model = _without_joints(_build_pinocchio_model(robot), still)
    model.gravity.linear = g
    G, q0 = np.zeros((model.nv, len(actuated))), np.zeros(model.nv)
    mimic_joints = []
    viscous, coulomb = np.zeros(len(actuated)), np.zeros(len(actuated))
    for joint in robot.joints:
        if not joint.moves or not model.existJointName(joint.name):
            continue
        row = model.joints[model.getJointId(joint.name)].idx_v
        if joint.name in still:
            q0[row] = still[joint.name]
            continue
        leader, multiplier, offset = relations[joint.name]
        column = index[leader]
        G[row, column], q0[row] = multiplier, offset
        # Friction of a mimic joint acts on its leader, with the same power on both sides.
        viscous[column] += multiplier**2 * joint.viscous_friction
        coulomb[column] += abs(multiplier) * joint.coulomb_friction
        if joint.mimic is not None:
            mimic_joints.append(MimicJoint(joint.name, leader, multiplier, offset))
    return ArmModel(
        name=robot.name,
        joint_names=tuple(index),
        joint_kinds=tuple(joint.kind for joint in actuated),
        limits=JointLimits(*(
            np.array([getattr(joint, name) for joint in actuated])
            for name in ('lower', 'upper', 'velocity_limit', 'effort_limit'))),
        friction=make_friction(tuple(index), viscous, coulomb),
        mimic_joints=tuple(mimic_joints),
        locked_joints=locked,
        link_names=robot.link_names,
        coordinates=JointCoordinates(G, q0),
        pinocchio_model=model,
        unloaded_model=model,
        reductions=robot.reductions,
    )


def _actuated_joints(robot: UrdfRobot, names: Sequence[str]) -> tuple[UrdfJoint, ...]:
    candidates = {
        joint.name: joint for joint in robot.joints if joint.moves and joint.mimic is None}
    if not candidates:
        raise ModelError(
            f'robot_description: robot {robot.name!r} has no joint that moves, expected at '
            'least one revolute, continuous or prismatic joint')
    check_unique('joints', names)
    for name in names:
        if name not in candidates:
            raise InvalidInputError(
                f'joints has {name!r}, expected joints out of {list(candidates)}')
    closed = [name for name, joint in candidates.items() if joint.lower == joint.upper == 0.0]
    for name in closed:
        if name in names or len(closed) == len(candidates):
            raise ModelError(
                f'robot_description: joint {name!r} is {candidates[name].kind} with lower=0 and '
                'upper=0, expected a range (lower below upper), or other names in joints')
    return tuple(candidates[name] for name in names) or tuple(
        joint for name, joint in candidates.items() if name not in closed)


def _without_joints(model: pin.Model, positions: dict[str, float]) -> pin.Model:
    """
    Return the model with these joints fixed at these positions; their links keep their mass.

    If Pinocchio cannot do this, because a link has the name of a joint, they remain coordinates.
    """
    if not positions:
        return model
    q = np.zeros(model.nq)
    for name, position in positions.items():
        q[model.joints[model.getJointId(name)].idx_q] = position
    try:
        return pin.buildReducedModel(model, [model.getJointId(name) for name in positions], q)
    except ValueError:
        return model


def _build_pinocchio_model(robot: UrdfRobot) -> pin.Model:
    try:
        return pin.buildModelFromXML(robot.pinocchio_xml)
    except Exception as error:  # Pinocchio passes on any exception of its parser
        raise ModelError(
            f'robot_description: robot {robot.name!r} was refused by the parser: {error}'
        ) from error
