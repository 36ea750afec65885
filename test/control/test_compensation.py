# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Friction compensation with known parameters: improvement of the tracking, no chatter."""

from typing import NamedTuple

from controller_bench import update
import numpy as np
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.quintics import quintic_via_points
from simulated_arms import released

PERIOD = 2e-3
FRICTION = {
    'viscous': [2.0, 0.8], 'coulomb': [4.0, 1.5], 'static': [6.0, 2.0],
    'stribeck_velocity': [0.05, 0.05]}
ARM = load_arm(default_arm_urdf())


def with_friction(fraction: float) -> ArmModel:
    parameters = {
        name: value if name == 'stribeck_velocity' else [fraction * x for x in value]
        for name, value in FRICTION.items()}
    return ARM.with_friction(make_friction(ARM.joint_names, **parameters))


class Run(NamedTuple):
    """Error, command, friction compensation, measured and true velocity, (samples, 2) each."""

    error: np.ndarray
    command: np.ndarray
    friction: np.ndarray
    measured_velocity: np.ndarray
    velocity: np.ndarray


def run(
    known_fraction: float, seconds: float = 4.0, still: float = 0.0, velocity_noise: float = 0.0,
    position_noise: float = 0.0,
) -> Run:
    """Run the default arm with friction in closed loop: a motion, then a reference at rest."""
    model = with_friction(known_fraction)
    motion = quintic_via_points(
        ARM.joint_names, [0.0, 0.5 * seconds, seconds],
        [[0.785, 0.524], [1.585, 1.244], [0.785, 0.524]])
    controller = Controller(model, ControllerOptions(make_gains(ARM.joint_names)))
    update(controller, 1, motion.points[0].position, np.zeros(2))  # required before a trajectory
    controller.follow(motion, 1)
    simulation = released(with_friction(1.0), motion.points[0].position)
    random = np.random.default_rng(0)
    rows = []
    for k in range(int((seconds + still) / PERIOD)):
        q, v = simulation.state
        measured = v + velocity_noise * random.standard_normal(2)
        output = update(
            controller,
            1 + round(1e9 * k * PERIOD), q + position_noise * random.standard_normal(2), measured)
        rows.append(
            (output.reference.position - q, output.command, output.terms.friction, measured, v))
        simulation.step(output.command, PERIOD)
    return Run(*(np.array(column) for column in zip(*rows)))


def rms(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt((errors**2).mean(axis=0)))


def test_known_friction_is_tracked_twenty_times_better():
    without, known = rms(run(0.0).error), rms(run(1.0).error)
    print(f'RMS error without {without}, with {known}, ratio {without / known}')
    assert np.linalg.norm(without) >= 20.0 * np.linalg.norm(known)
    assert (without >= 10.0 * known).all()


REST = slice(-900, None)
"""The last 1.8 s of a run whose reference rests for the last 2 s."""
NOISE = {'position_noise': 1e-5, 'velocity_noise': 2e-3}


def sign_changes(friction: np.ndarray) -> list[int]:
    """Return the number of sign changes per column; zeros are ignored."""
    signs = [np.sign(column[column != 0.0]) for column in friction.T]
    return [int((np.diff(sign) != 0.0).sum()) for sign in signs]


def test_compensation_at_rest_does_not_chatter():
    """Under noise of both sensors the sign changes 0 times in 900 samples; sgn(v) 400 times."""
    noisy = run(1.0, seconds=3.0, still=2.0, **NOISE)
    naive = with_friction(1.0).friction.effort(noisy.measured_velocity[REST])
    print(f'sign changes of the compensation {sign_changes(noisy.friction[REST])}, '
          f'of the naive one on the same data {sign_changes(naive)}')
    assert sign_changes(noisy.friction[REST]) == [0, 0]
    assert min(sign_changes(naive)) > 400
    assert not noisy.velocity[REST].any()  # the arm stays at rest

