# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Reading of YAML with the number formats of ROS 2."""

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
