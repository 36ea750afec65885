# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Comparison of recordings with the model: filter, residual, report, many recordings at once."""

from robot_dynamics.analysis.bag_analysis import analyze_recording, BagAnalysis
from robot_dynamics.analysis.batch import run_tasks
from robot_dynamics.analysis.motion_filter import filter_motion, FilteredMotion

__all__ = [
    'analyze_recording',
    'BagAnalysis',
    'filter_motion',
    'FilteredMotion',
    'run_tasks',
]
