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
`~/estimate_payload` on `dynamics` and `simulated_arm` in lock-step: loads that only the arm has.

The friction of the simulated arm differs from that of the model by up to 30 %, its measured
efforts have noise, and the controller compensates gravity without the load: the arm sags. Each
case is a load of up to 5 kg, at standstill (poses approached from both directions) or in motion.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
import tempfile
import time
from typing import Any, NamedTuple

from benchmarks.lock_step import StampReader
from benchmarks.processes import bench_node, DYNAMICS, node_command, running, SIMULATED_ARM
from benchmarks.safe_motion_cases import arm_named, description_of
import numpy as np
from rclpy.node import Node
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.load_regressor import load_parameters
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model.rigid_body import RigidBody
from robot_dynamics.ros.conversions import payload_to_ros, trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics_interfaces.srv import EstimatePayload, SetPayload
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

LINKS = {'ur10': 'tool0', 'panda': 'panda_hand', 'xarm7': 'link7', 'default': 'tool0'}
"""The link that carries the load, by the name of the arm."""
KINDS = ('standstill', 'motion')
NODES, LOADS = 2, 2
"""Starts of the nodes per arm, each with another friction, and loads per start and kind."""
RATE = 250.0
"""Joint states per second."""
FREQUENCY = 30.0
"""Natural frequency [rad/s] of the control law."""
COULOMB, VISCOUS, FRICTION_ERROR = 0.01, 0.005, 0.3
"""Friction of the model relative to the effort limits, and its largest relative error."""
NOISE = 0.01
"""Standard deviation of the measured efforts relative to the smallest effort limit."""
LARGEST_MASS = 5.0
LARGEST_SHARE = 0.7
"""Largest share of the effort limits that gravity needs in a pose."""
POSES, SIDE, MOVE, APPROACH, HOLD = 6, 0.2, 2.0, 1.0, 1.5
"""Poses, distance of their approach [rad], durations [s] of both moves and of a hold."""
SECONDS, STEP = 20.0, 0.1
"""Duration of a motion, and the interval between its points [s]."""
FIRST_MOVE = 3.0
"""[s] to the first pose."""
SETTLING = 1.0
"""[s] after the end of a trajectory."""
TIMEOUT = 60.0
NORMAL = 1.96


class Result(NamedTuple):
    """The truth and the estimate of m, mx, my, mz, deviations and verdicts (4,)."""

    arm: str
    kind: str
    truth: FloatArray
    values: FloatArray
    deviations: FloatArray
    is_observable: FloatArray

    @property
    def errors(self) -> FloatArray:
        return self.values - self.truth


class Bench:
    """A client of both nodes."""

    def __init__(self, node: Node) -> None:
        self._node, self._states = node, StampReader(node)
        self._trajectories = node.create_publisher(
            JointTrajectoryMsg, 'dynamics/joint_trajectory', 1)
        self._stamp = self._states.after(SETTLING)[0]

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """Return the response of a service; raise RuntimeError if it has no success."""
        client = self._node.create_client(service_type, name)
        if not client.wait_for_service(TIMEOUT):
            raise TimeoutError(f'no service {name} in {TIMEOUT:g} s')
        future, deadline = client.call_async(request), time.monotonic() + TIMEOUT
        while not future.done():
            if time.monotonic() > deadline:
                raise TimeoutError(f'no response of {name} in {TIMEOUT:g} s')
            time.sleep(1e-3)
        response = future.result()
        self._node.destroy_client(client)
        if not response.success:
            raise RuntimeError(f'{name}: {response.message}')
        return response

    def wait(self, seconds: float) -> None:
        """Wait for simulated time to pass."""
        self._stamp = self._states.after(self._stamp)[0]
        end = self._stamp + seconds
        while self._stamp < end:
            self._stamp = self._states.after(self._stamp)[0]

    def follow(self, trajectory: JointTrajectory) -> None:
        """Make the arm follow a trajectory; return at its end."""
        while self._trajectories.get_subscription_count() == 0:
            time.sleep(0.01)
        self._trajectories.publish(trajectory_to_ros(trajectory))
        self.wait(trajectory.duration + SETTLING)


