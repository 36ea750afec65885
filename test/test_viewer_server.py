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

"""The viewer's web server and command line: who gets in, and what goes wrong how."""

from contextlib import contextmanager
import http.client
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys

import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar_urdf import default_arm_urdf
from robot_dynamics.tools.viewer import AT, main
from robot_dynamics.tools.viewer_server import (
    address_of,
    is_loopback,
    start_server,
    stop_server,
)
from robots import must_have_everything
from ros_harness import NodeProcess, TIMEOUT, wait_until

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
import msgspec
import viser
import websockets.asyncio.server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

VIEWER = 'robot_dynamics.tools.viewer'
OPEN = re.compile(AT)
LISTENS = '0A'
"""State of a socket in /proc/net/tcp."""


@contextmanager
def served(host='127.0.0.1', port=0):
    server = start_server(host, port, 'a page')
    try:
        yield server
    finally:
        stop_server(server)


@pytest.fixture(scope='module')
def server():
    with served() as started:
        yield started


@pytest.fixture(autouse=True)
def _no_proxy(monkeypatch):
    monkeypatch.setenv('no_proxy', '*')


def connected(server, **options):
    return connect(
        address_of(server).replace('http', 'ws'), subprotocols=[f'viser-v{viser.__version__}'],
        open_timeout=TIMEOUT, close_timeout=TIMEOUT, max_size=None, **options)


# --- who gets in ---------------------------------------------------------------------------------

@pytest.mark.parametrize('origin', [
    'http://evil.example', 'https://evil.example', 'http://evil.example:{port}',
    'http://127.0.0.1.evil.example', 'http://localhost.evil.example:{port}',
    'http://evil.example/http://localhost:{port}', 'http://192.168.0.1:{port}', 'null',
    'file://', 'http://127.0.0.1@evil.example'])
def test_a_page_of_another_site_is_refused(server, origin):
    with pytest.raises(InvalidStatus) as refused, \
            connected(server, origin=origin.format(port=server.get_port())):
        pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize('origin', [
    'http://127.0.0.1:{port}', 'http://localhost:{port}', 'http://[::1]:{port}', None])
def test_its_own_page_and_programs_get_in(server, origin):
    own = origin and origin.format(port=server.get_port())
    with connected(server, origin=own) as connection:
        assert connection.subprotocol == f'viser-v{viser.__version__}'
        assert isinstance(connection.recv(TIMEOUT), bytes)


def test_the_page_itself_is_there(server):
    client = http.client.HTTPConnection('127.0.0.1', server.get_port(), timeout=TIMEOUT)
    client.request('GET', '/')
    response = client.getresponse()
    assert response.status == 200
    assert b'<html' in response.read()
    client.close()


@pytest.mark.skipif(not Path('/proc/net/tcp').exists(), reason='looks at /proc/net/tcp')
def test_only_this_computer_reaches_it(server):
    listening = []
    for table in ('tcp', 'tcp6'):
        file = Path('/proc/net', table)
        rows = file.read_text().splitlines()[1:] if file.exists() else []
        for _, local, _, state, *_ in map(str.split, rows):
            address, port = local.split(':')
            if state == LISTENS and int(port, 16) == server.get_port():
                listening.append(address)
    assert listening == [f'{int.from_bytes(bytes([127, 0, 0, 1]), sys.byteorder):08X}']


@pytest.mark.parametrize(('host', 'expected'), [
    ('127.0.0.1', True), ('127.1.2.3', True), ('localhost', True), ('::1', True),
    ('0.0.0.0', False), ('::', False), ('192.168.0.1', False), ('128.0.0.1', False),
    ('localhost.example.com', False), ('', False), ('example.com', False)])
def test_what_is_this_computer_alone(host, expected):
    assert is_loopback(host) is expected


def is_shared(server):
    """Tell whether a page that asks for a public address makes the server get one."""
    asked = []
    server.request_share_url = lambda: asked.append(True)  # instead of going to the network
    slider = server.gui.add_slider('order', 0.0, 1.0, 0.5, 0.0)
    with connected(server) as connection:
        for message in (
                {'type': 'ShareUrlRequest'},
                {'type': 'GuiUpdateMessage', 'uuid': slider._impl.uuid, 'updates': {'value': 1}}):
            connection.send(msgspec.msgpack.encode(message))
        wait_until(lambda: slider.value == 1.0, 'what was sent after the request')
    return asked


def test_the_page_never_gets_a_public_address(server):
    assert not is_shared(server)


def test_where_nothing_prevents_it_a_page_would_get_one(capsys):
    plain = viser.ViserServer('127.0.0.1', 0, verbose=False)
    try:
        wait_until(lambda: is_shared(plain), 'a request')
    finally:
        stop_server(plain)


# --- servers -------------------------------------------------------------------------------------

def test_two_servers_at_once_and_nothing_of_others_is_changed(capsys):
    serve = websockets.asyncio.server.serve
    with served() as one, served() as other:
        assert websockets.asyncio.server.serve is serve
        assert one.get_port() != other.get_port()
        for server in (one, other):
            with connected(server, origin=address_of(server)) as connection:
                connection.recv(TIMEOUT)
            with pytest.raises(InvalidStatus), connected(server, origin='http://evil.example'):
                pass
    assert websockets.asyncio.server.serve is serve
    assert capsys.readouterr() == ('', '')


