# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""An environment for child processes in which libraries cannot be imported."""

from collections.abc import Sequence
import os
from pathlib import Path

SITE = '''
import sys

MODULES = {modules!r}


class Absent:
    """A finder that comes before all others and raises as a missing module does."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition('.')[0] in MODULES:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)


sys.meta_path.insert(0, Absent)
'''


def environment_without(directory: Path, modules: Sequence[str]) -> dict[str, str]:
    """
    Return variables for a process that starts as if these modules were not installed.

    Python imports `sitecustomize`, which is written to the directory, before anything else.
    """
    (directory / 'sitecustomize.py').write_text(
        SITE.format(modules=tuple(modules)), encoding='utf-8')
    paths = [str(directory), os.environ.get('PYTHONPATH', '')]
    return {'PYTHONPATH': os.pathsep.join(filter(None, paths))}
