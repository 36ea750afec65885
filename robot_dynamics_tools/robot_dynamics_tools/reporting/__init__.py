# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Presentation of results: figures in one style, text tables, figures with zoom, and progress."""
