# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An arm whose drives and friction are unknown: both nodes in lock-step, and its calibration.

The drives of the simulated arm have torque constants that are wrong by up to 30 %, and offsets.
Its friction differs from that of the model by up to 30 %, and its measured efforts have noise.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import time
from typing import Any, NamedTuple

from benchmarks.processes import (
    bench_node,
    DYNAMICS,
    MONITOR,
    node_command,
    running,
    SIMULATED_ARM,
)
from benchmarks.safe_motion_cases import arm_named, description_of
import numpy as np
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.ros.middleware.conversions import (
    payload_to_ros,
    stamp_from_ros,
    trajectory_to_ros,
)
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics_interfaces.srv import SetPayload
from robot_dynamics_tools.gravity_calibration import (
    calibrate_holds,
    Calibration,
    find_holds,
    Hold,
    select_poses,
)
from robot_dynamics_tools.gravity_calibration.calibrated_file import calibrated_file
from robot_dynamics_tools.recordings.joint_series import JointSeries
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

LINKS = {'ur10': 'tool0', 'panda': 'panda_hand', 'xarm7': 'link7', 'default': 'tool0'}
"""The link that carries a load, by the name of the arm."""
WEIGHTS = {'ur10': 5.0, 'panda': 2.0, 'xarm7': 2.0, 'default': 2.0}
"""Known weight [kg] of the calibration."""
LEVER = (0.1, 0.0, 0.1)
"""Centre of mass [m] of the weight."""
POSES, SIDE, MOVE, APPROACH, HOLD = 10, 0.1, 2.0, 2.0, 1.8
"""Poses, distance of their approach [rad], durations [s] of both moves and of a hold."""
SCALE_ERROR, OFFSET = 0.3, 0.03
"""Largest error of the torque constants, and offset relative to the effort limits."""
COULOMB, VISCOUS, FRICTION_ERROR = 0.01, 0.005, 0.3
"""Friction of the model relative to the effort limits, and its largest relative error."""
NOISE = 0.01
"""Standard deviation of the measured efforts relative to the smallest effort limit."""
ROTOR = 0.01
"""Inertia of the rotors on the joint side [kg·m²], relative to the effort limits [N·m]."""
RATE = 125.0
"""Joint states per second."""
FREQUENCY = 30.0
"""Natural frequency [rad/s] of the control law: an unknown load must not displace an arm far."""
EFFORT_RATE = 1e5
"""[N·m/s] Drives that follow any effort: the feedback of slower ones is softer under a load."""
FIRST_MOVE = 3.0
"""[s] to the first pose."""
SETTLING = 1.0
"""[s] after the end of a trajectory."""
TIMEOUT = 60.0


class HiddenArm:
    """An arm, and the values that only the simulated arm has."""

    def __init__(self, name: str, seed: int) -> None:
        self.name, self.rng = name, np.random.default_rng([seed, *name.encode()])
        self.arm: ArmModel = arm_named(name)
        n, limit = self.arm.joint_count, self.arm.limits.effort
        self.scale = self.rng.uniform(1.0 - SCALE_ERROR, 1.0 + SCALE_ERROR, n)
        self.offset = self.rng.uniform(-OFFSET, OFFSET, n) * limit
        self.drive = make_effort_calibration(self.arm.joint_names, self.scale, self.offset, limit)
        self._friction = self.rng.uniform(1.0 - FRICTION_ERROR, 1.0 + FRICTION_ERROR, (2, n))

    def friction(self, is_true: bool) -> dict[str, Any]:
        """Return the parameters of the friction, that of the simulated arm or of the model."""
        viscous, coulomb = self._friction if is_true else np.ones_like(self._friction)
        limit = self.arm.limits.effort
        return {'friction.viscous': (VISCOUS * limit * viscous).tolist(),
                'friction.coulomb': (COULOMB * limit * coulomb).tolist()}

    @contextmanager
    def nodes(self, directory: Path, *files: Path, **parameters: Any) -> Iterator['Session']:
        """Run all nodes, `dynamics` with these parameters and files; yield a client."""
        path = directory / 'arm.urdf'
        path.write_text(description_of(self.name), encoding='utf-8')
        common = {
            'robot_description_file': path, 'joints': list(self.arm.joint_names),
            'actuator.gear_ratio': [1.0], 'actuator.torque_constant': [1.0],
            'actuator.rotor_inertia': (ROTOR * self.arm.limits.effort).tolist()}
        low, high = position_range(self.arm)
        with running({
                'dynamics_monitor': node_command(MONITOR, {}),
                'dynamics': [*node_command(DYNAMICS, {
                    **common, **self.friction(False),
                    'state_timeout': TIMEOUT,
                    'following_error_limit': [0.0],
                    'gains.natural_frequency': [FREQUENCY],
                    'effort_rate_limit': EFFORT_RATE, **parameters}),
                    *(word for file in files for word in ('--params-file', str(file)))],
                'simulated_arm': node_command(SIMULATED_ARM, {
                    **common, **self.friction(True), 'lock_step': True, 'rate': RATE,
                    'paused': True,
                    **{f'effort.{direction}_{quantity}': values.tolist()
                       for direction in ('command', 'report') for quantity, values in (
                           ('scale', self.scale), ('offset', self.offset))},
                    'initial_position': (0.5 * (low + high)).tolist(),
                    'seed': int(self.rng.integers(1000)),
                    'effort_noise': float(NOISE * self.arm.limits.effort.min())})}):
            with bench_node() as node:
                yield Session(node, self.arm)


