# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Code of all nodes between rclpy and the arm: messages, subscriptions, services, shutdown."""
