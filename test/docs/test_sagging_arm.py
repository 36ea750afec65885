# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""docs/sagging_arm.md from top to bottom: an arm that sags holds its position at the end."""

from pathlib import Path
import re

from page_commands import files_and_commands, final_errors, NODES, printed_by, run_page
import pytest

PAGE = Path(__file__).parents[2] / 'docs' / 'sagging_arm.md'

SAGS = 'ros2 run robot_dynamics dynamics move 1.0'


@pytest.mark.soak
def test_the_arm_sags_at_the_start_and_holds_at_the_end(tmp_path):
    page = PAGE.read_text(encoding='utf-8')
    printed = run_page(page, tmp_path, {SAGS: 1})
    assert {command[3] for command in files_and_commands(page)[1]} >= {'calibrate_gravity', *NODES}
    before, *_, after = [
        final_errors(out) for command, out in printed if ' dynamics move ' in command]
    assert len(before) == len(after) == 2
    assert max(map(abs, before)) > 0.015
    assert max(map(abs, after)) < 0.005
    out = printed_by(printed, 'ros2 run robot_dynamics calibrate_gravity')
    table = out.split('Torque at the joint')[1].split('\n\n')[0]
    scales = [float(scale) for scale in re.findall(r'^joint\d +(\S+)', table, re.MULTILINE)]
    assert scales == pytest.approx([0.8, 1.2], rel=0.02)
