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

"""Friction that the controller knows of: how much better it tracks, without chatter."""

import numpy as np
from robot_dynamics.arm_model import ArmModel, load_arm
from robot_dynamics.control import make_gains
from robot_dynamics.controller import Controller, ControllerOptions
from robot_dynamics.friction import make_friction
from robot_dynamics.planar_urdf import default_arm_urdf
from robot_dynamics.reference_motion import make_reference_motion
from robot_dynamics.simulation import ArmSimulation

PERIOD = 2e-3
FRICTION = {
    'viscous': [2.0, 0.8], 'coulomb': [4.0, 1.5], 'static': [6.0, 2.0],
    'stribeck_velocity': [0.05, 0.05]}
ARM = load_arm(default_arm_urdf())


def with_friction(share: float) -> ArmModel:
    parameters = {
        name: value if name == 'stribeck_velocity' else [share * x for x in value]
        for name, value in FRICTION.items()}
    return ARM.with_friction(make_friction(ARM.joint_names, **parameters))


def run(known_share: float, seconds: float = 6.0, still: float = 0.0, noise: float = 0.0) -> (
        tuple[np.ndarray, np.ndarray]):
    """Return error and command, (samples, 2), of the default arm with friction in closed loop."""
    model = with_friction(known_share)
    motion = make_reference_motion(ARM, seconds).trajectory
    controller = Controller(model, ControllerOptions(make_gains(ARM.joint_names)))
    controller.follow(motion, 1)
    simulation = ArmSimulation(with_friction(1.0), motion.points[0].position)
    simulation.release()
    random = np.random.default_rng(0)
    errors, commands = [], []
    for k in range(int((seconds + still) / PERIOD)):
        q, v = simulation.state
        measured = v + noise * random.standard_normal(2)
        output = controller.update(1 + round(1e9 * k * PERIOD), q, measured)
        assert output.command is not None
        if output.reference is not None:
            errors.append(output.reference.position - q)
        commands.append(output.command)
        simulation.step(output.command, PERIOD)
    return np.array(errors), np.array(commands)


def rms(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt((errors**2).mean(axis=0)))


def test_known_friction_is_tracked_twenty_times_better() -> None:
    without, known = rms(run(0.0)[0]), rms(run(1.0)[0])
    print(f'RMS error without {without}, with {known}, ratio {without / known}')
    assert np.linalg.norm(without) >= 20.0 * np.linalg.norm(known)
    assert (without >= 10.0 * known).all()


def test_a_fifth_wrong_is_still_stable_and_better_than_nothing() -> None:
    without = rms(run(0.0)[0])
    for share in (0.8, 1.2):
        errors, _ = run(share)
        print(f'RMS error with {share:g} of the friction: {rms(errors)}')
        assert (rms(errors) < 0.5 * without).all()
        assert np.abs(errors).max() < 0.05


def test_compensation_does_not_chatter_at_rest() -> None:
    """The reference rests for two seconds; the measured velocity is noisy all the while."""
    _, commands = run(1.0, seconds=3.0, still=2.0, noise=2e-3)
    _, bare = run(0.0, seconds=3.0, still=2.0, noise=2e-3)
    rest = slice(-900, None)
    jumps = np.abs(np.diff(commands[rest], axis=0)).max(axis=0)
    without = np.abs(np.diff(bare[rest], axis=0)).max(axis=0)
    # what is added for friction does not add jumps to those of the noisy feedback
    assert (jumps < 1.5 * without + 0.05).all()
    assert (jumps < np.array(FRICTION['coulomb'])).all()
