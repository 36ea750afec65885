# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks: ratios measured side by side in one run; absolute times depend on the machine."""
