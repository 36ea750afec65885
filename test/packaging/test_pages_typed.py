# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The shell blocks of README and tutorial, typed word for word in a fresh clone, in turn.

The home directory is new; pip and uv use their caches. A node gets a separate terminal, and ends
with Ctrl-C. `test_pages_run.py` compares results with what the pages state.
"""

from collections.abc import Mapping
from contextlib import ExitStack
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import NamedTuple

import pytest
from typed_terminal import Terminal, terminal

ROOT = Path(__file__).resolve().parents[2]
PART = re.compile(r'^#+ ([^\n]*)$|^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r'^\S(?:.*\\\n)*.*$', re.MULTILINE)
NODE = re.compile(r'\b(dynamics_node|simulated_arm|dynamics_monitor)\b')
READY = r"Model '|Waiting for a URDF"
UNTIL_INTERRUPT = {'ros2 dynamics watch': 'joint1', 'ros2 dynamics record': r'\w'}
"""Commands that end with Ctrl-C, each with what it prints first."""
NEED_ROS2CLI = ('ros2 service', 'ros2 launch')
"""Commands that end with status 1 and name ros2cli."""
ELSEWHERE = 'rosdep install'
"""`test_rosdep.py` runs it: it needs the index of ROS packages."""
WITHOUT_ENVIRONMENT = ('Without ROS', 'Only the libraries')
"""Sections whose terminals have nothing of the clone at first."""
KEPT = re.compile(r'LANG|OPENBLAS_\w+|(PIP|UV|SSL|REQUESTS|FAST(DDS|RTPS)|ROS_(AUTO|DOM))\w+')

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(not (ROOT / '.git').exists() or shutil.which('git') is None,
                       reason='there is no clone, or no git'),
    pytest.mark.skipif(Path('/opt/ros/jazzy').exists(), reason='commands of ros2cli do not end')]


class Section(NamedTuple):
    """A heading of a page with the commands of its blocks, and the files that it shows by name."""

    heading: str
    commands: list[str]
    files: dict[str, str]


def sections(page: Path) -> list[Section]:
    found: list[Section] = []
    for heading, language, text in PART.findall(page.read_text(encoding='utf-8')):
        if heading:
            found.append(Section(heading, [], {}))
        elif language == 'bash':
            found[-1].commands.extend(COMMAND.findall(text))
        elif named := re.match(r'# (\w+\.\w+)\n', text):
            found[-1].files[named[1]] = text
    return found


@pytest.fixture(scope='module')
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp('fresh') / 'clone'
    subprocess.run(['git', 'clone', '-q', ROOT, directory], check=True)
    (directory.parent / 'home').mkdir()
    return directory


@pytest.fixture
def environment(clone: Path) -> Mapping[str, str]:
    """Return variables for terminals, without those of the environment in which tests run."""
    path = [part for part in os.environ['PATH'].split(os.pathsep)
            if not Path(part).is_relative_to(sys.prefix)]
    cache = Path.home() / '.cache'
    return {
        'UV_CACHE_DIR': str(cache / 'uv'), 'PIP_CACHE_DIR': str(cache / 'pip'),
        **{name: value for name, value in os.environ.items() if KEPT.fullmatch(name)},
        'PATH': os.pathsep.join(path), 'HOME': str(clone.parent / 'home')}


class Typist:
    """Types commands in one terminal of a directory, and nodes in others."""

    def __init__(self, directory: Path, environment: Mapping[str, str], *prepared: str) -> None:
        self._terminals = ExitStack()
        self._new = directory, environment
        self._prepared = list(prepared)
        """Commands that each terminal gets first."""
        self._nodes: dict[str, Terminal] = {}
        self._first = self._open()

    def __enter__(self) -> 'Typist':
        self._terminals.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._terminals.close()

    def _open(self) -> Terminal:
        opened = self._terminals.enter_context(terminal(*self._new))
        for command in self._prepared:
            assert opened.type(command) == 0, opened.printed()
        return opened

    def type(self, command: str) -> None:
        """Type a command of a page, and check how it ends."""
        start = ' '.join(command.split()[:3])
        if node := NODE.search(command):
            self._start_node(node[1], command)
        elif start in UNTIL_INTERRUPT:
            self._first.start(command, UNTIL_INTERRUPT[start])
            assert self._first.interrupt() == 0, self._first.printed()
        elif not start.startswith(ELSEWHERE):
            refused = start.startswith(NEED_ROS2CLI)
            assert self._first.type(command) == refused, self._first.printed()
            assert ('needs ros2cli' in self._first.printed()) == refused
            if start.startswith('source '):
                self._prepared.append(command)

    def _start_node(self, name: str, command: str) -> None:
        if name in self._nodes:
            self._end(name)
        self._nodes[name] = self._open()
        self._nodes[name].start(command, READY)

    def _end(self, name: str) -> None:
        node = self._nodes.pop(name)
        assert node.interrupt() == 0, node.printed()

    def end_nodes(self) -> None:
        for name in list(self._nodes):
            self._end(name)


def test_the_commands_of_readme(clone, environment):
    """Each section begins with new terminals in the clone."""
    count = 0
    for section in sections(clone / 'README.md'):
        if not section.commands:
            continue
        bare = section.heading in WITHOUT_ENVIRONMENT
        prepared = () if bare else ('source scripts/activate',)
        with Typist(clone, environment, *prepared) as typist:
            for command in section.commands:
                typist.type(command)
            typist.end_nodes()
        count += len(section.commands)
    assert count > 25
    assert (clone / 'my_recording').is_dir()


def test_the_commands_of_the_tutorial(clone, environment):
    directory, count = clone.parent / 'home' / 'tutorial', 0
    directory.mkdir()
    with Typist(directory, environment, f'source {clone}/scripts/activate') as typist:
        for section in sections(clone / 'docs' / 'tutorial.md'):
            for name, text in section.files.items():
                (directory / name).write_text(text, encoding='utf-8')
            for command in section.commands:
                typist.type(command)
            count += len(section.commands)
            typist.end_nodes()
    assert count > 10
    assert (directory / 'identified' / 'identified.yaml').is_file()
