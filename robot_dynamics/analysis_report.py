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

"""The report of an analysis: a picture, and one HTML page that needs no other file."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from robot_dynamics.analysis_words import facts, limit_rows, residual_rows
from robot_dynamics.bag_analysis import BagAnalysis
from robot_dynamics.plotting import (
    effort_panel,
    joint_figure,
    Panel,
    residual_panel,
    scatter_figure,
)
from robot_dynamics.validation import FloatArray

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem;
  color: #1a1a1a; background: #fff; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .8rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
th { border-bottom: 2px solid #888; }
.loss { border-left: 4px solid #d55e00; padding-left: .8rem; }
img { max-width: 100%; height: auto; }
.wide { overflow-x: auto; }
"""


def effort_figure(analysis: BagAnalysis) -> Any:
    """Return the figure of measured and model effort, and the model's by term."""
    arm, times, terms = analysis.arm, analysis.motion.times, analysis.terms
    panels: list[Panel] = []
    title = f'{arm.name}: effort of the model at the recorded motion'
    measured, residual = analysis.measured, analysis.residual
    if measured is not None and residual is not None:
        title = f'{arm.name}: measured effort beside that of the model at the recorded motion'
        panels.append(effort_panel('Measured and model', times, {
            'measured': _with_gaps(analysis, measured),
            'model': _with_gaps(analysis, terms.effort)}))
        panels.append(residual_panel(times, _with_gaps(analysis, residual)))
    by_term = {name: values for name, values in terms.by_name.items()
               if name != 'friction' or np.any(values)}
    panels.append(effort_panel('Model by term', times, {
        name: _with_gaps(analysis, values)
        for name, values in {**by_term, 'effort': terms.effort}.items()}))
    return joint_figure(title, arm.joint_names, arm.joint_kinds, panels)


def friction_figure(analysis: BagAnalysis) -> Any | None:
    """Return the figure of residual over velocity; None where nothing was measured."""
    if analysis.residual is None:
        return None
    arm, counts = analysis.arm, analysis.motion.usable
    return scatter_figure(
        'Residual over velocity: what depends on velocity alone looks like a line or a step',
        arm.joint_names, arm.joint_kinds, analysis.motion.velocity[counts],
        analysis.residual[counts])


def _with_gaps(analysis: BagAnalysis, values: FloatArray) -> FloatArray:
    """Return the values with NaN at the last sample before each gap, where lines break."""
    broken = values.copy()
    broken[:-1][np.diff(analysis.motion.segment) > 0] = np.nan
    return broken


def write_report(analysis: BagAnalysis, path: Path) -> None:
    """
    Write the page, and the picture of efforts beside it, under the same name as PNG.

    Raises OSError, MissingDependencyError without matplotlib.
    """
    efforts = _png(effort_figure(analysis))
    path.with_suffix('.png').write_bytes(efforts)
    scatter = friction_figure(analysis)
    path.write_text(
        _page(analysis, efforts, None if scatter is None else _png(scatter)), encoding='utf-8')


def _page(analysis: BagAnalysis, efforts: bytes, scatter: bytes | None) -> str:
    read = analysis.recording
    title = f'{read.path.name}: measured effort and model' if analysis.measured is not None else (
        f'{read.path.name}: effort of the model')
    body = [f'<h1>{escape(title)}</h1>', _table(facts(analysis), has_head=False)]
    if read.losses:
        body += ['<h2>What is lost</h2>', _list(read.losses, 'loss')]
    if read.remarks:
        body += ['<h2>Remarks</h2>', _list(read.remarks, '')]
    if analysis.statistics is not None:
        body += ['<h2>Residual: measured − model</h2>',
                 _table(residual_rows(analysis.statistics, analysis.arm.joint_kinds)),
                 '<p>relative: RMS of the residual by RMS of the measured effort; R²: share of '
                 'the variance that the model explains.</p>']
    body += ['<h2>Use of limits</h2>', _table(limit_rows(analysis))]
    body += ['<h2>Effort over time</h2>', _image(efforts, 'Measured and model effort')]
    if scatter is not None:
        body += ['<h2>Residual over velocity</h2>', _image(scatter, 'Residual over velocity')]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f'<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n'
        + '\n'.join(body) + '\n</body></html>\n')


def _table(rows: Sequence[Sequence[str]], has_head: bool = True) -> str:
    head = _row(rows[0], 'th') if has_head else ''
    body = ''.join(_row(row, 'td') for row in rows[has_head:])
    return f'<div class="wide"><table>{head}{body}</table></div>'


def _row(cells: Sequence[str], tag: str) -> str:
    return '<tr>' + ''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells) + '</tr>'


def _list(lines: Iterable[str], kind: str) -> str:
    return f'<ul class="{kind}">' + ''.join(f'<li>{escape(line)}</li>' for line in lines) + '</ul>'


def _image(png: bytes, what: str) -> str:
    encoded = b64encode(png).decode('ascii')
    return (f'<div class="wide"><img alt="{escape(what)}" '
            f'src="data:image/png;base64,{encoded}"></div>')


def _png(figure: Any) -> bytes:
    data = BytesIO()
    figure.savefig(data, format='png')
    return data.getvalue()
