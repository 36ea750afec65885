# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Snippets of the pages run with the files that the page itself provides, in the order of the page.

Python and the tools of the library are run. Commands that start nodes, need other programs of ROS
or draw are only checked for the files that they read. test_pages_run.py runs
the others.
"""

import doctest
from importlib import import_module
from pathlib import Path
import re
import shlex
from typing import Any, NamedTuple

import pytest
from recordings import KnownMotion, write_recording

ROOT = Path(__file__).resolve().parents[3]
README = ROOT / 'README.md'
PAGES = [README, *sorted((ROOT / 'docs').rglob('*.md'))]
FENCE = re.compile(r'^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
NAMED = re.compile(r'(?:# |<!-- )([\w.]+)(?: -->)?\n')
FILE = re.compile(r'(?<![\w./$-])[\w./-]+\.(?:urdf|xacro|yaml|xml|py|mcap)(?![\w.])')
RECORDING = re.compile(r'[a-z]\w*(/\w+)*')
PLACEHOLDER = re.compile(r'[A-Z]{2,}(\.\w+)?…?')
TOOLS = ('planar_urdf', 'check_model', 'excite', 'analyze', 'identify', 'export_mjcf')
DESCRIBED = {'simulation.md': {'panda.urdf'}}
"""Files of other packages that a page names."""
READ_RECORDINGS = ('analyze', 'identify', 'animate', '--replay', 'play')


class Block(NamedTuple):
    """A snippet of a page."""

    language: str
    text: str

    @property
    def file_name(self) -> str:
        """The name in the first line, under which the reader saves the block, or ''."""
        named = NAMED.match(self.text)
        return named[1] if named and self.language not in ('bash', 'sh') else ''

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command, without comments."""
        text = self.text.replace('\\\n', ' ')
        if self.language == '':
            text = '\n'.join(re.findall(r'^\$ (.*)', text, re.MULTILINE))
        elif self.language not in ('bash', 'sh'):
            return []
        lines = (shlex.split(line, comments=True) for line in text.splitlines())
        return [words for words in lines if words]


def blocks_of(page: Path) -> list[Block]:
    return [Block(*found) for found in FENCE.findall(page.read_text(encoding='utf-8'))]


def written_by(words: list[str]) -> list[str]:
    """Return the files and directories that a command writes."""
    written = [after for word, after in zip(words, words[1:])
               if word in ('-o', '--output', '--out', '>')]
    return [*written, words[-1]] if words[0] == 'cp' else written


def read_by(words: list[str]) -> list[str]:
    """Return the files and recordings that a command reads."""
    written = written_by(words)
    found = [path for word in words for path in FILE.findall(word) if path not in written]
    names = words[words.index('--joints'):] if '--joints' in words else []
    for tool in READ_RECORDINGS:
        if tool in words:
            found += [word for word in words[words.index(tool) + 1:]
                      if RECORDING.fullmatch(word) and word not in (*written, *names)]
    return found


def is_there(path: str, given: set[str]) -> bool:
    """Return whether a path is in these files and directories, or in the repository."""
    parents = {parent.as_posix() for parent in Path(path).parents}
    inside = path.rpartition('share/robot_dynamics/')[2].lstrip('/')  # after $(ros2 pkg prefix …)
    return bool({path, *parents} & given) or any(
        (folder / inside).exists()
        for folder in (ROOT, ROOT / 'launch', ROOT / 'robot_dynamics_tools' / 'launch'))


def page_id(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize('page', PAGES, ids=page_id)
def test_commands_read_only_files_that_the_page_provides(page):
    given = set(DESCRIBED.get(page.name, ()))
    for block in blocks_of(page):
        given.add(block.file_name)
        for words in block.commands:
            for word in words:
                assert not PLACEHOLDER.fullmatch(word), f'{words}: {word}'
            for path in read_by(words):
                assert is_there(path, given), f'{words}: the page does not provide {path}'
            given.update(written_by(words))


SLOW = ('excite', 'analyze', 'identify')
TUTORIAL = [words for block in blocks_of(ROOT / 'docs' / 'tutorial.md')
            for words in block.commands]
"""test_pages_run.py runs the slow tools; other pages run them only with other options."""
RUN_ELSEWHERE = ('gravity_calibration.md', 'simulation.md', 'tutorial.md')
RUN = [page for page in PAGES if page.name not in RUN_ELSEWHERE and any(
    block.language == 'python' or any(tool in words for words in block.commands for tool in TOOLS)
    for block in blocks_of(page))]


@pytest.mark.parametrize('page', RUN, ids=page_id)
def test_snippets_run_in_the_order_of_the_page(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {'__name__': '__main__'}
    for block in blocks_of(page):
        if block.file_name:
            (tmp_path / block.file_name).write_text(block.text, encoding='utf-8')
        for words in block.commands:
            run(words)
        if block.language == 'python' and '>>> ' not in block.text:
            exec(compile(block.text, page_id(page), 'exec'), names)
    if page.name == 'model_check.md':
        assert capsys.readouterr().out.splitlines()[-1].startswith('warning gravity_capability ')


@pytest.mark.parametrize(
    'page', [page for page in PAGES if '>>> ' in page.read_text(encoding='utf-8')], ids=page_id)
def test_examples_print_what_the_page_states(page):
    result = doctest.testfile(str(page), module_relative=False, encoding='utf-8')
    assert result.attempted > 0
    assert result.failed == 0


def options(command: list[str]) -> set[str]:
    return {word for word in command if word.startswith('-')}


def run(command: list[str]) -> None:
    """Run a command of the library; in place of a recorder, record a motion of the default arm."""
    written = written_by(command)
    tool, given = '', command
    if command[:3] == ['ros2', 'run', 'robot_dynamics']:
        tool, given = f'robot_dynamics.tools.{command[3]}', command[4:]
    elif command[:2] == ['ros2', 'dynamics']:
        tool, given = f'robot_dynamics_tools.commands.{command[2]}', command[3:]
    name = tool.rpartition('.')[2]
    if name in SLOW and any(
            name in words and options(command) <= options(words) for words in TUTORIAL):
        return
    if name in TOOLS and '>' not in command:
        assert import_module(tool).main(given) == 0, command
    elif written and ('--out' in command or command[:3] == ['ros2', 'bag', 'record']):
        path = Path(*written, 'recording') if '--out' in command else Path(*written)
        path.parent.mkdir(exist_ok=True)
        write_recording(path, KnownMotion().messages())
