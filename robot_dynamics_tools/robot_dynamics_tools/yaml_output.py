# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""YAML files as the tools write them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from robot_dynamics.dependencies import optional

_WIDTH = 74
"""Column after which PyYAML begins a new line: lines have at most 99 columns."""


def dump_yaml(document: Mapping[str, Any], comments: Sequence[str], purpose: str) -> str:
    """
    Return a YAML text: comments, then the document, with text of several lines as it is.

    `purpose` names the user of PyYAML in the message. Raises MissingDependencyError without it.
    """
    yaml = optional('yaml', purpose)

    class Dumper(yaml.SafeDumper):  # type: ignore[name-defined]
        pass

    Dumper.add_representer(list, lambda dumper, value: dumper.represent_sequence(
        'tag:yaml.org,2002:seq', value, flow_style=True))
    Dumper.add_representer(str, lambda dumper, value: dumper.represent_scalar(
        'tag:yaml.org,2002:str', value, style='|' if '\n' in value else None))
    return ''.join(f'# {comment}'.rstrip() + '\n' for comment in comments) + str(yaml.dump(
        document, Dumper=Dumper, sort_keys=False, width=_WIDTH, allow_unicode=True))


def rounded(values: Iterable[float], digits: int = 9) -> list[float]:
    """Return numbers as they are written, with this number of significant digits."""
    return [float(f'{value:.{digits}g}') for value in values]
