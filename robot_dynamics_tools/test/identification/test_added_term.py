# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A term of friction that is added in one module acts everywhere; every term is complete.

The new term is a second Stribeck peak, F₂ exp(−(v/v₂)²) sgn v. This module is also the program
that uses the package with this term, and checks it.
"""

import os
from pathlib import Path
import sys

import children
from identification_bench import changed_arm, fourier_motion, recorded, rigid_effort
import numpy as np
import pytest
<<<<<<< HEAD:robot_dynamics_tools/test/identification/test_added_term.py
from robot_dynamics.joints.friction_terms import TERMS
from robot_dynamics_tools.identification.friction_regressor import columns_of


@pytest.fixture(scope='module')
def findings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what a program finds with the package that has a second Stribeck peak."""
    folder = tmp_path_factory.mktemp('extended')
    extended_package(folder)
    path = os.pathsep.join([
        str(folder), str(Path(children.__file__).parent), os.environ.get('PYTHONPATH', '')])
=======
import robot_dynamics
from robot_dynamics.identification.friction_regressor import (
    COLUMN_NAMES,
    columns_of,
    joint_columns,
)
from robot_dynamics.identification.identified_arm import parameter_values
from robot_dynamics.identification.pipeline import identify
from robot_dynamics.identification.summary import friction_rows
from robot_dynamics.identification.written_uncertainty import uncertainty_values
from robot_dynamics.joints.friction_terms import TERMS
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.effort_deviation import EffortDeviation, make_uncertainty
from robot_dynamics.model.mjcf import arm_to_mjcf
from robot_dynamics.planar.urdf import default_arm_urdf
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
SPEEDS = np.array([-0.6, -0.15, 0.05, 0.3])
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


def test_a_new_term_acts_everywhere(tmp_path):
    extended_package(tmp_path)
    path = os.pathsep.join([
        str(tmp_path), str(Path(children.__file__).parent), os.environ.get('PYTHONPATH', '')])
>>>>>>> cut:test/joints/test_added_term.py
    result = children.run(
        [sys.executable, __file__], env={**os.environ, 'PYTHONPATH': path}, cwd=tmp_path,
        capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize('term', TERMS, ids=lambda term: term.fields[0].name)
def test_a_term_has_a_column_and_a_counterpart_or_its_absence(term):
    names = [column.name for column in columns_of(term)]
    assert names
    assert all(names)
    for field in term.fields:
        assert field.needs or field.counterpart or field.omitted, field.name


# --- the program, with the new term --------------------------------------------------------------

def peak(v: np.ndarray) -> np.ndarray:
    """Return the new term by its formula."""
    return np.asarray(PEAK * np.exp(-(v / VELOCITY)**2) * np.sign(v))


def check_model_and_simulation(arm: ArmModel) -> None:
    dynamics, friction = ArmDynamics(arm), arm.friction
    v, zero = np.column_stack([SPEEDS, SPEEDS]), np.zeros(2)
    expected = COULOMB * np.sign(v) + peak(v)
    assert friction.effort(v) == pytest.approx(expected, rel=1e-12)
    # without an error of position, the compensation has tanh(v / 0.01) instead of the sign
    assert friction.tracking_effort(v, 0.0 * v) == pytest.approx(
        expected * np.abs(np.tanh(v / 0.01)), rel=1e-12)
    assert friction.at_rest.static.tolist() == [COULOMB + PEAK] * 2
    moving, a = np.array([0.15, -0.15]), np.array([0.3, 0.4])
    effort = dynamics.inverse_dynamics(zero, moving, a)
    assert dynamics.forward_dynamics(zero, moving, effort) == pytest.approx(a, rel=1e-9)
    for share, slips in ((0.999, False), (1.001, True)):
        simulation = released(arm.with_gravity((0.0, 0.0, 0.0)), zero)
        simulation.step(np.array([share * (COULOMB + PEAK), 0.0]), 0.5)
        assert (simulation.q[0] > 0.0) == slips
        assert simulation.work - simulation.heat == pytest.approx(
            simulation.energy[0], abs=1e-6 * simulation.work)


def check_uncertainty_export_and_parameters(arm: ArmModel) -> None:
    from robot_dynamics.ros.parameters.robot_description import FRICTION_SPECS
    deviation = EffortDeviation(
        ArmDynamics(arm), make_uncertainty(arm, ['peak(joint2)'], [1.0]))
    assert deviation(np.zeros(2), np.array([0.15, -0.15]), np.zeros(2)) == pytest.approx(
        [0.0, np.exp(-0.25)], rel=1e-12)
    export = arm_to_mjcf(arm)
    assert 'Without counterpart in MuJoCo: the second Stribeck peak F_2.' in export
    assert 'frictionloss="1.0"' in export
    declared = {spec.name: spec.description for spec in FRICTION_SPECS}
    assert declared['friction.peak'].startswith('Second Stribeck peak F_2 [N·m] or [N]; one value')
    assert declared['friction.peak_velocity'].endswith('If empty, 0.3.')


def check_identification(bare: ArmModel) -> None:
    v = np.column_stack([SPEEDS, SPEEDS])
    columns = joint_columns(bare.joint_kinds, 0.0 * v, v, 0.0 * v, 0.0 * v)
    assert columns[:, 0, COLUMN_NAMES.index('peak 0.3')] == pytest.approx(
        peak(SPEEDS) / PEAK, rel=1e-12)
    states = fourier_motion(bare, 100.0, 30.0)
    effort = rigid_effort(changed_arm(bare, 0.2), states, 0.1) + peak(states.v) + 0.5 * states.v
    found = identify(bare, [recorded(bare, states, effort, 0.1)])
    written = parameter_values(bare, found.models.consistent)
    assert written['friction.peak'] == pytest.approx([PEAK] * 2, rel=0.1)
    assert written['friction.peak_velocity'] == [VELOCITY] * 2
    assert 'peak' in friction_rows(found)[0]
    uncertain = set(uncertainty_values(found)['uncertainty.parameters'])
    assert uncertain & {'peak(joint1)', 'peak(joint2)', 'coulomb(joint1)'} == {
        'peak(joint1)', 'peak(joint2)'}


if __name__ == '__main__':
    extended = arm_from_parameters(default_arm_urdf(), PARAMETERS)
    check_model_and_simulation(extended)
    check_uncertainty_export_and_parameters(extended)
    check_identification(load_arm(default_arm_urdf()))
