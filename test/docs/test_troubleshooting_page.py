# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""The messages that docs/troubleshooting.md quotes are texts of the programs."""

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / 'docs' / 'troubleshooting.md').read_text(encoding='utf-8')
NAMES = {'state_timeout'}
"""Quoted names of faults, which are checked with the safety page."""


def test_each_quoted_message_is_in_the_code():
    code = '\n'.join(file.read_text(encoding='utf-8') for file in (
        ROOT / 'setup.py', *(ROOT / 'robot_dynamics').rglob('*.py')))
    cells = [line.split(' | ')[0] for line in PAGE.splitlines() if line.startswith('| ')]
    quoted = {text for cell in cells for text in re.findall('`([^`]+)`', cell)} - NAMES
    assert len(quoted) > 12
    assert not {text for text in quoted if text not in code}