def position_range(arm: ArmModel) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper bound (n,) of poses, away from the limits."""
    low, high = np.maximum(arm.limits.lower, -2.5), np.minimum(arm.limits.upper, 2.5)
    return low + 0.2 * (high - low), high - 0.2 * (high - low)


class Session:
    """A client of both nodes, which records all joint states."""

    def __init__(self, node: Node, arm: ArmModel) -> None:
        self._node, self._arm = node, arm
        self._trajectories = node.create_publisher(
            JointTrajectoryMsg, 'dynamics/joint_trajectory', 1)
        self._reader = rclpy.create_node('reader')  # in no executor: it is read in batches
        self._subscription = self._reader.create_subscription(
            JointState, 'joint_states', lambda _: None, QoSProfile(depth=20_000))
        self._states: list[JointState] = []
        self._read_until(lambda: bool(self._states), 'a joint state')
        self._wait_for_command()
        self._hold()
        self.set_parameter('simulated_arm', 'paused', False)
        self.wait(SETTLING)

    def _wait_for_command(self) -> None:
        """Wait until `dynamics` has answered a joint state: only then it accepts references."""
        commands = self._reader.create_subscription(
            JointState, 'effort_command', lambda _: None, QoSProfile(depth=1))
        self._read_until(
            lambda: commands.handle.take_message(JointState, False) is not None, 'a command')
        self._reader.destroy_subscription(commands)

    def _hold(self) -> None:
        """Make the arm hold its present pose, which it cannot with gravity compensation alone."""
        self._send(self._to(self.position()))

    def position(self) -> FloatArray:
        """Return the present joint positions (n,)."""
        state = self._states[-1]
        return np.array([state.position[state.name.index(name)] for name in self._arm.joint_names])

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of a node."""
        client = self._node.create_client(SetParameters, f'{node}/set_parameters')
        client.wait_for_service(TIMEOUT)
        future = client.call_async(SetParameters.Request(parameters=[
            Parameter(name, value=value).to_parameter_msg()]))
        self._read_until(future.done, f'response of {node}/set_parameters')
        result, = future.result().results
        if not result.successful:
            raise RuntimeError(f'{node}: {result.reason}')
        self._node.destroy_client(client)

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """Return the response of a service; raise RuntimeError if it has no success."""
        client = self._node.create_client(service_type, name)
        if not client.wait_for_service(TIMEOUT):
            raise TimeoutError(f'no service {name} in {TIMEOUT:g} s')
        future = client.call_async(request)
        self._read_until(future.done, f'a response of {name}')
        response = future.result()
        self._node.destroy_client(client)
        if not response.success:
            raise RuntimeError(f'{name}: {response.message}')
        return response

    def set_payload(self, node: str, payload: Payload) -> None:
        """Set the payload of a node."""
        self.call(SetPayload, f'{node}/set_payload', SetPayload.Request(
            payload=payload_to_ros(payload)))

    def wait(self, seconds: float) -> None:
        """Wait for simulated time to pass."""
        end = self._stamp() + round(1e9 * seconds)
        self._read_until(lambda: self._stamp() >= end, f'{seconds:g} s of simulated time')

    def follow(self, trajectory: JointTrajectory) -> JointSeries:
        """Make the arm follow a trajectory; return the joint states to its end."""
        del self._states[:-1]
        self._send(trajectory)
        self.wait(trajectory.duration + SETTLING)
        order = [self._states[0].name.index(name) for name in self._arm.joint_names]
        stamps = np.array([stamp_from_ros(one.header.stamp) for one in self._states])
        stamps, rows = np.unique(stamps, return_index=True)
        q, v, tau = (
            np.array([getattr(self._states[i], field) for i in rows])[:, order]
            for field in ('position', 'velocity', 'effort'))
        return JointSeries(self._arm.joint_names, stamps, q, v, tau, 0)

    def move_to(self, pose: FloatArray) -> None:
        """Move to a pose in FIRST_MOVE seconds."""
        self.follow(self._to(pose))

    def _to(self, pose: FloatArray) -> JointTrajectory:
        names = self._arm.joint_names
        return make_trajectory(names, [FIRST_MOVE], [pose], (), (), names)

    def _send(self, trajectory: JointTrajectory) -> None:
        self._read_until(
            lambda: self._trajectories.get_subscription_count() > 0, 'a node that subscribes')
        self._trajectories.publish(trajectory_to_ros(trajectory))
        self._trajectories.wait_for_all_acked()

    def _stamp(self) -> int:
        return stamp_from_ros(self._states[-1].header.stamp)

    def _read_until(self, condition: Any, what: str) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f'{what}: none in {TIMEOUT:g} s')
            time.sleep(0.01)
            while (taken := self._subscription.handle.take_message(JointState, False)) is not None:
                self._states.append(taken[0])