def test_a_port_is_free_again_when_the_server_has_stopped():
    with served() as first:
        port = first.get_port()
    with served(port=port) as second:
        assert second.get_port() == port
        assert address_of(second) == f'http://127.0.0.1:{port}'


def test_a_port_that_is_taken_is_told(server):
    with pytest.raises(InvalidInputError) as error:
        start_server('127.0.0.1', server.get_port(), 'another')
    assert str(error.value).startswith(
        f"--port is {server.get_port()} at --host '127.0.0.1', where the page cannot be served (")
    assert str(error.value).endswith(
        "; expected a free port (0 finds one) of this computer's address")


@pytest.mark.parametrize('host', ['no.such.host.invalid', '203.0.113.1'])
def test_an_address_of_another_computer_is_told(host):
    with pytest.raises(InvalidInputError, match=f'--port is 0 at --host {host!r}, where the page'):
        start_server(host, 0, 'a page')


# --- the command line ----------------------------------------------------------------------------

def run(*arguments, without=()):
    """Run the command to its end, as if these libraries were not installed."""
    script = (
        f'import sys; sys.modules.update(dict.fromkeys({list(without)!r}))\n'
        f'from {VIEWER} import main; sys.exit(main({list(arguments)!r}))')
    return subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, stdin=subprocess.DEVNULL,
        timeout=3 * TIMEOUT, check=False)


def check_one_line(done, status, words):
    assert done.returncode == status, done.stderr
    assert done.stdout == ''
    assert re.fullmatch(rf'viewer: [^\n]*{words}[^\n]*\n', done.stderr), done.stderr


def test_help_needs_no_library(capsys):
    done = run('--help', without=('viser', 'websockets', 'trimesh', 'rclpy'))
    assert (done.returncode, done.stderr) == (0, '')
    for option in ('--host', '--port', '--robot', '--dynamics', '--simulated-arm'):
        assert option in done.stdout


def test_without_viser_one_line_says_how_to_get_it():
    check_one_line(run('--port', '0', without=['viser']), 1, 'pip install viser')


@pytest.mark.parametrize('arguments', [
    ('--port', '-1'), ('--port', '65536'), ('--port', 'http'), ('--port', '8080.0'),
    ('--port', '²'), ('--port',), ('--robt', 'x'), ('a.urdf',)])
def test_mistakes_in_the_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert re.fullmatch(r'viewer: [^\n]+ \(viewer --help lists the options\)\n', err)


def test_a_port_that_is_taken_is_one_line():
    with socket.create_server(('127.0.0.1', 0)) as other:
        port = other.getsockname()[1]
        check_one_line(run('--port', str(port)), 1, f'--port is {port} at')


@pytest.mark.parametrize('robot', ['gone.urdf', 'package://no_such_package/a.urdf', 'ftp://a'])
def test_a_robot_that_is_not_there_is_one_line(robot, tmp_path):
    name = robot if '://' in robot else str(tmp_path / robot)
    check_one_line(run('--port', '0', '--robot', name), 1, re.escape(name))


@pytest.mark.xfail(strict=True, reason='ends with a traceback')
@pytest.mark.parametrize('arguments', [
    ('--dynamics', 'no name'), ('--simulated-arm', '7'), ('--ros-args', '-r', '__ns:=no-name')])
def test_names_that_are_none_are_one_line(arguments):
    check_one_line(run('--port', '0', *arguments), 1, '')


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM'])
def test_a_signal_ends_it_in_order(name):
    with NodeProcess(
            VIEWER, namespace='/ended', arguments=('--port', '0'), ready=OPEN) as viewer:
        os.kill(viewer.pid, getattr(signal, name))
        assert viewer.wait() == 0
        assert viewer.log.count('\n') == 1, viewer.log


def test_a_signal_ends_it_in_order_with_an_arm_and_a_page(tmp_path):
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf())
    arguments = ('--port', '0', '--robot', str(tmp_path / 'arm.urdf'))
    with NodeProcess(VIEWER, namespace='/ended', arguments=arguments, ready=OPEN) as viewer:
        port = re.search(r':(\d+) ', viewer.wait_for_log(OPEN))[1]
        with connect(f'ws://127.0.0.1:{port}', subprotocols=[f'viser-v{viser.__version__}'],
                     max_size=None) as page:
            page.recv(TIMEOUT)
            os.kill(viewer.pid, signal.SIGTERM)
            assert viewer.wait() == 0
        assert 'Traceback' not in viewer.log


def test_beyond_this_computer_there_is_a_warning_on_stderr():
    only_errors = ('sh', '-c', 'exec "$@" >/dev/null', 'sh')
    with NodeProcess(
            VIEWER, namespace='/ended', arguments=('--port', '0', '--host', '0.0.0.0'),
            prefix=only_errors, ready=re.compile('others can reach this page')) as viewer:
        pass
    assert viewer.log.count('\n') == 1
    with NodeProcess(
            VIEWER, namespace='/ended', arguments=('--port', '0'), ready=OPEN) as viewer:
        pass
    assert 'others can reach' not in viewer.log
