# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Other engines: the same four quantities, each by the fastest call that the engine offers to Python.

Arguments and results are arrays, and each call has a new state: the time includes copies, resets
and preparatory computations. This module does not use `robot_dynamics`. A function that makes the
`Calls` of an engine raises ImportError if the engine is not installed.
"""

from collections.abc import Callable
import importlib
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from benchmarks.chains import chain_urdf, ChainLink
from benchmarks.engine_calls import Array, Calls, GRAVITY, named, quiet
from benchmarks.robotics_toolbox import robotics_toolbox, robotics_toolbox_dh
import numpy as np

_KEPT: list[Any] = []
"""Chains that solvers of KDL refer to, but do not keep alive."""


def pinocchio(links: list[ChainLink]) -> Calls:
    """Return the bare calls of Pinocchio; since version 3, crba fills both halves of M."""
    pin = importlib.import_module('pinocchio')
    model = pin.buildModelFromXML(chain_urdf(links))
    data = model.createData()
    return Calls(
        named('Pinocchio', 'pin'),
        lambda q, v, a: pin.rnea(model, data, q, v, a),
        lambda q: pin.computeGeneralizedGravity(model, data, q),
        lambda q: pin.crba(model, data, q),
        lambda q, v, tau: pin.aba(model, data, q, v, tau))


def mujoco(links: list[ChainLink]) -> Calls:
    """
    Return the calls of MuJoCo 4 with constraints disabled.

    Inverse quantities call single stages, because mj_inverse runs more stages and takes longer.
    Forward dynamics calls mj_forward, because its stages take longer if called one by one.
    """
    mj = importlib.import_module('mujoco')
    if int(mj.mj_versionString().split('.')[0]) < 4:
        raise ImportError(f'MuJoCo {mj.mj_versionString()} has other signatures')
    model = mj.MjModel.from_xml_string(chain_urdf(links))
    model.opt.disableflags = mj.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mj.MjData(model)
    # Views of the memory of MuJoCo.
    qpos, qvel, qacc, applied = data.qpos, data.qvel, data.qacc, data.qfrc_applied
    n = model.nv

    def positions(q: Array) -> None:
        qpos[:] = q
        mj.mj_kinematics(model, data)
        mj.mj_comPos(model, data)

    def efforts(q: Array, v: Any, with_acceleration: int) -> Array:
        qvel[:] = v
        positions(q)
        mj.mj_comVel(model, data)
        tau = np.empty(n)
        mj.mj_rne(model, data, with_acceleration, tau)
        return tau

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        qacc[:] = a
        return efforts(q, v, 1)

    def mass_matrix(q: Array) -> Array:
        positions(q)
        mj.mj_makeM(model, data)
        M = np.empty((n, n))
        mj.mj_fullM(model, data, M)
        return M

    def forward_dynamics(q: Array, v: Array, tau: Array) -> Array:
        qpos[:], qvel[:], applied[:] = q, v, tau
        mj.mj_forward(model, data)
        return np.array(qacc)

    return Calls(
        named('MuJoCo', 'mujoco'), inverse_dynamics, lambda q: efforts(q, 0.0, 0), mass_matrix,
        forward_dynamics)


def drake(links: list[ChainLink]) -> Calls:
    """Return the calls of Drake's MultibodyPlant in continuous time."""
    multibody = importlib.import_module('pydrake.multibody.plant')
    parsing = importlib.import_module('pydrake.multibody.parsing')
    tree = importlib.import_module('pydrake.multibody.tree')
    plant = multibody.MultibodyPlant(0.0)
    parsing.Parser(plant).AddModelsFromString(chain_urdf(links), 'urdf')
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName('base_link'))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    forces = tree.MultibodyForces(plant)
    applied = plant.get_applied_generalized_force_input_port().FixValue(
        context, np.zeros(plant.num_velocities()))
    acceleration = plant.get_generalized_acceleration_output_port()

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Any:
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        plant.CalcForceElementsContribution(context, forces)
        return plant.CalcInverseDynamics(context, a, forces)

    def gravity(q: Array) -> Any:
        plant.SetPositions(context, q)
        return -plant.CalcGravityGeneralizedForces(context)

    def mass_matrix(q: Array) -> Any:
        plant.SetPositions(context, q)
        return plant.CalcMassMatrix(context)

    def forward_dynamics(q: Array, v: Array, tau: Array) -> Any:
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        applied.GetMutableData().get_mutable_value().set_value(tau)
        return acceleration.Eval(context)

    return Calls(
        named('Drake', 'drake'), inverse_dynamics, gravity, mass_matrix, forward_dynamics)


