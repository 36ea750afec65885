# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""YAML with the number formats of ROS 2."""

from collections.abc import Mapping, Sequence
import re
from typing import Any

from robot_dynamics.dependencies import optional

_WIDTH = 74
"""Column after which PyYAML begins a new line: lines have at most 99 columns."""
_EXPONENT_FLOAT = re.compile(r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+$')
"""
A number with an exponent, such as `1e-09`.

PyYAML parses such a number as a string unless it has a decimal point and a sign of the exponent.
JSON and the parameter files of ROS 2 permit numbers without either.
"""


def load_yaml(text: str, purpose: str) -> Any:
    """
    Return the data in a YAML text; `purpose` names the user of PyYAML in the message.

    Raises yaml.YAMLError, and MissingDependencyError without PyYAML.
    """
    yaml = optional('yaml', purpose)

    class Loader(yaml.SafeLoader):  # type: ignore[name-defined]
        pass

    Loader.add_implicit_resolver('tag:yaml.org,2002:float', _EXPONENT_FLOAT, list('-+.0123456789'))
    return yaml.load(text, Loader)


def dump_yaml(document: Mapping[str, Any], comments: Sequence[str], purpose: str) -> str:
    """
    Return a YAML text: comments, then the document, with text of several lines as it is.

    `purpose` is as for `load_yaml`. Raises MissingDependencyError without PyYAML.
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