def main() -> None:
    """Print accuracy and coverage per arm and kind of motion."""
    start, results = time.monotonic(), list[Result]()
    for name in LINKS:
        for seed in range(NODES):
            results += _with_nodes(name, seed)
    print(f'{len(results)} loads of 0 to {LARGEST_MASS:g} kg in '
          f'{time.monotonic() - start:.0f} s of wall time')
    print('| arm | motion | loads | mean error of m [g] | m in 2 % or 20 g | '
          'm c in 1 cm × m | observable | in 95 % intervals |')
    print('| --- | --- | --: | --: | --: | --: | --: | --: |')
    for name in LINKS:
        for kind in KINDS:
            print(_row(name, kind, [
                one for one in results if (one.arm, one.kind) == (name, kind)]))
    print(_row('all', 'both', results))


def _row(name: str, kind: str, results: Sequence[Result]) -> str:
    error = np.array([one.errors for one in results])
    mass = np.array([one.truth[0] for one in results])
    known = np.array([one.is_observable for one in results])
    ratio = np.array([one.errors / one.deviations for one in results])
    is_near = np.abs(error[:, 0]) <= np.maximum(0.02 * mass, 0.02)
    is_central = (np.abs(error[:, 1:]) <= 0.01 * mass[:, None]) | ~np.isfinite(ratio[:, 1:])
    inside = np.abs(ratio) <= NORMAL
    has_effect = np.array([np.isfinite(one.deviations) for one in results])
    return (f'| {name} | {kind} | {len(results)} | {1e3 * error[:, 0].mean():+.0f} | '
            f'{is_near.mean():.0%} | {is_central.all(axis=1).mean():.0%} | '
            f'{known.all(axis=1).mean():.0%} | '
            f'{inside[has_effect].mean():.1%} of {has_effect.sum()} |')


def _with_nodes(name: str, seed: int) -> list[Result]:
    """Return the results of one start of the nodes."""
    rng = np.random.default_rng([seed, *name.encode()])
    arm, results = arm_named(name), []
    with _nodes(name, arm, rng), bench_node() as node:
        bench = Bench(node)
        for _ in range(LOADS):
            for kind in KINDS:
                load = _load(name, rng)
                trajectory = _holds(arm, load, rng) if kind == KINDS[0] else (
                    _motion(arm, load, rng))
                results.append(_estimated(bench, name, kind, load, trajectory))
    return results


def _estimated(
    bench: Bench, name: str, kind: str, load: Payload, trajectory: JointTrajectory,
) -> Result:
    bench.follow(make_trajectory(
        trajectory.joint_names, [FIRST_MOVE], [trajectory.points[0].position], (), (),
        trajectory.joint_names))
    bench.call(SetPayload, 'simulated_arm/set_payload', SetPayload.Request(
        payload=payload_to_ros(load)))
    bench.wait(SETTLING)
    bench.call(EstimatePayload, 'dynamics/estimate_payload', EstimatePayload.Request(
        start=True, link=load.link))
    bench.follow(trajectory)
    answer = bench.call(EstimatePayload, 'dynamics/estimate_payload', EstimatePayload.Request(
        stop=True))
    least = 0.9 * trajectory.duration
    if answer.duration < least:
        raise RuntimeError(f'{name}: {answer.duration:.1f} s estimated, expected {least:.1f} s')
    return Result(
        name, kind, load_parameters(load)[:4], np.array(answer.values[:4]),
        np.array(answer.deviations[:4]),
        np.array([one in ('observable', 'no effect') for one in answer.verdicts[:4]]))


