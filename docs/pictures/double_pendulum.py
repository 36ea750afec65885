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

"""Draw docs/images/double_pendulum.gif: the recursion at work, as `animate` draws it."""

from pathlib import Path
import sys

from robot_dynamics.tools.animate import main as animate


def main(directory: Path) -> int:
    """Write the animation into a directory."""
    return animate(['--force', '-o', str(directory / 'double_pendulum.gif')])


if __name__ == '__main__':
    sys.exit(main(Path(sys.argv[1])))
