# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Run the executable `viewer`."""

from robot_dynamics_tools.viewer.cli import execute

execute()
