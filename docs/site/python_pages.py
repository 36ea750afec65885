# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The pages of the Python reference, one per package; mkdocstrings fills in the docstrings."""

from importlib import import_module
import inspect
from pathlib import Path

from site_links import ROOT

PACKAGES = {'robot_dynamics': ROOT, 'robot_dynamics_tools': ROOT / 'robot_dynamics_tools'}
"""The packages, and the directories that contain them."""
NO_LIBRARY = {
    'ros', 'tools', 'commands', 'demo', 'gravity_motion', 'monitor', 'ros2_dynamics', 'viewer'}
"""The subpackages that are no library: the nodes and the executables."""


def python_pages() -> dict[str, str]:
    """Return one page per package, and the page that lists the packages."""
    rows = [f'| [`{package}`](python/{_file(package)}) | {_docstring(package).splitlines()[0]} |'
            for package in packages()]
    contents = [
        '# Python\n',
        'The library and the tools, which can be imported without ROS. Each page has the names '
        'that a package offers, then its modules. The nodes (`robot_dynamics.ros`) and the '
        'executables build on it.\n',
        '| package | |\n| --- | --- |', *rows]
    return {
        **{f'reference/python/{_file(package)}': _page(package) for package in packages()},
        'reference/python.md': '\n'.join(contents) + '\n'}


def packages() -> list[str]:
    """Return the packages of the libraries: both packages, and one per folder below them."""
    found = []
    for package, directory in PACKAGES.items():
        for file in (directory / package).rglob('__init__.py'):
            parts = file.parent.relative_to(directory).parts
            if not NO_LIBRARY.intersection(parts):
                found.append('.'.join(parts))
    return sorted(found)


def folder_of(package: str) -> Path:
    """Return the folder of a package."""
    return PACKAGES[package.partition('.')[0]] / package.replace('.', '/')


def modules(package: str) -> list[str]:
    """Return the modules right below a package, without those of nodes."""
    return [f'{package}.{file.stem}' for file in sorted(folder_of(package).glob('*.py'))
            if file.stem not in ('__init__', 'mujoco_arm', 'recorder')]


def public_names(package: str) -> list[str]:
    """Return `__all__` of a package."""
    return list(getattr(import_module(package), '__all__', ()))


def _page(package: str) -> str:
    parts = [f'# {package}', _docstring(package)]
    links = [_link(package, name) for name in public_names(package)]
    if links:
        parts.append(f'Names to import from `{package}`: {", ".join(links)}.')
    return '\n\n'.join([*parts, *(f'::: {module}' for module in modules(package))]) + '\n'


def _link(package: str, name: str) -> str:
    """Return a cross-reference to where a name is defined."""
    value = getattr(import_module(package), name)
    return f'[`{name}`][{getattr(value, "__module__", package)}.{name}]'


def _file(package: str) -> str:
    top, _, folder = package.partition('.')
    return f'{folder or top}.md' if top == 'robot_dynamics' else (
        f'tools_{folder}.md' if folder else 'tools.md')


def _docstring(package: str) -> str:
    return inspect.getdoc(import_module(package)) or ''
