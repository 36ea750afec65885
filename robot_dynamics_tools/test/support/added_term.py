# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A second Stribeck peak, F₂ exp(−(v/v₂)²) sgn v, as a new term of friction, and what it changes.

`extended_package` makes the package as it is after a change of one module: `friction_terms` with
the object below. This module is a program that uses the extended package and prints what it finds.
"""

import json
from pathlib import Path
import sys

import robot_dynamics
from simulated_arms import released

MODULE = 'joints/friction_terms.py'
NEW_TERM = """

SECOND_PEAK = FrictionTerm(DRY_FRICTION, (
    ParameterField(
        'peak', _EFFORT, 0.0, 0.0, 1e6, 'Second Stribeck peak F_2 {unit}', 'peak',
        omitted='the second Stribeck peak F_2'),
    ParameterField(
        'peak_velocity', _VELOCITY, 0.3, 1e-6, 1e3,
        'Velocity v_2 {unit}, over which the second Stribeck peak decreases', 'peak velocity',
        ('peak',), range=4.0, candidates=(0.1, 0.3)),
), dry=lambda f, v: f.peak * stribeck_curve(v, f.peak_velocity))

TERMS = (*TERMS, SECOND_PEAK)
"""
COULOMB, PEAK, VELOCITY = 1.0, 2.0, 0.3
SPEEDS = [-0.6, -0.15, 0.05, 0.3]
PARAMETERS = {
    'joints': ['joint1', 'joint2'], 'friction.coulomb': [COULOMB], 'friction.peak': [PEAK]}


def extended_package(folder: Path) -> None:
    """Link the package into a folder, but for the module of the terms, which has one more."""
    package = Path(robot_dynamics.__file__).parent
    for source, target in ((package, folder / 'robot_dynamics'),
                           (package / 'joints', folder / 'robot_dynamics/joints')):
        target.unlink(missing_ok=True)
        target.mkdir()
        for path in source.iterdir():
            if path.name != '__pycache__':
                (target / path.name).symlink_to(path)
    module = folder / 'robot_dynamics' / MODULE
    module.unlink()
    module.write_text((package / MODULE).read_text(encoding='utf-8') + NEW_TERM, encoding='utf-8')


def _findings() -> dict[str, object]:
    from arm_motions import fourier_motion
    from identification_bench import changed_arm, recorded, rigid_effort
    import numpy as np
    from robot_dynamics.model.arm import load_arm
    from robot_dynamics.model.arm_dynamics import ArmDynamics
    from robot_dynamics.model.arm_parameters import arm_from_parameters
    from robot_dynamics.model.effort_deviation import EffortDeviation, make_uncertainty
    from robot_dynamics.planar.urdf import default_arm_urdf
    from robot_dynamics.ros.parameters.robot_description import FRICTION_SPECS
    from robot_dynamics.simulation.arm_simulation import ArmSimulation
    from robot_dynamics_tools.identification.friction_regressor import COLUMN_NAMES, joint_columns
    from robot_dynamics_tools.identification.identified_arm import parameter_values
    from robot_dynamics_tools.identification.pipeline import identify
    from robot_dynamics_tools.identification.summary import friction_rows
    from robot_dynamics_tools.identification.written_uncertainty import uncertainty_values
    from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf

    bare = load_arm(default_arm_urdf())
    arm = arm_from_parameters(default_arm_urdf(), PARAMETERS)
    dynamics, friction = ArmDynamics(arm), arm.friction
    v, zero = np.column_stack([SPEEDS, SPEEDS]), np.zeros(2)
    moving = np.array([0.15, -0.15])
    effort = dynamics.inverse_dynamics(zero, moving, np.array([0.3, 0.4]))

    def simulated(torque: float) -> ArmSimulation:
        simulation = released(arm.with_gravity((0.0, 0.0, 0.0)), zero)
        simulation.step(np.array([torque, 0.0]), 0.5)
        return simulation

    slips, uncertain = simulated(1.001 * (COULOMB + PEAK)), make_uncertainty(
        arm, ['peak(joint2)'], [1.0])
    assert uncertain is not None
    q = np.zeros_like(v)
    columns = joint_columns(arm.joint_kinds, q, v, q, q)
    states = fourier_motion(bare, 100.0, 30.0)
    true = PEAK * np.exp(-(states.v / VELOCITY)**2) * np.sign(states.v)
    found = identify(bare, [recorded(
        bare, states, rigid_effort(changed_arm(bare, 0.2), states, 0.1) + true + 0.5 * states.v,
        0.1)])
    written = parameter_values(bare, found.models.consistent)
    return {
        'effort': friction.effort(v)[:, 0].tolist(),
        'forward': dynamics.forward_dynamics(zero, moving, effort).tolist(),
        'tracking': friction.tracking_effort(v, q)[:, 0].tolist(),
        'at_rest': friction.at_rest.static.tolist(),
        'sticks_at': simulated(0.999 * (COULOMB + PEAK)).q.tolist(),
        'slips_to': slips.q.tolist(),
        'energy_error': slips.work - slips.heat - slips.energy[0],
        'energy': slips.work,
        'column': columns[:, 0, COLUMN_NAMES.index('peak 0.3')].tolist(),
        'deviation': EffortDeviation(dynamics, uncertain)(zero, moving, zero).tolist(),
        'export': arm_to_mjcf(arm),
        'written': {name: values for name, values in written.items() if 'peak' in name},
        'uncertain': uncertainty_values(found)['uncertainty.parameters'],
        'reported': friction_rows(found)[0],
        'declared': {spec.name: spec.description for spec in FRICTION_SPECS},
    }


if __name__ == '__main__':
    sys.path.append(str(Path(__file__).parent))
    print(json.dumps(_findings()))
