# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Wrenches on a running simulated arm, and payloads of running nodes."""

from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import WrenchStamped
from robot_dynamics.model.payload import Payload
from robot_dynamics.ros.middleware.conversions import payload_to_ros
from robot_dynamics_interfaces.srv import SetPayload
from ros_harness import RosClient

ZERO = (0.0, 0.0, 0.0)


def wrench(
    link: str, force: Sequence[float] = ZERO, torque: Sequence[float] = ZERO,
) -> WrenchStamped:
    """Return a wrench on a link: force [N] and torque [N·m] in its frame."""
    message = WrenchStamped()
    message.header.frame_id = link
    f, t = message.wrench.force, message.wrench.torque
    (f.x, f.y, f.z), (t.x, t.y, t.z) = map(float, force), map(float, torque)
    return message


def push(client: RosClient, arm: str, force: Sequence[float], link: str = 'tool0') -> None:
    """Push a link of a simulated arm from now on; `arm` is the name of the node."""
    client.publisher(WrenchStamped, f'{arm}/external_wrench').publish(wrench(link, force))


def set_payload(client: RosClient, node: str, payload: Payload | None = None) -> Any:
    """Attach a payload, None for none; return the response, which must be a success."""
    response = client.call(SetPayload, f'{node}/set_payload', SetPayload.Request(
        payload=payload_to_ros(payload)))
    assert response.success, response.message
    return response