def holds(
    arm: ArmModel, poses: FloatArray, side: float, approach: float, hold: float,
) -> JointTrajectory:
    """Return a trajectory to poses (k, n), each approached from both directions of all joints."""
    times, positions, t = list[float](), list[FloatArray](), 0.5
    for pose in poses:
        for offset in (side, -side):
            for position, duration in (
                    (pose + offset, MOVE), (pose, approach), (pose, hold)):
                distance = position - (positions[-1] if positions else position)
                # within 75 % of the velocity limits
                t += max(duration, float(2.5 * (np.abs(distance) / arm.limits.velocity).max()))
                times.append(t)
                positions.append(position)
    return make_trajectory(
        arm.joint_names, times, positions, list(np.zeros_like(positions)), (),
        arm.joint_names)


class Calibrated(NamedTuple):
    """A calibration, its parameter file, and the largest sag [rad] in the poses, before it."""

    calibration: Calibration
    file: Path
    poses: FloatArray
    sag: float


def calibrate(hidden: HiddenArm, directory: Path) -> Calibrated:
    """Calibrate from holds of both nodes, without and with a known weight."""
    arm, name = hidden.arm, hidden.name
    weight = make_payload(LINKS[name], WEIGHTS[name], LEVER)
    low, high = position_range(arm)
    poses = select_poses(
        arm.with_payloads([weight]), POSES, low, high, int(hidden.rng.integers(1000))).positions
    trajectory = holds(arm, poses, SIDE, APPROACH, HOLD)
    found = list[list[Hold]]()
    # friction is symmetric only if the controller does not compensate it at rest
    with hidden.nodes(directory, friction_compensation='none') as session:
        for load in (make_payload(LINKS[name], 0.0), weight):
            session.move_to(trajectory.points[0].position)
            for node in ('simulated_arm', 'dynamics'):
                session.set_payload(node, load)
            session.wait(SETTLING)
            found.append(find_holds(session.follow(trajectory), arm.joint_kinds))
    calibration = calibrate_holds(arm, found[0], found[1], weight)
    path = directory / 'calibrated.yaml'
    path.write_text(calibrated_file('', calibration), encoding='utf-8')
    return Calibrated(calibration, path, poses, sag_of(found[0], poses))


def sag_of(found: list[Hold], poses: FloatArray) -> float:
    """Return the largest distance [rad] of a joint at rest from its pose (k, n)."""
    return max(
        min(float(np.abs(hold.position - pose).max()) for hold in found) for pose in poses)
