# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo: the export of an arm as MJCF, its simulation, and the node `mujoco_arm`."""
