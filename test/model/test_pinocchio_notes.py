# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/evidence/pinocchio_notes.md: its code runs, and confirms the statements of the page."""

from pathlib import Path
import re
from typing import Any

import numpy as np
import pinocchio
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.planar.urdf import planar_arm_urdf

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'evidence' / 'pinocchio_notes.md'


def reproduction() -> dict[str, Any]:
    """Run the code of the page and return its names."""
    code, = re.findall(r'```python\n(.*?)```', PAGE.read_text(encoding='utf-8'), re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(code, str(PAGE), 'exec'), names)
    return names


def test_the_reproduction_shows_the_energy_of_the_rotor_missing() -> None:
    names = reproduction()
    assert names['by_mass_matrix'] == pytest.approx(1.5)
    if names['kinetic_energy'] == pytest.approx(1.5):
        pytest.skip(f'Pinocchio {pinocchio.__version__} counts all rotors: the workaround for the '
                    'kinetic energy in rigid_body.py can be removed')
    assert names['kinetic_energy'] == pytest.approx(1.0)


@pytest.mark.parametrize('axis', ['0 1 0', '0 -1 0', '0.6 0.8 0'])
@pytest.mark.parametrize('kind', ['revolute', 'continuous', 'prismatic'])
def test_the_energy_of_a_rotor_is_ours_whatever_pinocchio_counts(kind: str, axis: str) -> None:
    urdf = planar_arm_urdf([2.0], [1.0], [0.5], [0.1]).replace(
        'xyz="0 1 0"', f'xyz="{axis}"').replace('"continuous"', f'"{kind}"').replace(
            '<limit ', '<limit lower="-1" upper="1" ')
    bare = load_arm(urdf)
    geared = bare.with_actuators(make_actuators(('joint1',), [1.0], [10.0], rotor_inertia=[0.01]))
    q, v = np.array([0.3]), np.array([2.0])
    energy = RigidBody(geared).kinetic_energy(q, v)
    assert energy - RigidBody(bare).kinetic_energy(q, v) == pytest.approx(0.5 * 1.0 * 4.0)
    assert RigidBody(geared).terms(q, v, v).kinetic_energy == pytest.approx(energy)
