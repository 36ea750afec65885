# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Comparison of recordings with the model: filter, residual, report, many recordings at once."""

from robot_dynamics_tools.analysis.bag_analysis import analyze_recording, BagAnalysis
from robot_dynamics_tools.analysis.batch import run_tasks
from robot_dynamics_tools.analysis.motion_filter import filter_motion, FilteredMotion

__all__ = ['analyze_recording', 'BagAnalysis', 'filter_motion', 'FilteredMotion', 'run_tasks']
