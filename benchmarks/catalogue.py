# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The benchmarks by name."""

from collections.abc import Callable

from benchmarks import (
    analysis,
    batch,
    control_path,
    disturbance,
    feed_forward,
    growth,
    hand_guiding,
    library,
    memory,
    payload_estimation,
    peers,
    plans,
    rate,
    safe_motion,
    servo_sysid,
    simulation,
    start_up,
)

BENCHMARKS: dict[str, Callable[[], None]] = {
    'library': library.main,
    'peers': peers.main,
    'growth': growth.main,
    'control_path': control_path.main,
    'batch': batch.main,
    'start_up': start_up.main,
    'simulation': simulation.main,
    'rate': rate.main,
    'disturbance': disturbance.main,
    'feed_forward': feed_forward.main,
    'memory': memory.main,
    'analysis': analysis.main,
}
LONG_BENCHMARKS: dict[str, Callable[[], None]] = {
    'safe_motion': safe_motion.main,
    'payload_estimation': payload_estimation.main,
    'plans': plans.main,
    'hand_guiding': hand_guiding.main,
    'servo_sysid': servo_sysid.main,
}
"""Run only when they are named."""
