# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Servers of the viewer for its tests, connections to them, and arms to display."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from children import TIMEOUT
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics_tools.viewer.server import address_of, start_server, stop_server
from robots import robot_urdf
import viser
from websockets.sync.client import ClientConnection, connect

TOOLS = 'robot_dynamics_tools'
TESTED_TOKEN = 'a-token-of-the-tests'
PROTOCOL = f'viser-v{viser.__version__}'
ONE_JOINT = """
<robot name="one_joint"><link name="base"/><link name="tip"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="one" type="{}"><parent link="base"/><child link="tip"/>{}</joint></robot>"""


@contextmanager
def served() -> Iterator[viser.ViserServer]:
    """Run a server of an empty page on a free port of this computer."""
    server = start_server('127.0.0.1', 0, 'a page', TESTED_TOKEN)
    try:
        yield server
    finally:
        stop_server(server)


def connected(server: viser.ViserServer, **options: Any) -> ClientConnection:
    """Return a connection to the WebSocket of a server."""
    return connect(
        address_of(server, TESTED_TOKEN).replace('http', 'ws'), subprotocols=[PROTOCOL],
        open_timeout=TIMEOUT, close_timeout=TIMEOUT, max_size=None, **options)


def one_joint(kind: str, limit: str = '') -> ArmModel:
    """Return an arm with one joint of this kind; `limit` are attributes of its limits."""
    return load_arm(ONE_JOINT.format(kind, limit and f'<limit effort="1" {limit}/>'))


def arm_called(name: str) -> ArmModel:
    """Return a robot of the tests by name, or the default arm."""
    return load_arm(robot_urdf(name))
