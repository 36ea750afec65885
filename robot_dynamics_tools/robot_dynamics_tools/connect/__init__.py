# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics connect`: from a robot that publishes joint states to a parameter file."""
