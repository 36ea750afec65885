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

"""The notebook prints its stored output; each stored figure is drawn."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

import pytest
import robots

NOTEBOOK = Path(__file__).parents[2] / 'docs' / 'notebooks' / 'first_steps.ipynb'
CELLS = json.loads(NOTEBOOK.read_text(encoding='utf-8'))['cells']

# Executes the cells of the list on stdin in order; writes the output and figures of each as JSON.
RUNNER = """
from contextlib import redirect_stdout
import io
import json
import sys

import matplotlib.pyplot as plt

results, names = [], {'__name__': '__main__'}
for number, source in enumerate(json.load(sys.stdin)):
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(source, f'<code cell {number}>', 'exec'), names)
    results.append([printed.getvalue(), len(plt.get_fignums())])
    plt.close('all')
json.dump(results, sys.stdout)
"""


def test_it_is_a_notebook_of_format_4() -> None:
    nbformat = pytest.importorskip('nbformat')
    notebook = nbformat.read(NOTEBOOK, as_version=nbformat.NO_CONVERT)
    assert notebook.nbformat == 4
    nbformat.validate(notebook)


def test_the_cells_print_and_draw_what_is_stored(tmp_path: Path) -> None:
    robots.robot_path('ur5')  # skips without example-robot-data, whose UR5 the notebook loads
    cells = [cell for cell in CELLS if cell['cell_type'] == 'code']
    run = subprocess.run(
        [sys.executable, '-c', RUNNER],
        input=json.dumps([''.join(cell['source']) for cell in cells]), text=True,
        capture_output=True, cwd=tmp_path, timeout=300,
        env={**os.environ, 'MPLBACKEND': 'Agg'}, check=False)
    assert run.returncode == 0, run.stderr
    stored = [[stored_text(cell), stored_figures(cell)] for cell in cells]
    for cell, expected, actual in zip(cells, stored, json.loads(run.stdout), strict=True):
        assert actual == expected, ''.join(cell['source'])
    assert sum(figures for _, figures in stored) >= 2
    assert [cell['execution_count'] for cell in cells] == list(range(1, len(cells) + 1))


def test_links_lead_to_files() -> None:
    words = ''.join(
        ''.join(cell['source']) for cell in CELLS if cell['cell_type'] == 'markdown')
    targets = [link for link in re.findall(r'\]\(([^)#]+)', words) if '://' not in link]
    assert targets
    for target in targets:
        assert (NOTEBOOK.parent / target).is_file(), target


def stored_text(cell: dict[str, Any]) -> str:
    """Return the text that the cell printed; its only outputs are prints and figures."""
    assert all(
        output['output_type'] == 'display_data' or output.get('name') == 'stdout'
        for output in cell['outputs']), cell['outputs']
    return ''.join(
        ''.join(output['text']) for output in cell['outputs']
        if output['output_type'] == 'stream')


def stored_figures(cell: dict[str, Any]) -> int:
    return sum('image/png' in output.get('data', {}) for output in cell['outputs'])
