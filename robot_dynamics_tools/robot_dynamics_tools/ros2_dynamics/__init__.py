# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verbs of `ros2 dynamics`, and the executable `dynamics`."""
