# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The frame of every HTML report, and its figures with and without Bokeh."""

from pathlib import Path
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from report_page import ReportPage
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics_tools.reporting.figures import effort_panel, TimeBoundary
from robot_dynamics_tools.reporting.interactive import add_time_figures

VERDICTS = [
    Verdict('joint1', Grade.GOOD, 'residual 3 % < 10 %', 'use the model'),
    Verdict('joint2', Grade.BAD, 'friction dominates', 'run `identify`')]
COMMAND = "identify 'my bag' --urdf a.urdf"
ORIGIN = Origin('/robots/arm & hand.urdf', COMMAND, '1.2.3')
TWO = SimpleNamespace(joint_names=('turn', 'slide'), joint_kinds=('revolute', 'prismatic'))
"""Joints of an arm."""
TIMES = np.linspace(0.0, 2.0, 201)
PANEL = effort_panel('Measured and model', TIMES, {
    'measured': np.column_stack([np.sin(TIMES), np.cos(TIMES)]),
    'model': np.column_stack([np.sin(TIMES), np.zeros_like(TIMES)])})


def test_a_report_begins_with_the_verdicts_then_names_its_origin():
    report = Page('An arm', VERDICTS, 'Rule: 10 %.', ORIGIN)
    report.section('Details')
    text = report.html()
    page = ReportPage(text)
    places = [page.text.index(words) for words in (
        'Verdict on 2 joints: 1 good, 1 bad.', 'joint1', 'residual 3 % < 10 %', 'use the model',
        'joint2', 'friction dominates', 'Rule: 10 %.', '/robots/arm & hand.urdf',
        'identify, robot_dynamics 1.2.3',
        "identify 'my bag' --urdf a.urdf", 'Details')]
    assert places == sorted(places)
    assert re.search(r'date \d{4}-\d\d-\d\d \d\d:\d\d [+-]\d{4}', page.text)
    assert '<code>identify</code>' in text


def figures():
    """Return the scripts of a page, and its figures; check that the static one is returned."""
    page = Page('An arm', VERDICTS, 'Rule: 10 %.', ORIGIN)
    before = len(page._body)
    static = add_time_figures(
        page, TWO, 'title', [PANEL], 'what', TimeBoundary(1.0, 'left', 'right'))
    assert static.startswith(b'\x89PNG')
    added, = page._body[before:]
    return page._scripts, added


def test_markup_in_names_of_a_model_never_reaches_a_page():
    name = '</script><img src=x $\\frac$>'
    page = Page(name, [Verdict(name, Grade.GOOD, name, name)], name, Origin(name, name, name))
    page.items([name])
    arm = SimpleNamespace(joint_names=(name, name), joint_kinds=TWO.joint_kinds)
    add_time_figures(page, arm, name, [PANEL], name)
    assert '<img src=x' not in page.html()


def test_without_bokeh_the_static_figure_remains_with_the_command(monkeypatch):
    for name in ['bokeh', *(name for name in sys.modules if name.startswith('bokeh.'))]:
        monkeypatch.setitem(sys.modules, name, None)
    head, added = figures()
    assert head == ''
    assert added.startswith('<div class="static wide"><img alt="what"')
    assert 'install bokeh' in added
    assert sys.executable not in added  # no report contains a path of its machine


def test_the_setup_of_analyses_installs_what_reports_zoom_with():
    analysis = Path(__file__).parents[3] / 'requirements' / 'analysis.txt'
    assert re.search(r'^bokeh', analysis.read_text(encoding='utf-8'), re.MULTILINE)


def test_the_figures_contain_their_script_units_and_boundary():
    pytest.importorskip('bokeh', reason='needs the extra report')
    head, added = figures()
    page = ReportPage(f'<html><head>{head}</head><body>{added}</body></html>')
    assert page.is_complete
    assert 500_000 < len(head) < 2_000_000
    assert '<img alt="what"' in added
    texts = re.sub(r'\\+u00b7', '·', added)
    for words in ('effort [N·m]', 'effort [N]', 'slide', 'turn: Measured and model', 'left',
                  'right', 'time [s]'):
        assert words in texts
