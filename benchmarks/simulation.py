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

"""How fast an arm of seven joints is simulated without ROS, as a multiple of real time."""

import time

import numpy as np
import pinocchio as pin
from robot_dynamics.actuator import make_actuators
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import ArmModel, load_arm
from robot_dynamics.friction import make_friction
from robot_dynamics.planar_urdf import planar_arm_urdf
from robot_dynamics.simulation import ArmSimulation
from robot_dynamics.validation import FloatArray

JOINTS = 7
PERIOD = 2e-3
"""[s] between two efforts, and the longest step."""
SECONDS = 4.0
ROUNDS = 3
NATURAL_FREQUENCY, AMPLITUDE = 10.0, 0.3


def arms() -> dict[str, ArmModel]:
    """Return the same arm with more and more of what real joints have."""
    masses = 5.0 * 0.7**np.arange(JOINTS)
    lengths = np.full(JOINTS, 0.25)
    rigid = load_arm(planar_arm_urdf(
        masses, lengths, 0.5 * lengths, masses * lengths**2 / 12.0))
    names, strength = rigid.joint_names, 0.6**np.arange(JOINTS)
    friction = make_friction(
        names, 2.0 * strength, 3.0 * strength, 4.0 * strength, [0.05], 0.3 * strength)
    motor = {
        'torque_constant': [0.1], 'gear_ratio': [100.0], 'resistance': [0.5],
        'inductance': [5e-4], 'rotor_inertia': 4e-5 * strength, 'efficiency': [0.8],
        'current_limit': [40.0], 'voltage_limit': [48.0]}
    motors = make_actuators(names, **motor)
    loose = make_actuators(names, **motor, backlash=[1e-3])
    return {
        'rigid bodies': rigid,
        'and friction': rigid.with_friction(friction),
        'and motors': rigid.with_friction(friction).with_actuators(motors),
        'and backlash': rigid.with_friction(friction).with_actuators(loose),
    }


def times_real_time(arm: ArmModel) -> float:
    """Return how many seconds of motion a second of computing gives, efforts not counted."""
    simulation, dynamics = ArmSimulation(arm, max_step=PERIOD), ArmDynamics(arm)
    simulation.release()
    frequency = 2.0 * np.pi * (0.5 + 0.05 * np.arange(JOINTS))
    spent = 0.0
    for k in range(round(SECONDS / PERIOD)):
        tau = _effort(dynamics, frequency, k * PERIOD, *simulation.motor_state)
        start = time.perf_counter()
        simulation.step(tau, PERIOD)
        spent += time.perf_counter() - start
    return SECONDS / spent


def _effort(
    dynamics: ArmDynamics, frequency: FloatArray, t: float, q: FloatArray, v: FloatArray,
) -> FloatArray:
    """Return the computed torque that follows a sine at each joint."""
    phase = frequency * t
    wanted = AMPLITUDE * (1.0 - np.cos(phase))
    rate = AMPLITUDE * frequency * np.sin(phase)
    a = AMPLITUDE * frequency**2 * np.cos(phase) + (
        2.0 * NATURAL_FREQUENCY * (rate - v) + NATURAL_FREQUENCY**2 * (wanted - q))
    effort = dynamics.rigid_body.inverse_dynamics(q, v, a)
    return np.asarray(effort + dynamics.friction.smooth_effort(rate))


def bare_engine(arm: ArmModel) -> float:
    """Return the same for one aba a period with a step of Euler's method in numpy."""
    model = arm.engine
    data = model.createData()
    q, v, tau = np.zeros(JOINTS), np.zeros(JOINTS), np.zeros(JOINTS)
    steps = round(SECONDS / PERIOD)
    start = time.perf_counter()
    for _ in range(steps):
        v = v + PERIOD * pin.aba(model, data, q, v, tau)
        q = q + PERIOD * v
    return SECONDS / (time.perf_counter() - start)


def main() -> None:
    """Print the multiples, each the median of rounds in turn."""
    rows: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for name, arm in arms().items():
            rows.setdefault(name, []).append(times_real_time(arm))
        rows.setdefault('Euler with a bare aba', []).append(bare_engine(arms()['rigid bodies']))
    print(f'Simulated seconds a second, {JOINTS} joints, {1e3 * PERIOD:g} ms steps:')
    for name, values in rows.items():
        print(f'  {name:24}{np.median(values):8.1f}')


if __name__ == '__main__':
    main()
