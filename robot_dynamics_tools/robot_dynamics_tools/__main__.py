# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Run a verb of `ros2 dynamics`: `python -m robot_dynamics_tools VERB …`."""

import sys

from robot_dynamics_tools.ros2_dynamics.cli import main

sys.exit(main())
