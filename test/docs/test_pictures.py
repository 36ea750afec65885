# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of the documentation: their contents agree with the code and with the pages."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def script(name):
    """Return a module of docs/pictures."""
    spec = importlib.util.spec_from_file_location(
        f'picture_{name}', ROOT / 'docs' / 'pictures' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_figure_of_the_architecture_names_existing_modules():
    modules = {path.stem for path in (ROOT / 'robot_dynamics').rglob('*.py')}
    named = {word for *_, words in script('architecture').BOXES for word in words.split()}
    assert named <= modules


def test_the_figure_of_the_growth_reads_the_table_of_the_page():
    growth = script('growth')
    page = ROOT / 'docs' / 'evidence' / 'benchmarks.md'
    found = growth.read_growth(page.read_text(encoding='utf-8'))
    assert found.joints[0] == 2
    assert found.joints[-1] == 60
    assert set(found.times) == set(growth.LOOKS)
    for times in found.times.values():
        assert len(times) == len(found.joints)
    fitted = found.start + found.slope * found.joints
    assert fitted == pytest.approx(found.times['inverse dynamics'], abs=0.3)
    with pytest.raises(ValueError, match='no table'):
        growth.read_growth('')