@contextmanager
def _nodes(name: str, arm: ArmModel, rng: np.random.Generator) -> Iterator[None]:
    """Run both nodes; the friction of the simulated arm differs from that of the model."""
    limit, n = arm.limits.effort, arm.joint_count
    change = rng.uniform(1.0 - FRICTION_ERROR, 1.0 + FRICTION_ERROR, (2, n))
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory, 'arm.urdf')
        path.write_text(description_of(name), encoding='utf-8')
        common = {'robot_description_file': path, 'joints': list(arm.joint_names)}
        model, true = ({
            'friction.viscous': (VISCOUS * limit * one).tolist(),
            'friction.coulomb': (COULOMB * limit * other).tolist()}
            for one, other in (np.ones((2, n)), change))
        with running({
                'dynamics': node_command(DYNAMICS, {
                    **common, **model, 'effort_check': False, 'state_timeout': TIMEOUT,
                    'overspeed_factor': 10.0, 'following_error_limit': [0.0],
                    'gains.natural_frequency': [FREQUENCY]}),
                'simulated_arm': node_command(SIMULATED_ARM, {
                    **common, **true, 'lock_step': True, 'rate': RATE,
                    'initial_position': _start(arm).tolist(), 'seed': int(rng.integers(1000)),
                    'effort_noise': float(NOISE * limit.min())})}):
            yield


def _load(name: str, rng: np.random.Generator) -> Payload:
    """Return a box of up to LARGEST_MASS; in the plane of the motion of the default arm."""
    mass, half, com = rng.uniform(0.0, LARGEST_MASS), rng.uniform(0.03, 0.1, 3), (
        rng.uniform(-0.1, 0.1, 3))
    if name == 'default':
        com[1] = 0.0
    inertia = mass / 3.0 * np.diag(half @ half - half**2)
    return make_payload(LINKS[name], mass, com, inertia)


def _range(arm: ArmModel) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper bound (n,) of poses, away from the limits."""
    low, high = np.maximum(arm.limits.lower, -2.5), np.minimum(arm.limits.upper, 2.5)
    return low + 0.2 * (high - low), high - 0.2 * (high - low)


def _start(arm: ArmModel) -> FloatArray:
    low, high = _range(arm)
    return 0.5 * (low + high)


def _pose(arm: ArmModel, load: Payload, rng: np.random.Generator) -> FloatArray:
    """Return a pose (n,) whose gravity the drives can hold."""
    body = RigidBody(arm.with_payloads([load]))
    low, high = _range(arm)
    while True:
        pose = rng.uniform(low, high)
        if (np.abs(body.gravity(pose)) <= LARGEST_SHARE * arm.limits.effort).all():
            return np.asarray(pose)


def _holds(arm: ArmModel, load: Payload, rng: np.random.Generator) -> JointTrajectory:
    """Return poses, each approached from both directions of all joints."""
    times, positions, t = list[float](), list[FloatArray](), 0.5
    for _ in range(POSES):
        pose = _pose(arm, load, rng)
        for side in (SIDE, -SIDE):
            for position, duration in (
                    (pose + side, MOVE), (pose, APPROACH), (pose, HOLD)):
                before = positions[-1] if positions else position
                t += max(duration, _shortest_move(arm, position - before))
                times.append(t)
                positions.append(position)
    zero = np.zeros_like(positions)
    return make_trajectory(
        arm.joint_names, times, positions, zero, (), arm.joint_names)


def _shortest_move(arm: ArmModel, distance: FloatArray) -> float:
    """Return the duration [s] of a move within 75 % of the velocity limits."""
    return float(2.5 * (np.abs(distance) / arm.limits.velocity).max())


def _motion(arm: ArmModel, load: Payload, rng: np.random.Generator) -> JointTrajectory:
    """Return sines from a pose towards the middle of the range, that begin and end at rest."""
    pose, t = _pose(arm, load, rng), np.arange(round(SECONDS / STEP) + 1) * STEP
    turns = rng.integers(4, 9, (2, arm.joint_count))  # per SECONDS
    phase = 2.0 * np.pi * turns[:, None, :] * t[:, None] / SECONDS
    rate = 2.0 * np.pi * turns[:, None, :] / SECONDS
    inwards = np.where(pose < _start(arm), 1.0, -1.0)
    size = rng.uniform(0.15, 0.3, (2, 1, arm.joint_count)) * inwards
    return make_trajectory(
        arm.joint_names, t + 0.5, pose + (size * (1.0 - np.cos(phase))).sum(axis=0),
        (size * rate * np.sin(phase)).sum(axis=0), (), arm.joint_names)
