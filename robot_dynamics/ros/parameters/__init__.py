# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of all nodes: declaration, files, command line, and those that describe the arm."""
