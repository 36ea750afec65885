# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Write docs/evidence/model_check_robots.md: findings of the model check in example-robot-data.

Without an argument the script writes the page; with `--print` it only prints the table.
"""

from collections import Counter
from datetime import date
from importlib import metadata
from pathlib import Path
import sys

import numpy as np
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.worst_gravity import THOROUGH, worst_gravity
from robot_dynamics.model_check.checks import check_model, LARGEST_SURVEY
from robot_dynamics.model_check.finding import Finding
from robot_dynamics.model_check.mass_matrix_check import SMALLEST_INERTIA, survey_inertia
from robot_dynamics.model_check.mesh_bounds import MeshReader
from robot_dynamics.model_check.rotor_check import LARGEST_ACCELERATION

PACKAGE = 'example-robot-data'
PAGE = Path(__file__).parents[1] / 'evidence' / 'model_check_robots.md'
BEGIN, END = '<!-- table: begin -->\n', '<!-- table: end -->\n'
TEXT = """\
# Model check of published robots

Findings of the [model check](../model_check.md) in the robots of {package}.
`scripts/run python docs/tables/model_check.py` writes this page.
A test compares a row with the check; `scripts/test -m soak` compares all rows.

- *errors* and *warnings* are counts of findings per check.
- *gravity* is the largest share of an effort limit that holding the arm at rest needs in any
  position, with the joint.
- *effort limit / M_jj* is the largest effort limit divided by the smallest M_jj of the joint
  [rad/s²], with the joint, without prismatic joints. The check `rotors` warns above {rotors:g}.
- *condition* is the largest condition number of M(q). *singular (k)*: k joints move no mass.

Run of {date} with Pinocchio {pinocchio}.

"""
HEAD = (
    '| robot | joints | errors | warnings | gravity | effort limit / M_jj | condition |\n'
    '| --- | --- | --- | --- | --- | --- | --- |\n')


def robot_directory() -> Path:
    """Return the directory of the robots; raise PackageNotFoundError if it is not installed."""
    prefix = Path(str(metadata.distribution(PACKAGE).locate_file('cmeel.prefix')))
    return prefix / 'share' / PACKAGE / 'robots'


def table(directory: Path) -> str:
    """Return the table as markdown, followed by the list of the files that failed to load."""
    rows, refused = [], []
    paths = sorted(directory.rglob('*.urdf'))
    stems = Counter(path.stem for path in paths)
    for path in paths:
        name = path.stem
        if stems[name] > 1:
            name = f'{path.relative_to(directory).parts[0]}/{name}'
        try:
            rows.append(row(name, path))
        except ModelError as error:
            reason, _, _ = str(error).removeprefix('robot_description: ').partition(', expected')
            refused.append(f'- `{name}`: {reason}\n')
    return (
        f'{len(rows)} robots of {PACKAGE} {metadata.version(PACKAGE)}:\n\n{HEAD}{"".join(rows)}\n'
        f'Not loaded, and so not checked:\n\n{"".join(refused)}')


def row(name: str, path: Path) -> str:
    """Return the row of one robot; raise ModelError if its URDF cannot be loaded."""
    xml = path.read_text(encoding='utf-8')
    arm = load_arm(xml)
    findings = check_model(xml, arm, meshes=MeshReader(path.parent))
    return (
        f'| {name} | {arm.joint_count} | {_counts(findings, "error")} | '
        f'{_counts(findings, "warning")} | {_gravity(arm)} | {_acceleration(arm)} | '
        f'{_condition(arm)} |\n')


def _counts(findings: list[Finding], level: str) -> str:
    counts = Counter(finding.check for finding in findings if finding.level == level)
    return ', '.join(f'{check} {count}' for check, count in counts.items()) or '–'


def _gravity(arm: ArmModel) -> str:
    limit = arm.limits.effort
    if not np.isfinite(limit).any():
        return 'no limits'
    ratio = worst_gravity(arm, THOROUGH).effort / limit
    return f'{ratio.max():.2g} ({arm.joint_names[int(ratio.argmax())]})'


def _acceleration(arm: ArmModel) -> str:
    M_jj = survey_inertia(arm, LARGEST_SURVEY).diagonal
    judged = np.isfinite(arm.limits.effort) & (M_jj > SMALLEST_INERTIA) & (
        np.array(arm.joint_kinds) != 'prismatic')
    if not judged.any():
        return 'no limits'
    ratio = np.where(judged, arm.limits.effort, 0.0) / np.where(judged, M_jj, 1.0)
    return f'{ratio.max():.2g} ({arm.joint_names[int(ratio.argmax())]})'


def _condition(arm: ArmModel) -> str:
    M = survey_inertia(arm, LARGEST_SURVEY)
    if M.idle.any():
        return f'singular ({int(M.idle.sum())})'
    return f'{M.condition:.1e}' if M.is_definite else 'singular'


def main() -> None:
    """Write the page, or print the table."""
    text = table(robot_directory())
    if '--print' in sys.argv[1:]:
        print(text, end='')
        return
    head = TEXT.format(
        package=PACKAGE, date=f'{date.today():%Y-%m-%d}', pinocchio=metadata.version('pin'),
        rotors=LARGEST_ACCELERATION)
    PAGE.write_text(f'{head}{BEGIN}{text}{END}', encoding='utf-8')


if __name__ == '__main__':
    main()
