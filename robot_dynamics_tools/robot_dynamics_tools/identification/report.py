# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The files of an identification: URDF, parameters of the node, report and figures as JSON."""

from collections.abc import Mapping
import json
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.joints.friction import FRICTION_FIELDS
from robot_dynamics.model.effort_deviation import EFFORT_OFFSET
from robot_dynamics.model_check.html_page import Origin
from robot_dynamics.tools.command_line import make_directory, write_file
from robot_dynamics_tools.identification import identified_arm, summary
from robot_dynamics_tools.identification.bag_identification import BagIdentification
from robot_dynamics_tools.identification.friction_regressor import INERTIA
from robot_dynamics_tools.identification.page import identification_page
from robot_dynamics_tools.identification.pipeline import Identification
from robot_dynamics_tools.identification.steps import write_samples
from robot_dynamics_tools.identification.written_uncertainty import uncertainty_values
from robot_dynamics_tools.reporting.text_table import json_numbers

FILES = URDF, PARAMETERS, REPORT, FIGURES = (
    'identified.urdf', 'identified.yaml', 'report.html', 'report.json')


def write_identification(
    found: BagIdentification, urdf: str, directory: Path, given: Mapping[str, object],
    origin: Origin,
) -> list[Path]:
    """
    Write all files, and return their paths; `urdf` is the text that was identified.

    `given` are parameters to which the identified ones are added; the report names `origin`.
    Raises ToolError, ModelError if the URDF cannot represent the parameters,
    MissingDependencyError without matplotlib.
    """
    make_directory(directory)
    paths = [directory / name for name in FILES]
    arm, fit = found.identification.arm, found.identification.models.consistent
    gains = found.identification.gains
    gain = None if gains is None else gains.scale.tolist()
    identified = identified_arm.fitted_urdf(urdf, arm, fit)
    write_file(paths[0], identified)
    # the URDF itself, as a path would depend on the computer or on the working directory
    values = {**identified_arm.parameter_values(arm, fit, gain, given, found.seeks_stiffness),
              'robot_description': identified, **uncertainty_values(found.identification)}
    notes = file_notes(found.identification, urdf)
    write_file(paths[1], identified_arm.parameter_file(
        values, [*_head(found), *(['', *notes] if notes else [])]))
    write_file(paths[2], identification_page(found, origin))
    write_file(paths[3], json.dumps(as_data(found), indent=2) + '\n')
    tables = [recording.samples for recording in found.identification.recordings]
    return paths + write_samples(tables, [bag.stem for bag in found.bags], directory)


def file_notes(identification: Identification, urdf: str) -> list[str]:
    """Return what a user must know about the written files, in sentences."""
    arm, fit = identification.arm, identification.models.consistent
    notes = ['With command: none, the node publishes no effort until another command is set.']
    offsets = [
        f'{name} {offset:.3g}' for name, offset in zip(
            arm.joint_names, identified_arm.fitted_offset(fit)) if offset]
    if offsets:
        notes.append(
            f'The offset F_b of the measured effort, {", ".join(offsets)} (N·m or N), is '
            'effort.report_offset, and is not commanded. If the drive has it, set '
            'effort.command_offset, too.')
    kept = identified_arm.kept_fractions(urdf, arm, fit.parameters)
    if kept:
        listed = ', '.join(f'{link} {100.0 * share:.3g} %' for link, share in kept.items())
        notes.append(
            'The identified bodies are lighter than the links that are fixed to them in the URDF. '
            f'These links keep a part of their inertials: {listed}; the rest of the body is in '
            'the link that moves.')
    return notes


def _head(found: BagIdentification) -> list[str]:
    tests = found.identification.tests['consistent']
    ratios = ', '.join(f'{100.0 * ratio:.1f}' for ratio in tests.relative())
    return [
        f'Identified by `identify` from {", ".join(bag.name for bag in found.bags)}.',
        f'{summary.residual_title(found.identification)}, % of the effort, RMS: {ratios}.',
        '',
        '  ros2 run robot_dynamics dynamics_node --ros-args --params-file identified.yaml',
        '  ros2 run robot_dynamics simulated_arm --ros-args --params-file identified.yaml',
    ]


def as_data(found: BagIdentification) -> dict[str, Any]:
    """Return all figures as types of JSON."""
    identification = found.identification
    arm, estimate = identification.arm, identification.estimate
    models, gains = identification.models, identification.gains
    friction = identified_arm.fitted_friction(arm, models.consistent)
    parameters = [
        {'name': name, 'value': value, 'standard_deviation': deviation,
         'relative_deviation': relative}
        for name, value, deviation, relative in zip(
            estimate.names, estimate.values.tolist(), json_numbers(estimate.deviations),
            json_numbers(estimate.relative_deviations))]
    return {
        'arm': arm.name,
        'joints': list(arm.joint_names),
        'recordings': [str(bag) for bag in found.bags],
        'failed': {str(bag): error for bag, error in found.failed},
        'cutoff_hz': [each.motion.cutoff_hz for each in identification.recordings],
        'samples': {'train': identification.tests['base'].samples[0],
                    'test': identification.tests['base'].samples[1]},
        'residual': {
            model: {
                'train': json_numbers(test.relative('train')),
                'test': json_numbers(test.relative()),
                'test_by_sample': json_numbers(test.relative('test_by_sample')),
                'test_rms': json_numbers(test.rms())}
            for model, test in identification.tests.items()},
        'cross_validation': {
            'relative_residual': json_numbers(models.validated),
            'pull': models.problem.regularization},
        'rank': identification.base.rank,
        'condition_number': json_numbers([estimate.condition])[0],
        'base_parameters': [
            {**entry, 'is': identification.base.expressions[i], 'urdf': float(estimate.prior[i]),
             'excited': bool(estimate.excited[i])}
            for i, entry in enumerate(parameters[:estimate.base_count])],
        'is_cross_validated': identification.is_cross_validated,
        'active_bounds': [
            {'joint': arm.joint_names[j], **bound._asdict()}
            for j, bounds in summary.bounds_by_joint(identification).items() for bound in bounds],
        'not_separable': {
            joint: list(names) for joint, names in summary.not_separable(identification).items()},
        'joint_parameters': parameters[estimate.base_count:],
        'friction': [
            {'joint': name, 'structure': str(models.problem.structures[j]),
             'reflected_inertia': float(models.consistent.joint_values[j, INERTIA]),
             **{field.name: float(getattr(friction, field.name)[j])
                for field in FRICTION_FIELDS if field.heading},
             EFFORT_OFFSET: float(identified_arm.fitted_offset(models.consistent)[j])}
            for j, name in enumerate(arm.joint_names)],
        'inertial_parameters': models.consistent.parameters.reshape(-1, 10).tolist(),
        'drive_gain': None if gains is None else {
            'gain': json_numbers(gains.gain), 'deviation': json_numbers(gains.deviation),
            'deviation_by_noise': json_numbers(gains.noise),
            'is_known': gains.is_known.tolist(),
            'is_confounded_with_masses': gains.is_confounded.tolist()},
        'factor_to_urdf': np.exp(identification.difference).tolist(),
        'contradictions': summary.recording_lines(found, 'contradictions'),
        'warnings': summary.warnings(identification),
    }
