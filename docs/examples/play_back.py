# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Play the joint states of a recording back, as moving set-points of `/dynamics/set_point`.

    python docs/examples/play_back.py taught
"""

from pathlib import Path
import sys
import time

import rclpy
from robot_dynamics_tools.recordings import Recording
from sensor_msgs.msg import JointState

APPROACH = 3.0
"""[s] for the way to the first position."""


def main() -> None:
    """Play the recording back at its own speed."""
    with Recording(Path(sys.argv[1])) as recording:
        taught = recording.joint_series(recording.joint_state_topic())
    if taught.position is None or taught.velocity is None:
        sys.exit('the recording has no positions or no velocities')
    rclpy.init()
    node = rclpy.create_node('play_back')
    publisher = node.create_publisher(JointState, '/dynamics/set_point', 1)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.05)
    names = list(taught.joint_names)
    publisher.publish(JointState(name=names, position=taught.position[0].tolist()))
    time.sleep(APPROACH)
    start = time.monotonic()
    for t, q, v in zip(taught.times, taught.position, taught.velocity):
        time.sleep(max(0.0, start + t - time.monotonic()))
        publisher.publish(JointState(name=names, position=q.tolist(), velocity=v.tolist()))
    publisher.publish(JointState(name=names, position=taught.position[-1].tolist()))
    publisher.wait_for_all_acked()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
