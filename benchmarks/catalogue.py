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

"""The benchmarks by name."""

from collections.abc import Callable

from benchmarks import (
    analysis,
    batch,
    control_path,
    disturbance,
    growth,
    library,
    memory,
    message_profile,
    payload_estimation,
    peers,
    rate,
    safe_motion,
    simulation,
    start_up,
)

BENCHMARKS: dict[str, Callable[[], None]] = {
    'library': library.main,
    'peers': peers.main,
    'growth': growth.main,
    'control_path': control_path.main,
    'message_profile': message_profile.main,
    'batch': batch.main,
    'start_up': start_up.main,
    'simulation': simulation.main,
    'rate': rate.main,
    'disturbance': disturbance.main,
    'memory': memory.main,
    'analysis': analysis.main,
}
LONG_BENCHMARKS: dict[str, Callable[[], None]] = {
    'safe_motion': safe_motion.main,
    'payload_estimation': payload_estimation.main,
}
"""Run only when they are named."""
