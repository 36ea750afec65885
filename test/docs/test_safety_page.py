# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Figures in docs/safety.md and the pages it leads to; tests in docs/evidence/fault_tests.md."""

from collections.abc import Iterator
import json
from pathlib import Path
import re
import sys

import children
from diagnostic_msgs.msg import DiagnosticArray
import fault_table
from fault_table import Row, rows_of_page
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control import setpoint_stream
from robot_dynamics.control.safety import effort_limiter, supervisor
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody
from robot_dynamics.monitoring import state_plausibility, velocity_estimate
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros import running
from robot_dynamics.ros.dynamics import command_output
from robot_dynamics.ros.dynamics.parameters import SAFETY_SPECS, SPECS
from robot_dynamics.ros.middleware import message_bytes
from robot_dynamics.ros.parameters import robot_description
from robot_dynamics.urdf import document, parser
from robots import robot_urdf
from ros_harness import DYNAMICS, NodeProcess

DOCS = Path(__file__).parents[2] / 'docs'
TESTS = Path(__file__).parents[1]
PAGES = ('safety.md', 'command.md', 'joint_states.md', 'gains.md', 'reference/diagnostics.md')
TEXT = ''.join(
    (DOCS / name).read_text(encoding='utf-8') for name in PAGES)
PROSE = ' '.join(TEXT.split())
"""The text with single spaces, whatever its line breaks."""
FAULT_TESTS = fault_table.PAGE.read_text(encoding='utf-8')
COLLECTION_TIMEOUT = 300.0
"""[s] to import all the tests."""


def tables() -> Iterator[list[dict[str, str]]]:
    """Yield each table of the page as rows of cells by heading."""
    for block in re.findall(r'(?:^\|.*\n)+', TEXT, re.MULTILINE):
        lines = [[cell.strip() for cell in line.strip('|').split('|')]
                 for line in block.splitlines()]
        yield [dict(zip(lines[0], cells)) for cells in lines[2:]]


def quoted_defaults() -> list[tuple[str, str]]:
    """Return parameters and their defaults on the page; `[]` for a default without a literal."""
    return [
        (row['parameter'].strip('`'), [*re.findall('`([^`]*)`', row['default']), '[]'][0])
        for table in tables() for row in table if row.get('parameter') and 'default' in row]


# --- the faults ----------------------------------------------------------------------------------

@pytest.fixture(scope='module')
def collected(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory,
) -> list[tuple[str, str, str]]:
    """Return group, injected and expected of each fault test of the suite."""
    if [Path(argument).resolve() for argument in request.config.args] == [TESTS]:
        return [(row.group, row.injected, row.expected)
                for row in request.config.stash[fault_table.COLLECTED]]
    file = tmp_path_factory.mktemp('faults') / 'faults.json'
    result = children.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', '-p', 'no:cacheprovider',
         '-m', 'fault', '--list-faults', str(file), str(TESTS)],
        capture_output=True, text=True, timeout=COLLECTION_TIMEOUT)
    assert result.returncode == 0, result.stdout + result.stderr
    return [tuple(row) for row in json.loads(file.read_text(encoding='utf-8'))]


def test_the_table_has_every_fault_of_the_suite_and_no_other(collected):
    listed = [(row.group, row.injected, row.expected) for row in rows_of_page()]
    assert listed, 'the table is empty: scripts/test -m fault --write-fault-table writes it'
    assert sorted(listed) == sorted(collected)


def test_every_row_has_a_result_none_failed_and_the_readme_states_their_number():
    rows = rows_of_page()
    assert not [row for row in rows if '**failed**' in row.seen or not row.seen]
    readme = (DOCS.parent / 'README.md').read_text(encoding='utf-8')
    assert f'each of {len(rows)} injected faults' in ' '.join(readme.split())


def test_rows_written_to_the_page_are_read_back(tmp_path, monkeypatch):
    page = tmp_path / 'fault_tests.md'
    page.write_text(FAULT_TESTS, encoding='utf-8')
    monkeypatch.setattr(fault_table, 'PAGE', page)
    rows = [Row('One', 'a', 'b', 'as expected'), Row('Two', 'a, b', '`c`', 'not run: no network'),
            Row('One', 'c', 'd', '**failed**')]
    for _ in range(2):  # also over an existing table
        fault_table.write_page(rows)
        assert fault_table.rows_of_page() == [rows[0], rows[2], rows[1]]
    before = FAULT_TESTS.split(fault_table.BEGIN)[0]
    assert page.read_text(encoding='utf-8').startswith(before)


def test_words_of_faults_fit_into_a_table(collected):
    assert collected
    for words in collected:
        for cell in words:
            assert re.fullmatch(r'(?=\S)[^|\n]*\S', cell), repr(cell)


