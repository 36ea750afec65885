# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Each notebook prints its stored output and draws its figures; its numbers match theory."""

from contextlib import redirect_stdout
import io
import json
from math import exp, sqrt
from pathlib import Path
import re
from typing import Any

from matplotlib import rc_context
import matplotlib.pyplot as plt
import numpy as np
import pytest
import robots

SCRIPTS = Path(__file__).parents[3] / 'scripts'
NOTEBOOKS = sorted((SCRIPTS.parent / 'docs' / 'notebooks').glob('*.ipynb'))

# The parameters of the notebooks, and from them in closed form the numbers that they print.
F_V, F_C, F_S, V_S = 0.4, 0.8, 1.5, 0.1
K_T, RATIO, RESISTANCE, EFFICIENCY, VOLTAGE, INERTIA = 0.05, 100.0, 0.8, 0.8, 24.0, 0.6 + 0.2
TORQUE, HALF_GAP, MOTOR, LINK = 1.0, 0.01, 0.2, 0.6
REDUCED, APPROACH = MOTOR * LINK / (MOTOR + LINK), sqrt(2.0 * TORQUE * HALF_GAP / MOTOR)
CYCLE_AMPLITUDE, CYCLE_FREQUENCY = 25.7, 6.79
"""Limit cycle [mrad], [rad/s] by harmonic balance: docs/friction.md."""
CLOSED_FORMS = [
    ('friction', r' 0\.10 rad/s: library (\S+)', F_V * 0.1 + F_C + (F_S - F_C) * exp(-1.0), 1e-4),
    ('friction', r'stick takes +(\S+)', 2.0 * (F_S - F_C) / (20.0 * 0.2), 0.01),
    ('motors', r'no-load speed: .* = (\S+)', VOLTAGE / (RATIO * K_T), 0.01),
    ('motors', r'lift : current +(\S+)', 40.0 / (EFFICIENCY * RATIO * K_T), 0.01),
    ('motors', r'N = 200 .* to +(\S+) kg', 5.0 * 0.25 + 0.15 + 3.0 * 1.4**2 + 4.0, 0.01),
    ('motors', r'T_m = (\S+) ms',
     1e3 * RESISTANCE * INERTIA / (EFFICIENCY * (RATIO * K_T)**2), 0.1),
    ('backlash', r'hysteresis: (\S+) mrad', 4.0 * 10.0 * (30.0 - 10.0), 0.5),
    ('backlash', r'e = 0\.5: joint velocity (\S+)', 1.5 * REDUCED * APPROACH / LINK, 1e-3),
    ('backlash', r'e = 0\.0: .* heat (\S+) mJ, f', 1e3 * 0.5 * REDUCED * APPROACH**2, 0.01),
    ('backlash', r'cycle: amplitude (\S+)', CYCLE_AMPLITUDE, 0.05 * CYCLE_AMPLITUDE),
    ('backlash', r'balance .*, (\S+) rad/s', CYCLE_FREQUENCY, 0.1),
]


def code_cells(notebook: Path) -> list[dict[str, Any]]:
    cells = json.loads(notebook.read_text(encoding='utf-8'))['cells']
    return [cell for cell in cells if cell['cell_type'] == 'code']


@pytest.mark.parametrize('notebook', [pytest.param(
    path, id=path.stem, marks=pytest.mark.soak if path.stem == 'backlash' else ())
    for path in NOTEBOOKS])
def test_the_cells_print_and_draw_what_is_stored(notebook, tmp_path, monkeypatch):
    cells = code_cells(notebook)
    sources = [''.join(cell['source']) for cell in cells]
    if any('example-robot-data' in source for source in sources):
        robots.robot_path('ur5')  # skips without example-robot-data
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {'__name__': '__main__'}
    plt.switch_backend('Agg')
    with rc_context(), np.printoptions():
        for cell, source in zip(cells, sources, strict=True):
            with redirect_stdout(io.StringIO()) as printed:
                exec(compile(source, notebook.stem, 'exec'), names)
            assert printed.getvalue() == stored_text(cell), source
            assert len(plt.get_fignums()) == sum(
                'image/png' in output.get('data', {}) for output in cell['outputs']), source
            plt.close('all')
    assert [cell['execution_count'] for cell in cells] == list(range(1, len(cells) + 1))


@pytest.mark.parametrize(('name', 'pattern', 'expected', 'tolerance'), CLOSED_FORMS)
def test_printed_numbers_are_those_of_the_theory(name, pattern, expected, tolerance):
    path, = [path for path in NOTEBOOKS if path.stem == name]
    printed = ''.join(stored_text(cell) for cell in code_cells(path))
    found, = re.findall(pattern, printed)
    assert float(found) == pytest.approx(expected, abs=tolerance)


def stored_text(cell: dict[str, Any]) -> str:
    """Return the text that the cell printed; its only outputs are prints and figures."""
    assert all(
        output['output_type'] == 'display_data' or output.get('name') == 'stdout'
        for output in cell['outputs']), cell['outputs']
    return ''.join(
        ''.join(output['text']) for output in cell['outputs']
        if output['output_type'] == 'stream')
