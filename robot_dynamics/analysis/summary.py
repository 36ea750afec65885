# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The results of an analysis as rows of text, for the console and for the report."""

from collections.abc import Sequence

import numpy as np
from robot_dynamics.analysis.bag_analysis import BagAnalysis, LimitUse
from robot_dynamics.analysis.residual import ResidualStatistics
from robot_dynamics.reporting.text_table import percent

Rows = list[tuple[str, ...]]


def facts(analysis: BagAnalysis) -> Rows:
    """Return the facts of the comparison, with a name and a value in each row."""
    read, motion = analysis.recording, analysis.motion
    measured = [field for field in ('position', 'velocity', 'effort')
                if getattr(read.series, field) is not None]
    counted = int(motion.usable.sum())
    return [
        ('recording', str(read.path)),
        ('topic', f'{read.topic}, with {", ".join(measured)}'),
        ('arm', f'{read.arm.name}, {read.arm.joint_count} joints'),
        ('samples', f'{len(read.series.stamps_ns)} in {read.series.times[-1]:.2f} s at '
                    f'{motion.sample_rate_hz:.4g} Hz; {counted} used, without those near gaps '
                    'and ends'),
        ('filter', f'Butterworth, order 4, forward and backward, {motion.cutoff_hz:.3g} Hz: '
                   f'{motion.cutoff_reason}'),
    ]


def residual_rows(statistics: ResidualStatistics, joint_kinds: Sequence[str]) -> Rows:
    """Return the residual of each joint, after a row of titles."""
    rows: Rows = [(
        'joint', 'RMS measured', 'RMS residual', 'relative', 'mean residual', 'largest residual',
        'R²')]
    for j, (name, kind) in enumerate(zip(statistics.joint_names, joint_kinds)):
        unit = 'N' if kind == 'prismatic' else 'N·m'
        rows.append((
            name, f'{statistics.rms_measured[j]:.3f} {unit}', f'{statistics.rms[j]:.3f} {unit}',
            percent(statistics.relative[j]), f'{statistics.mean[j]:+.3f} {unit}',
            f'{statistics.largest[j]:.3f} {unit}', _number(statistics.r_squared[j])))
    return rows


def limit_rows(analysis: BagAnalysis) -> Rows:
    """Return the use of the limits at each joint, after a row of titles."""
    use, arm = analysis.limit_use, analysis.arm
    whose = 'measured' if analysis.measured is not None else 'model'
    return limit_use_rows(use, arm.joint_names, arm.joint_kinds, whose)


def limit_use_rows(
    use: LimitUse, joint_names: Sequence[str], joint_kinds: Sequence[str], whose: str,
) -> Rows:
    """Return rows of the use of limits; `whose` names the effort: measured or model."""
    rows: Rows = [(
        'joint', f'largest {whose} effort', 'largest velocity', 'margin to position limit')]
    for j, (name, kind) in enumerate(zip(joint_names, joint_kinds)):
        unit = 'm' if kind == 'prismatic' else 'rad'
        distance = use.position[j]
        rows.append((
            name, _of_limit(use.effort[j]), _of_limit(use.velocity[j]),
            'no limit' if np.isnan(distance) else f'{distance:.3f} {unit}'))
    return rows


def _of_limit(ratio: float) -> str:
    return 'no limit' if np.isnan(ratio) else f'{100.0 * ratio:.0f} % of limit'


def _number(value: float) -> str:
    return '-' if np.isnan(value) else f'{value:.3f}'
