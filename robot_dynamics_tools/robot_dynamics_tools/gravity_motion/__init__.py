# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`calibrate_gravity --move`: move the arm of a running node to static holds, and record them."""
