# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/mujoco_arm.md from top to bottom: a Panda in MuJoCo holds, moves and touches a table."""

from pathlib import Path
import shutil

from page_commands import final_errors, run_page
import pytest
from robots import robot_path

PAGE = Path(__file__).parents[2] / 'docs' / 'mujoco_arm.md'

TOUCH = 'ros2 run robot_dynamics dynamics move 0.0 0.35'


def test_the_panda_moves_and_touches_the_table(tmp_path):
    pytest.importorskip('mujoco')
    shutil.copy(robot_path('panda'), tmp_path / 'panda.urdf')
    printed = run_page(PAGE.read_text(encoding='utf-8'), tmp_path, {TOUCH: 1})
    moved, touched = [out for command, out in printed if ' dynamics move ' in command]
    assert len(final_errors(moved)) == len(final_errors(touched)) == 7
    assert max(map(abs, final_errors(moved))) < 0.04
    assert max(map(abs, final_errors(touched))) > 0.1  # the table is 4 cm above the goal
    assert 'a contact' in touched
