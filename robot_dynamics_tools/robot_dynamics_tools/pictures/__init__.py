# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures of an arm: stick figure, marks, torque maps and the workspace."""
