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

"""
The analysis of one recording as a task: files are written, and figures come back.

What comes back are arrays and words alone, so that it can be kept (`result_store`), sent from
another process, and merged with that of other recordings.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.analysis.arm_recording import AnalysisSettings
from robot_dynamics.analysis.bag_analysis import analyze_recording, BagAnalysis, LimitUse
from robot_dynamics.analysis.batch import Configuration
from robot_dynamics.analysis.report import write_report
from robot_dynamics.analysis.residual import ResidualStatistics
from robot_dynamics.analysis.result_store import Result
from robot_dynamics.analysis.sample_files import write_csv, write_parquet, write_terms
from robot_dynamics.analysis.summary import facts

REPORT, PICTURE, TABLE, PARQUET, TERMS = (
    'report.html', 'report.png', 'samples.csv', 'samples.parquet', 'terms')
OUTPUTS = {
    REPORT: write_report, TABLE: write_csv, PARQUET: write_parquet, TERMS: write_terms}
"""What can be written, by the name that it gets; PICTURE comes with the report."""
_STATISTICS = ('rms_measured', 'mean_measured', 'rms', 'mean', 'largest')
_LIMITS = ('effort', 'velocity', 'position')


def task_configuration(settings: AnalysisSettings, outputs: Sequence[str] = ()) -> dict[str, Any]:
    """Return what `analyze_task` needs to know, for all recordings; `outputs` as in OUTPUTS."""
    return {
        'urdf': settings.urdf, 'topic': settings.topic,
        'joint_map': [list(pair) for pair in settings.joint_map], 'cutoff_hz': settings.cutoff_hz,
        'parameters': dict(settings.parameters), 'outputs': list(outputs)}


def analyze_task(
    bag: Path, configuration: Configuration, on_step: Callable[[str], None] = lambda _: None,
) -> Result:
    """
    Analyse a recording, and write what is asked for into `configuration['directory']`.

    `on_step` hears of the STEPS of `bag_analysis` and of each output when it is done.
    Raises RobotDynamicsError as `analyze_recording`, and OSError.
    """
    analysis = analyze_recording(bag, AnalysisSettings(
        configuration['urdf'], configuration['topic'],
        tuple((a, b) for a, b in configuration['joint_map']), configuration['cutoff_hz'],
        configuration['parameters']), on_step)
    written = []
    if configuration['outputs']:
        directory = Path(configuration['directory'])
        directory.mkdir(parents=True, exist_ok=True)
        for name in configuration['outputs']:
            OUTPUTS[name](analysis, directory / name)
            written += [str(directory / each) for each in (
                (REPORT, PICTURE) if name == REPORT else (name,))]
            on_step(name)
    return _as_result(analysis, written)


def outputs_exist(bag: Path, result: Result) -> bool:
    """Tell whether all files that a kept result wrote are still there."""
    return all(Path(path).exists() for path in result['written'])


def _as_result(analysis: BagAnalysis, written: list[str]) -> Result:
    arm, statistics = analysis.arm, analysis.statistics
    result: Result = {
        'facts': [list(row) for row in facts(analysis)],
        'losses': list(analysis.recording.losses), 'remarks': list(analysis.recording.remarks),
        'written': written, 'arm': arm.name, 'joint_names': list(arm.joint_names),
        'joint_kinds': list(arm.joint_kinds), 'samples': len(analysis.motion.stamps_ns),
        'counted': int(analysis.motion.usable.sum()), 'is_measured': statistics is not None}
    result |= {f'limit_{name}': getattr(analysis.limit_use, name) for name in _LIMITS}
    if statistics is not None:
        result |= {name: getattr(statistics, name) for name in _STATISTICS}
    return result


def statistics_of(result: Result) -> ResidualStatistics | None:
    """Return the residual of a task's result; None where nothing was measured."""
    if not result['is_measured']:
        return None
    return ResidualStatistics(
        tuple(result['joint_names']), int(result['counted']),
        *(np.asarray(result[name]) for name in _STATISTICS))


def limit_use_of(results: Sequence[Result]) -> LimitUse:
    """Return the use of the limits in all of some results, of the same joints."""
    effort, velocity, position = (
        np.array([result[f'limit_{name}'] for result in results]) for name in _LIMITS)
    return LimitUse(
        np.asarray(effort.max(axis=0)), np.asarray(velocity.max(axis=0)),
        np.asarray(position.min(axis=0)))
