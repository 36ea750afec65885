# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control law of docs/examples/spring.py."""

from pathlib import Path
from typing import Any

from robot_dynamics.control.laws.control_law import ControlLaw

PAGE_MODULE = (Path(__file__).parents[2] / 'docs' / 'examples' / 'spring.py').read_text()


def page_law() -> type[ControlLaw]:
    """Return the law."""
    scope: dict[str, Any] = {'__name__': 'spring'}
    exec(compile(PAGE_MODULE, 'spring.py', 'exec'), scope)
    law: type[ControlLaw] = scope['Spring']
    return law


def install_page_law(directory: Path, further: str = '') -> None:
    """Install a package with the law `own_spring` in a directory; `further` entry points."""
    package, information = directory / 'user_package', directory / 'user_package-1.0.dist-info'
    package.mkdir()
    (package / 'spring.py').write_text(PAGE_MODULE)
    information.mkdir()
    (information / 'METADATA').write_text('Name: user_package\nVersion: 1.0\n')
    (information / 'entry_points.txt').write_text(
        f'[robot_dynamics.control_laws]\nown_spring = user_package.spring:Spring\n{further}')
