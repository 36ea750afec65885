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

"""Libraries that some functions need and the package can do without, and how to install them."""

import importlib
from typing import Any

from robot_dynamics.exceptions import MissingDependencyError

LIBRARIES = {
    'PIL': ('Pillow', 'apt install python3-pil, pip install pillow', 'tools'),
    'distributed': ('distributed', 'pip install distributed', 'dask'),
    'matplotlib': (
        'matplotlib', 'apt install python3-matplotlib, pip install matplotlib', 'tools'),
    'mcap': ('mcap', 'pip install mcap', 'tools'),
    'pyarrow': ('pyarrow', 'pip install pyarrow', 'parquet'),
    'rosbags': ('rosbags', 'pip install rosbags', 'tools'),
    'scipy': ('scipy', 'apt install python3-scipy, pip install scipy', 'tools'),
    'viser': ('viser', 'in this repository scripts/setup viewer, pip install viser pycollada',
              'viewer'),
    'xacro': ('xacro', 'apt install ros-jazzy-xacro, pip install xacro', 'xacro'),
    'yaml': ('PyYAML', 'apt install python3-yaml, pip install pyyaml', 'tools'),
}
"""Name, ways to install it, and the extra of this package that contains it, by module."""


def optional(module: str, purpose: str) -> Any:
    """
    Return a module of one of LIBRARIES; `purpose` is what needs it, for the message.

    Raises MissingDependencyError where the library is not installed.
    """
    library = module.partition('.')[0]
    try:
        importlib.import_module(library)
        return importlib.import_module(module)
    except ImportError:
        name, ways, extra = LIBRARIES[library]
        raise MissingDependencyError(
            f'{purpose} needs the library {name} ({ways}, or robot_dynamics[{extra}])') from None
