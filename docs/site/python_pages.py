# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The pages of the Python reference, one per package; mkdocstrings fills in the docstrings."""

from importlib import import_module
import inspect

from site_links import ROOT

PACKAGE = 'robot_dynamics'
WITH_ROS = {'ros', 'tools'}
"""The subpackages that are no library: the nodes and the executables."""


def python_pages() -> dict[str, str]:
    """Return one page per package, and the page that lists the packages."""
    rows = [f'| [`{package}`](python/{_file(package)}) | {_docstring(package).splitlines()[0]} |'
            for package in packages()]
    contents = [
        '# Python\n',
        'The library, which can be imported without ROS. Each page has the names that a package '
        'offers, then its modules. The nodes (`robot_dynamics.ros`) and the executables '
        '(`robot_dynamics.tools`) build on it.\n',
        '| package | |\n| --- | --- |', *rows]
    return {
        **{f'reference/python/{_file(package)}': _page(package) for package in packages()},
        'reference/python.md': '\n'.join(contents) + '\n'}


def packages() -> list[str]:
    """Return the packages of the library: `robot_dynamics` and one per folder below it."""
    folders = [file.parent.relative_to(ROOT) for file in (ROOT / PACKAGE).rglob('__init__.py')]
    return sorted('.'.join(folder.parts) for folder in folders if not WITH_ROS.intersection(
        folder.parts))


def modules(package: str) -> list[str]:
    """Return the modules right below a package."""
    files = sorted((ROOT / package.replace('.', '/')).glob('*.py'))
    return [f'{package}.{file.stem}' for file in files if file.stem != '__init__']


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
    return f'{package.rpartition(".")[2]}.md'


def _docstring(package: str) -> str:
    return inspect.getdoc(import_module(package)) or ''
