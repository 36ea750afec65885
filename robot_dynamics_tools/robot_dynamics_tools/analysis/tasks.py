# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The analysis of one recording as a task, which writes files and returns figures.

The result contains only arrays and plain values. It can be stored (`batch`), sent from
another process, and combined with the results of other recordings.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from robot_dynamics.model_check.html_page import Origin
from robot_dynamics.tools import command_line
from robot_dynamics_tools.analysis import bag_analysis, sample_files
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings
from robot_dynamics_tools.analysis.report import facts, write_report

REPORT, PICTURE, TABLE, PARQUET, TERMS = (
    'report.html', 'report.png', 'samples.csv', 'samples.parquet', 'terms')
_WRITERS = {TABLE: sample_files.write_csv, PARQUET: sample_files.write_parquet}
OUTPUTS = (REPORT, *_WRITERS, TERMS)
"""The file names of the possible outputs; PICTURE is written together with the report."""


@dataclass(frozen=True)
class AnalysisTask:
    """
    The settings of an analysis, and the `outputs` (see OUTPUTS) to write to `directory`.

    `origin` is what the report names; a stored result remains valid if it changes.
    """

    settings: AnalysisSettings
    outputs: tuple[str, ...] = ()
    directory: str = ''
    origin: Origin = field(default=Origin('', '', ''), compare=False)


@dataclass(frozen=True, eq=False)
class AnalysisResult:
    """
    The figures of the analysis of one recording.

    `facts` are rows of names and values, `counted` is the number of samples in the figures,
    `written` lists the paths of the outputs. `statistics` is None if no effort was measured.
    """

    facts: tuple[tuple[str, ...], ...]
    remarks: tuple[str, ...]
    written: tuple[str, ...]
    arm: str
    joint_names: tuple[str, ...]
    joint_kinds: tuple[str, ...]
    counted: int
    limit_use: bag_analysis.LimitUse
    statistics: bag_analysis.ResidualStatistics | None


def analyze_task(
    bag: Path, task: AnalysisTask, on_step: Callable[[str], None] = lambda _: None,
) -> AnalysisResult:
    """
    Analyse a recording, and write the outputs of the task.

    `on_step` is called with the STEPS of `bag_analysis` and of each output when it is done.
    Raises the errors of `analyze_recording`, and ToolError.
    """
    analysis = bag_analysis.analyze_recording(bag, task.settings, on_step)
    directory = Path(task.directory)
    written: list[str] = []
    for name in task.outputs:
        command_line.make_directory(directory)
        if name == REPORT:
            write_report(analysis, directory / name, task.origin)
        elif name == TERMS:
            sample_files.write_terms(analysis, directory / name)
        else:
            with command_line.writing(directory / name) as new:
                _WRITERS[name](sample_files.sample_columns(analysis), new)
        written += [str(directory / each) for each in (
            (REPORT, PICTURE) if name == REPORT else (name,))]
        on_step(name)
    arm, recording = analysis.arm, analysis.recording
    return AnalysisResult(
        tuple(facts(analysis)), recording.remarks, tuple(written), arm.name,
        arm.joint_names, arm.joint_kinds, int(analysis.motion.usable.sum()), analysis.limit_use,
        analysis.statistics)


def outputs_exist(bag: Path, result: AnalysisResult) -> bool:
    """Return whether all files that a stored result wrote still exist."""
    return all(Path(path).exists() for path in result.written)


def merged_limit_use(parts: Sequence[bag_analysis.LimitUse]) -> bag_analysis.LimitUse:
    """Return the use of the limits in several recordings of the same joints together."""
    return bag_analysis.LimitUse(
        np.max([part.effort for part in parts], axis=0),
        np.max([part.velocity for part in parts], axis=0),
        np.min([part.position for part in parts], axis=0))
