# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A process that publishes joint states at a high rate: TOPIC RATE SECONDS, with current stamps.

At the end it prints the number of joint states, and the stamp of the last one [ns].
"""

import struct
import sys
import time

from fault_bench import NAMES, NANOSECONDS, Q, V
from rclpy.serialization import serialize_message
from ros_harness import BEST_EFFORT, RosClient
from sensor_msgs.msg import JointState

STAMP_AT = 4
"""Position of the stamp in the bytes of a message."""


def main(topic: str, rate: float, seconds: float) -> None:
    data = bytearray(serialize_message(JointState(name=NAMES, position=Q, velocity=V)))
    with RosClient('flood') as client:
        publisher = client.publisher(JointState, topic, BEST_EFFORT)
        begin, sent, stamp = time.monotonic(), 0, 0
        while (passed := time.monotonic() - begin) < seconds:
            while sent < rate * passed:
                stamp = time.time_ns()
                struct.pack_into('<iI', data, STAMP_AT, *divmod(stamp, NANOSECONDS))
                publisher.publish(bytes(data))
                sent += 1
    print(sent, stamp)


if __name__ == '__main__':
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
