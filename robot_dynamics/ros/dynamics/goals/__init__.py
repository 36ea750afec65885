# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The goals that `dynamics` receives: trajectories on a topic, and as an action."""
