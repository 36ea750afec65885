# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""YAML with the number formats of ROS 2."""

import re
from typing import Any

from robot_dynamics.dependencies import optional

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