# --- the figures ---------------------------------------------------------------------------------

def test_every_default_that_is_quoted_is_that_of_the_node():
    defaults = {spec.name: spec.default for spec in SPECS}
    quoted = quoted_defaults()
    assert len(quoted) >= 6
    for name, default in quoted:
        value = defaults[name]
        assert default == (str(value).lower() if isinstance(value, bool) else str(value)), name


def test_every_parameter_of_safety_is_explained():
    for spec in SAFETY_SPECS:
        assert f'`{spec.name}' in TEXT, spec.name
        for choice in spec.choices:
            assert f'`{choice}`' in TEXT or f'`{spec.name}: {choice}`' in TEXT, choice


@pytest.mark.parametrize(('words', 'value'), [
    ('of which at most {:g} s count', effort_limiter.LONGEST_STEP),
    ('every {:.0f} ms', 1e3 * command_output.ACTION_PERIOD),
    ('after {} valid states without a contradiction', state_plausibility.CONTRADICTION),
    ('{} such states in a row', {5: 'five'}[state_plausibility.CONFIRMATIONS]),
    ('({:g} s without it) from one state to the next', state_plausibility.JUMP),
    ('After {:.0f} s without a plausible state', state_plausibility.LONGEST_GAP),
    ('further than {:g} rad (m)', state_plausibility.PLAY),
    ('{:g} times the distance at its velocity limit', state_plausibility.SPEED_FACTOR),
    ('{} or more set-points form a stream', {5: 'Five'}[setpoint_stream.STREAM_LENGTH]),
    ('Stamps within {} of the clock of this computer',
     {3600.0: 'an hour'}[state_plausibility.SAME_CLOCK]),
    ('Stamps before {} are simulated time', {1e9: 2001}[state_plausibility.SIMULATED_BEFORE]),
    ('the positions over {:g} ms', 1e3 * velocity_estimate.SPAN),
    ('topic | {:,} bytes', message_bytes.LARGEST_MESSAGE),
    ('points of a trajectory | {:,}', message_bytes.MOST_POINTS),
    ('`robot_description` | {:,} bytes', document.LARGEST_DESCRIPTION),
    ('{} links', parser.MOST_LINKS),
    ('{} joints in use', robot_description.MOST_JOINTS),
    ('{:.0f} GiB', running.MEMORY_LIMIT / 2**30),
])
def test_figures_that_are_no_parameters(words, value):
    assert words.format(value) in PROSE


def growth_of_velocity(arm: ArmModel, q: FloatArray, rate: float, seconds: float) -> float:
    """Return the time constant [s] with which |v| grows under sampled g(q), without friction."""
    body = UncheckedRigidBody(arm)
    step, substeps = 1.0 / (16.0 * rate), 16
    v = np.full(len(q), 1e-9)
    speeds = []
    for _ in range(round(rate * seconds)):
        hold = body.gravity(q)
        for _ in range(substeps):
            v = v + step * body.forward_dynamics(q, v, hold)
            q = q + step * v
        speeds.append(np.linalg.norm(v))
    half = len(speeds) // 2
    return seconds / 2.0 / float(np.log(speeds[-1] / speeds[half - 1]))


@pytest.mark.parametrize(('urdf', 'q'), [
    (default_arm_urdf, [0.5, 0.5]),
    (lambda: robot_urdf('ur10'), [0.0, -1.57, 0.0, 0.0, 0.0, 0.0])])
def test_sampled_gravity_compensation_is_unstable_as_the_page_states(urdf, q):
    stated = {2: 'of ([0-9.]+) s \\(default arm', 6: 'of ([0-9.]+) s \\(UR10'}[len(q)]
    found = re.search(stated, PROSE)
    measured = growth_of_velocity(load_arm(urdf()), np.array(q), 30.0, 10.0)
    assert measured == pytest.approx(float(found[1]), rel=0.15)


def test_every_fault_action_and_mode_is_there():
    for words in (*supervisor.FAULT_ACTIONS, *supervisor.Mode):
        name = words if isinstance(words, str) else words.value
        assert name in TEXT, name


# --- the diagnostics -----------------------------------------------------------------------------

def test_the_diagnostics_are_those_of_a_running_node(client):
    table, = (rows for rows in tables() if 'values' in rows[0])
    documented = {
        row['status'].strip('`'): re.findall('`([^`]*)`', row['values']) for row in table}
    with NodeProcess(DYNAMICS, namespace='/page'):
        report = client.wait_for(
            DiagnosticArray, '/diagnostics',
            lambda message: len(message.status) >= len(documented))
    for status in report.status:
        name = status.name.removeprefix('/page/dynamics: ')
        figures = documented.pop(name)
        assert {value.key for value in status.values} <= set(figures), name
    assert not documented
