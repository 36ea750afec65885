# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Run the executable `demo`."""

import sys

from robot_dynamics_tools.demo.cli import main

sys.exit(main())