def pybullet(links: list[ChainLink]) -> Calls:
    """Return the calls of PyBullet, which takes lists and returns tuples; q̈ by solving with M."""
    with quiet(), tempfile.TemporaryDirectory() as directory:
        bullet = importlib.import_module('pybullet')
        client = bullet.connect(bullet.DIRECT)
        path = Path(directory, 'chain.urdf')
        path.write_text(chain_urdf(links), encoding='utf-8')
        body = bullet.loadURDF(
            str(path), useFixedBase=True, flags=bullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client)
    bullet.setGravity(*GRAVITY, physicsClientId=client)
    rest = [0.0] * len(links)

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        return np.array(bullet.calculateInverseDynamics(
            body, q.tolist(), v.tolist(), a.tolist(), physicsClientId=client))

    def gravity(q: Array) -> Array:
        return np.array(bullet.calculateInverseDynamics(
            body, q.tolist(), rest, rest, physicsClientId=client))

    def mass_matrix(q: Array) -> Array:
        return np.array(bullet.calculateMassMatrix(body, q.tolist(), physicsClientId=client))

    def forward_dynamics(q: Array, v: Array, tau: Array) -> Array:
        position = q.tolist()
        bias = np.array(bullet.calculateInverseDynamics(
            body, position, v.tolist(), rest, physicsClientId=client))
        M = np.array(bullet.calculateMassMatrix(body, position, physicsClientId=client))
        return np.asarray(np.linalg.solve(M, tau - bias))

    return Calls(
        named('PyBullet', 'pybullet'), inverse_dynamics, gravity, mass_matrix, forward_dynamics)


def kdl(links: list[ChainLink]) -> Calls:
    """Return the calls of KDL, with arrays copied number by number; q̈ by solving with M."""
    module = importlib.import_module('PyKDL')
    chain, n = _kdl_chain(module, links), len(links)
    _KEPT.append(chain)
    down = module.Vector(*GRAVITY)
    newton_euler = module.ChainIdSolver_RNE(chain, down)
    parameters = module.ChainDynParam(chain, down)
    position, velocity, acceleration, out, rest = (module.JntArray(n) for _ in range(5))
    inertia, wrenches = module.JntSpaceInertiaMatrix(n), [module.Wrench() for _ in links]
    indices = range(n)

    def fill(target: Any, values: Array) -> Any:
        for i, value in enumerate(values.tolist()):
            target[i] = value
        return target

    def efforts(v: Any, a: Any) -> Array:
        newton_euler.CartToJnt(position, v, a, wrenches, out)
        return np.array([out[i] for i in indices])

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        fill(position, q)
        return efforts(fill(velocity, v), fill(acceleration, a))

    def gravity(q: Array) -> Array:
        parameters.JntToGravity(fill(position, q), out)
        return np.array([out[i] for i in indices])

    def mass_matrix(q: Array) -> Array:
        parameters.JntToMass(fill(position, q), inertia)
        return np.array([[inertia[i, j] for j in indices] for i in indices])

    def forward_dynamics(q: Array, v: Array, tau: Array) -> Array:
        M = mass_matrix(q)
        return np.asarray(np.linalg.solve(M, tau - efforts(fill(velocity, v), rest)))

    return Calls('KDL', inverse_dynamics, gravity, mass_matrix, forward_dynamics)


def _kdl_chain(module: Any, links: list[ChainLink]) -> Any:
    chain = module.Chain()
    for i, link in enumerate(links, 1):
        frame = module.Frame(module.Rotation.RPY(*link.rpy), module.Vector(*link.xyz))
        joint = module.Joint(
            f'joint{i}', frame.p, frame.M * module.Vector(0.0, 0.0, 1.0), module.Joint.RotAxis)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        chain.addSegment(module.Segment(
            f'link{i}', joint, frame, module.RigidBodyInertia(
                link.mass, module.Vector(*link.com),
                module.RotationalInertia(xx, yy, zz, xy, xz, yz))))
    return chain


def dynibo(links: list[ChainLink]) -> Calls:
    """Return the calls of dynibo, whose gravitational acceleration cannot be set from Python."""
    module = importlib.import_module('dynibo')
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory, 'chain.urdf')
        path.write_text(chain_urdf(links), encoding='utf-8')
        robot = module.Robot.from_urdf(str(path))
    shape = (len(links), len(links))
    return Calls(
        named('dynibo', 'dynibo'), robot.inverse_dynamics, robot.gravity,
        lambda q: robot.mass_matrix(q).reshape(shape), robot.forward_dynamics, weight=9.80665)


class Peer(NamedTuple):
    """An engine, and how to install it."""

    name: str
    make: Callable[[list[ChainLink]], Calls]
    source: str


PEERS = (
    Peer('Pinocchio', pinocchio, 'scripts/setup'),
    Peer('MuJoCo', mujoco, 'scripts/setup peers, with Python 3.11 or later'),
    Peer('Drake', drake, 'scripts/setup peers, on x86-64'),
    Peer('PyBullet', pybullet,
         'scripts/setup peers, on x86-64 with Python 3.10 or 3.11 (no other has a wheel)'),
    Peer('KDL', kdl,
         'sudo apt install ros-jazzy-python-orocos-kdl-vendor, or python3-pykdl (no wheel)'),
    Peer('dynibo', dynibo, 'scripts/setup peers, on x86-64'),
    Peer('Robotics Toolbox, URDF', robotics_toolbox,
         'scripts/setup peers, without ROS from apt (it needs numpy 2)'),
    Peer('Robotics Toolbox, DH', robotics_toolbox_dh,
         'scripts/setup peers, without ROS from apt (it needs numpy 2)'),
)
