# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The samples of an analysis as files: a table (CSV or Parquet) and a recording of the terms."""

from collections.abc import Mapping
import csv
from pathlib import Path

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.dependencies import optional
from robot_dynamics.model.arm import ArmModel
from robot_dynamics_tools.analysis.bag_analysis import BagAnalysis
from robot_dynamics_tools.analysis.motion_filter import FilteredMotion
from robot_dynamics_tools.recordings.messages import joint_state_messages, stamped_messages
from robot_dynamics_tools.recordings.topics import DYNAMICS_TERMS, JOINT_STATE
from robot_dynamics_tools.recordings.writer import RecordingWriter, remove_recording

TERMS_TOPIC, RESIDUAL_TOPIC = '/dynamics/terms', '/dynamics_monitor/residual'
Column = FloatArray | IntArray | BoolArray


def sample_columns(analysis: BagAnalysis) -> dict[str, Column]:
    """
    Return the samples by the names of their columns, (m,) each, units in the names.

    The first two are the stamp, and whether the sample counts. A joint's columns begin with its
    name: `shoulder_pan_joint.position [rad]`.
    """
    motion = analysis.motion
    return {
        'stamp [ns]': motion.stamps_ns, 'counts': motion.usable,
        **motion_columns(analysis.arm, motion, {
            'measured': analysis.measured, 'model': analysis.terms.effort,
            'residual': analysis.residual, **analysis.terms.by_name}),
        'kinetic_energy [J]': analysis.terms.kinetic_energy,
        'potential_energy [J]': analysis.terms.potential_energy}


def motion_columns(
    arm: ArmModel, motion: FilteredMotion, efforts: Mapping[str, FloatArray | None],
) -> dict[str, FloatArray]:
    """Return time, motion and the efforts (m, n) that are not None, as `sample_columns`."""
    columns: dict[str, FloatArray] = {'time [s]': motion.times}
    for j, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_kinds)):
        unit, effort_unit = ('m', 'N') if kind == 'prismatic' else ('rad', 'N m')
        columns[f'{name}.position [{unit}]'] = motion.position[:, j]
        columns[f'{name}.velocity [{unit}/s]'] = motion.velocity[:, j]
        columns[f'{name}.acceleration [{unit}/s^2]'] = motion.acceleration[:, j]
        for what, values in efforts.items():
            if values is not None:
                columns[f'{name}.{what} [{effort_unit}]'] = values[:, j]
    return columns


def write_csv(columns: Mapping[str, Column], path: Path) -> None:
    """Write one line per sample, after the names of the columns (m,) each; raise OSError."""
    with path.open('w', encoding='utf-8', newline='') as file:
        csv.writer(file, lineterminator='\n').writerow(columns)
        np.savetxt(file, np.rec.fromarrays(list(columns.values())), [
            '%.10g' if column.dtype.kind == 'f' else '%d' for column in columns.values()], ',')


def write_parquet(columns: Mapping[str, Column], path: Path) -> None:
    """Write columns as Parquet; raise OSError, MissingDependencyError without pyarrow."""
    pyarrow, parquet = optional('pyarrow', 'Parquet'), optional('pyarrow.parquet', 'Parquet')
    parquet.write_table(pyarrow.table(dict(columns)), path)


def write_terms(analysis: BagAnalysis, directory: Path) -> None:
    """
    Write a recording of the model's terms, and of the residual, on the original stamps.

    Topics are those of `dynamics_node`. A recording of this name that this function wrote before
    is replaced. Raises RecordingError if the directory contains anything else.
    """
    remove_recording(directory)
    motion, terms, names = analysis.motion, analysis.terms, analysis.arm.joint_names
    written = {(TERMS_TOPIC, DYNAMICS_TERMS): stamped_messages(
        DYNAMICS_TERMS, motion.stamps_ns, {
            **terms.by_name, 'external': np.zeros_like(terms.gravity), 'effort': terms.effort,
            'kinetic_energy': terms.kinetic_energy, 'potential_energy': terms.potential_energy},
        joint_names=list(names))}
    if analysis.residual is not None:
        written[RESIDUAL_TOPIC, JOINT_STATE] = joint_state_messages(
            motion.stamps_ns, names, effort=analysis.residual)
    with RecordingWriter(directory) as writer:
        for (topic, kind), messages in written.items():
            writer.add_topic(topic, kind)
            for stamp, message in zip(motion.stamps_ns.tolist(), messages):
                writer.write(topic, stamp, message)
