# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a package of Python contains: its wheel, and the names and imports of its modules."""

import ast
from collections.abc import Sequence
from configparser import ConfigParser
from pathlib import Path
import shutil
import subprocess
import sys
from types import ModuleType
import zipfile


def unpacked_wheel(project: Path, folders: Sequence[str], directory: Path) -> Path:
    """Return the unpacked wheel that `pip install .` makes of a project with these folders."""
    source = directory / 'source'
    for name in folders:
        shutil.copytree(
            project / name, source / name, ignore=shutil.ignore_patterns('__pycache__'))
    for name in ('LICENSE', 'setup.py', 'setup.cfg', 'package.xml'):
        shutil.copy(project / name, source)
    subprocess.run(
        [sys.executable, 'setup.py', '-q', 'bdist_wheel', '--dist-dir', directory],
        cwd=source, check=True, capture_output=True)
    file, = directory.glob('*.whl')
    zipfile.ZipFile(file).extractall(directory / 'unpacked')
    return directory / 'unpacked'


def executables(wheel: Path) -> list[str]:
    """Return the names that an unpacked wheel puts on the PATH."""
    entries = ConfigParser()
    entries.optionxform = str  # type: ignore[assignment,method-assign]
    entries.read(next(wheel.glob('*.dist-info')) / 'entry_points.txt')
    return list(entries['console_scripts'])


def names_for_type_checkers(package: ModuleType) -> dict[str | None, str | None]:
    """Return the modules of the names that a package provides, as type checkers see them."""
    tree = ast.parse(Path(str(package.__file__)).read_text(encoding='utf-8'))
    block, = (node for node in tree.body if isinstance(node, ast.If))
    return {alias.asname: node.module for node in block.body
            if isinstance(node, ast.ImportFrom) for alias in node.names}


def imports_within(project: Path, folder: Path) -> dict[str, set[str]]:
    """Return the modules of a folder with those that each imports, also only for types."""
    name = '.'.join(folder.relative_to(project).parts)
    return {
        path.stem: {
            node.module.removeprefix(f'{name}.')
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith(f'{name}.')}
        for path in folder.glob('*.py') if path.name != '__init__.py'}
