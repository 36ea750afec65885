# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Show an arm in 3-D in a browser with its efforts, external forces, payload and live plots.

Sliders move the arm, buttons attach a load and push it. Requires a running dynamics_node. Names
are relative: with -r __ns:=/left after --ros-args, the node is /left/dynamics.

Exit status: 0 ended by Ctrl-C or SIGTERM; 1 it cannot start; 2 a mistake in the arguments.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
import re
import signal
import sys
import threading
from typing import NoReturn

from robot_dynamics.dependencies import require_ros
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.tools.command_line import DONE, FAILED, Parser, run_tool
from robot_dynamics_tools.options import add_robot, number_in, parsed

DEFAULT_HOST, DEFAULT_PORT = '127.0.0.1', 8080
PORT_NUMBER = number_in(0, 65535, int)
AT = 'viewer: open'
PAGE_OPEN = 'viewer: a page is open'


def execute(argv: Sequence[str] | None = None) -> NoReturn:
    """Run the executable; it ends without waiting for threads of the web server."""
    from robot_dynamics.ros.middleware.shutdown import leave
    leave(main(argv))


def main(argv: Sequence[str] | None = None) -> int:
    """Serve the page until interrupted; return the exit status."""
    parser = Parser(prog='viewer', description=__doc__)
    parser.add_argument(
        '--host', default=DEFAULT_HOST, metavar='ADDRESS',
        help='Address at which the page is served (default: %(default)s, this computer only). Any '
             'client with the token can move the arm')
    parser.add_argument(
        '--port', type=PORT_NUMBER, default=DEFAULT_PORT, metavar='N',
        help='Port of the page; 0 for any free port (default: %(default)s)')
    parser.add_argument(
        '--token', type=token_text, metavar='TEXT',
        help='Token that the address of the page contains (default: a random one). A client that '
             'has it can move the arm')
    add_robot(
        parser, '--robot', 'URDF of the dynamics node, or of the topic robot_description', 'URDF')
    parser.add_argument(
        '--mesh-path', action='append', default=[], type=Path, metavar='DIR',
        help='Directory with meshes for a description from a topic, in addition to the share '
             'directories of packages; may be repeated')
    for option, default, text in (
            ('dynamics', 'dynamics', 'dynamics node'),
            ('monitor', 'dynamics_monitor', 'monitor that draws efforts'),
            ('simulated-arm', 'simulated_arm', 'node for pushes and loads')):
        parser.add_argument(f'--{option}', default=default, metavar='NAME',
                            help=f'Name of the {text} (default: %(default)s)')
    given = list(sys.argv[1:] if argv is None else argv)
    split = given.index('--ros-args') if '--ros-args' in given else len(given)
    arguments = parsed(parser, given[:split])
    return run_tool('viewer', lambda: _run(arguments, given[split:]), rejected=FAILED)


def token_text(text: str) -> str:
    """Return the token of an argument; raise ArgumentTypeError if it is unfit for addresses."""
    if not re.fullmatch(r'[\w-]{8,}', text, re.ASCII):
        raise argparse.ArgumentTypeError(f'{text!r}, expected at least 8 letters, digits, - or _')
    return text


def _run(arguments: argparse.Namespace, ros_arguments: Sequence[str]) -> int:
    is_over = threading.Event()
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: is_over.set())
    require_ros('the viewer')
    from robot_dynamics_tools.viewer import server as web
    token = arguments.token or web.new_token()
    server = web.start_server(arguments.host, arguments.port, 'robot_dynamics', token)
    import rclpy
    from rclpy.exceptions import NameValidationException
    from rclpy.signals import SignalHandlerOptions
    from robot_dynamics.ros.middleware.shutdown import end_later, ends_in_time, ShutdownRequest
    from robot_dynamics.ros.running import MiddlewareError
    from robot_dynamics_tools.viewer.app import Viewer
    from robot_dynamics_tools.viewer.node import ViewerNode
    try:
        rclpy.init(args=list(ros_arguments), signal_handler_options=SignalHandlerOptions.NO)
        node = ViewerNode(
            rclpy.create_node('viewer'), arguments.dynamics, arguments.simulated_arm,
            arguments.monitor)
    except (NameValidationException, *MiddlewareError) as error:
        web.stop_server(server)
        rclpy.try_shutdown()
        raise InvalidInputError(' '.join(str(error).split())) from None
    with ShutdownRequest() as end:
        end.when_asked(end_later)  # also if this thread waits without end
        try:
            viewer = Viewer(server, node, arguments.robot, arguments.mesh_path)
            server.on_client_connect(lambda _: print(PAGE_OPEN, flush=True))
            print(f'{AT} {web.address_of(server, token)} (Ctrl-C ends)', flush=True)
            if not web.is_loopback(arguments.host):
                print('viewer: other computers can reach this page, and move the arm with the '
                      'token', file=sys.stderr)
            viewer.run(lambda: is_over.is_set() or end.is_made)
            viewer.close()
        finally:
            with ends_in_time():
                web.stop_server(server)
                node.close()
                rclpy.try_shutdown()
    return DONE
