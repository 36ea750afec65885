# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/evidence/pinocchio_notes.md: its code runs, and confirms the statements of the page."""

from pathlib import Path
import re
from typing import Any

import pinocchio
import pytest

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'evidence' / 'pinocchio_notes.md'


def test_the_reproduction_shows_the_energy_of_the_rotor_missing():
    code, = re.findall(r'```python\n(.*?)```', PAGE.read_text(encoding='utf-8'), re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(code, str(PAGE), 'exec'), names)
    assert names['by_mass_matrix'] == pytest.approx(1.5)
    if names['kinetic_energy'] == pytest.approx(1.5):
        pytest.skip(f'Pinocchio {pinocchio.__version__} counts all rotors: the workaround for the '
                    'kinetic energy in rigid_body.py can be removed')
    assert names['kinetic_energy'] == pytest.approx(1.0)
