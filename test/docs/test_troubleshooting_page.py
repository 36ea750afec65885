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


"""The messages that docs/troubleshooting.md quotes are texts of the programs."""

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / 'docs' / 'troubleshooting.md').read_text(encoding='utf-8')
NAMES = {'state_timeout'}
"""Quoted names of faults, which are checked with the safety page."""


def test_each_quoted_message_is_in_the_code() -> None:
    code = '\n'.join(file.read_text(encoding='utf-8') for file in (
        ROOT / 'setup.py', *(ROOT / 'robot_dynamics').rglob('*.py')))
    cells = [line.split(' | ')[0] for line in PAGE.splitlines() if line.startswith('| ')]
    quoted = {text for cell in cells for text in re.findall('`([^`]+)`', cell)} - NAMES
    assert len(quoted) > 12
    assert not {text for text in quoted if text not in code}
