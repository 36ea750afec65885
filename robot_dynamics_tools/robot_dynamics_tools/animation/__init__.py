# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Animations of a planar chain."""

from robot_dynamics_tools.animation.chain_animation import chain_frames
from robot_dynamics_tools.animation.video import write_video

__all__ = ['chain_frames', 'write_video']
