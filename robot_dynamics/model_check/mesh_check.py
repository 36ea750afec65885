# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The check of the meshes of a URDF, in a separate process.

Meshes take seconds and memory, which the process that commands an arm does not have. The
description may be that of another program: only meshes that it may name are opened
(`urdf.mesh_files`).
"""

import os
import subprocess
import sys


def lines_of_meshes(urdf: str) -> list[str]:
    """Return the findings that only the meshes of a URDF show; raise SubprocessError, OSError."""
    done = subprocess.run(
        [sys.executable, '-m', __name__], input=urdf, text=True, capture_output=True, check=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))})
    return done.stdout.splitlines()


def main() -> None:
    """Print the findings in the meshes of the URDF on the standard input, one per line."""
    from robot_dynamics.model_check.checks import mesh_findings
    from robot_dynamics.model_check.mesh_bounds import MeshReader
    os.nice(19)
    for finding in mesh_findings(sys.stdin.read(), MeshReader(None)):
        print(finding)


if __name__ == '__main__':
    main()
