# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""The samples of the test part of a recording, with the effort of the model, as a CSV file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from robot_dynamics.analysis.motion_filter import FilteredMotion
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Samples in rows: `values` (m, columns), with the names of the columns and their units."""

    columns: tuple[str, ...]
    values: FloatArray


def sample_table(
    arm: ArmModel, motion: FilteredMotion, model: FloatArray, rows: slice,
) -> SampleTable:
    """Return these rows of a motion; `model` (m, n) is the effort of a model along the motion."""
    assert motion.effort is not None
    columns, values = ['time [s]'], [motion.times[rows]]
    for j, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_kinds)):
        unit, effort = ('m', 'N') if kind == 'prismatic' else ('rad', 'N m')
        for title, column in (
                (f'position [{unit}]', motion.position), (f'velocity [{unit}/s]', motion.velocity),
                (f'acceleration [{unit}/s^2]', motion.acceleration),
                (f'measured [{effort}]', motion.effort), (f'model [{effort}]', model),
                (f'residual [{effort}]', motion.effort - model)):
            columns.append(f'{name}.{title}')
            values.append(column[rows, j])
    return SampleTable(tuple(columns), np.column_stack(values))


def write_samples(
    tables: Sequence[SampleTable | None], names: Sequence[str], directory: Path,
) -> list[Path]:
    """Write one file per table, named after its recording, and return their paths."""
    paths = []
    for number, (table, name) in enumerate(zip(tables, names)):
        if table is None:
            continue
        same = f'_{number}' if names.count(name) > 1 else ''
        paths.append(directory / f'test_samples_{name}{same}.csv')
        np.savetxt(
            paths[-1], table.values, fmt='%.9g', delimiter=',', header=','.join(table.columns),
            comments='', encoding='utf-8')
    return paths
