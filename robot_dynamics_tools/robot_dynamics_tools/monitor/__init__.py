# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node `dynamics_monitor`: estimates from measured efforts, markers, payload estimation."""

import robot_dynamics.tools  # noqa: F401  one thread of BLAS, before numpy is loaded
