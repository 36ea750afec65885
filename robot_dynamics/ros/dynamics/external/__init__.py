# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What `dynamics` publishes about the environment: external wrench and contacts."""
