# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The set-up adapts the CMake files of wheels."""

import os
from pathlib import Path
import sys
import sysconfig

import children
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
HERE = (sysconfig.get_paths()['include'], np.get_include())


def export(python: str, numpy: str) -> str:
    return (
        'set_target_properties(a PROPERTIES\n'
        f'  INTERFACE_INCLUDE_DIRECTORIES "{python};{numpy};${{_IMPORT_PREFIX}}/include/python3"\n'
        ')\n')


def relocate(environment: Path) -> None:
    script = ROOT / 'scripts' / '_relocate_cmake.py'
    children.run([sys.executable, str(script), str(environment)], check=True)


def test_a_file_that_other_environments_share_is_replaced_and_not_changed(tmp_path):
    python = '/opt/python/cp312-cp312/include/python3.12'
    numpy = '/srv/other/.venv/lib/python3.11/site-packages/numpy/_core/include'
    cached, linked = tmp_path / 'cached.cmake', tmp_path / 'venv' / 'share' / 'a' / 'a.cmake'
    linked.parent.mkdir(parents=True)
    cached.write_text(export(python, numpy), encoding='utf-8')
    os.link(cached, linked)
    relocate(tmp_path / 'venv')
    assert linked.read_text(encoding='utf-8') == export(*HERE)
    assert cached.read_text(encoding='utf-8') == export(python, numpy)
    inode = linked.stat().st_ino
    relocate(tmp_path / 'venv')
    assert linked.stat().st_ino == inode
