# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""Speed of the closed loop of `simulated_arm` and `dynamics` in lock-step."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
import statistics
import tempfile
import time
from typing import Any

from benchmarks.processes import DYNAMICS, node_command, running, SIMULATED_ARM
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from sensor_msgs.msg import JointState

ROUNDS = 5
WINDOW = 1.0
"""[s] of the wall clock over which a round counts simulated time."""
TIMEOUT = 30.0
WARM_UP = 1.0
"""[s] of simulated time, in which the effort ramps up and the arm settles."""


class StampReader:
    """
    Takes the newest joint state on request, and no messages in between.

    An executor that took every message would compete with the nodes for the processors.
    """

    def __init__(self, node: Any) -> None:
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._states = node.create_subscription(
            JointState, 'joint_states', lambda _: None, newest)

    def after(self, stamp: float) -> tuple[float, float]:
        """Return the first stamp after `stamp`, and the time at which it was read, both [s]."""
        deadline = time.monotonic() + TIMEOUT
        while time.monotonic() < deadline:
            taken = self._states.handle.take_message(JointState, False)
            if taken is not None:
                found = 1e-9 * stamp_from_ros(taken[0].header.stamp)
                if found > stamp:
                    return found, time.monotonic()
            time.sleep(1e-3)
        raise TimeoutError(f'no joint state beyond {stamp:g} s in {TIMEOUT:g} s')


@contextmanager
def _reader() -> Iterator[StampReader]:
    rclpy.init()
    try:
        yield StampReader(rclpy.create_node('bench'))
    finally:
        rclpy.try_shutdown()


def times_real_time(urdf: str, parameters: Mapping[str, object], rate: float) -> float:
    """Return simulated seconds per second, the median over windows, for states of `rate` [Hz]."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory, 'arm.urdf')
        path.write_text(urdf, encoding='utf-8')
        arm = {'robot_description_file': path, 'lock_step': True, **parameters}
        with running({
                'dynamics': node_command(DYNAMICS, arm),
                'simulated_arm': node_command(
                    SIMULATED_ARM, {**arm, 'rate': rate}),
        }), _reader() as reader:
            return _speed(reader)


def _speed(reader: StampReader) -> float:
    stamp, now = reader.after(WARM_UP)
    speeds = []
    for _ in range(ROUNDS):
        time.sleep(WINDOW)
        later_stamp, later = reader.after(stamp)
        speeds.append((later_stamp - stamp) / (later - now))
        stamp, now = later_stamp, later
    return statistics.median(speeds)
