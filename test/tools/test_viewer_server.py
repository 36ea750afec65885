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

"""The viewer as a server: permitted connections, the displayed arm, and its command line."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
import errno
import http.client
from itertools import cycle
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading

import children
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_table import fault
import pytest
import rclpy
from rclpy.context import Context
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.tools.viewer.cli import AT, main
from robot_dynamics.tools.viewer.server import address_of, is_loopback, start_server, stop_server
from robots import must_have_everything, robot_path
from ros_harness import DYNAMICS, LATCHED, NodeProcess, running, SIMULATED_ARM, TIMEOUT, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
import msgspec
from robot_dynamics.tools.viewer.app import Viewer
from robot_dynamics.tools.viewer.node import ViewerNode
import viser
import websockets.asyncio.server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

VIEWER = 'robot_dynamics.tools.viewer'
OPEN = re.compile(AT)
PROTOCOL = f'viser-v{viser.__version__}'
LISTENS = '0A'  # in /proc/net/tcp


@contextmanager
def served():
    server = start_server('127.0.0.1', 0, 'a page')
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
        address_of(server).replace('http', 'ws'), subprotocols=[PROTOCOL],
        open_timeout=TIMEOUT, close_timeout=TIMEOUT, max_size=None, **options)


# --- permitted connections -----------------------------------------------------------------------

@pytest.mark.parametrize('origin', [
    pytest.param('http://evil.example', marks=fault(
        'External files and web pages',
        'a web page of another origin opens the WebSocket of the viewer',
        'rejected with status 403')), 'https://evil.example', 'http://evil.example:{port}',
    'http://127.0.0.1.evil.example', 'http://localhost.evil.example:{port}',
    'http://evil.example/http://localhost:{port}', 'http://192.168.0.1:{port}', 'null', 'file://',
    'http://localhost', 'http://localhost:1', 'http://127.0.0.1:1{port}', 'http://localhost:{port}/',
    'http://localhost:{port}:{port}'])
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
        assert connection.subprotocol == PROTOCOL
        assert isinstance(connection.recv(TIMEOUT), bytes)


def status_of(server, host, origin=None, upgrade=False):
    """Return the status of a request with these headers."""
    address, port = server.get_host(), server.get_port()
    connection = http.client.HTTPConnection(address, port, timeout=TIMEOUT)
    headers = {'Host': host.format(port=port)}
    if origin:
        headers['Origin'] = origin.format(port=port)
    if upgrade:
        headers |= {'Upgrade': 'websocket', 'Connection': 'Upgrade', 'Sec-WebSocket-Version': '13',
                    'Sec-WebSocket-Key': 'AAAAAAAAAAAAAAAAAAAAAA==',
                    'Sec-WebSocket-Protocol': PROTOCOL}
    try:
        connection.request('GET', '/', headers=headers)
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.mark.parametrize('upgrade', [False, True])
@pytest.mark.parametrize(('host', 'is_own'), [
    ('127.0.0.1:{port}', True), ('localhost:{port}', True), ('[::1]:{port}', True),
    ('localhost', False), ('localhost:1', False), ('evil.example:{port}', False),
    ('127.0.0.1.evil.example:{port}', False), ('', False)])
def test_only_requests_for_its_own_address_are_answered(server, host, is_own, upgrade):
    accepted = 101 if upgrade else 200
    assert status_of(server, host, upgrade=upgrade) == (accepted if is_own else 403)


def test_beyond_this_computer_a_page_must_come_from_the_address_that_it_asks():
    server = start_server('0.0.0.0', 0, 'a page')
    try:
        for origin, status in (('http://robot.example:{port}', 200), (None, 200),
                               ('https://robot.example:{port}', 200),
                               ('http://robot.example', 403), ('http://evil.example', 403)):
            assert status_of(server, 'robot.example:{port}', origin) == status, origin
    finally:
        stop_server(server)


@pytest.mark.skipif(not Path('/proc/net/tcp').exists(), reason='looks at /proc/net/tcp')
def test_only_this_computer_reaches_it(server):
    listening = []
    for file in filter(Path.exists, (Path('/proc/net/tcp'), Path('/proc/net/tcp6'))):
        for _, local, _, state, *_ in map(str.split, file.read_text().splitlines()[1:]):
            address, port = local.split(':')
            if state == LISTENS and int(port, 16) == server.get_port():
                listening.append(address)
    assert listening == [f'{int.from_bytes(bytes([127, 0, 0, 1]), sys.byteorder):08X}']


@pytest.mark.parametrize(('host', 'expected'), [
    ('127.0.0.1', True), ('127.1.2.3', True), ('localhost', True), ('::1', True), ('', False),
    ('0.0.0.0', False), ('::', False), ('128.0.0.1', False), ('localhost.example.com', False)])
def test_what_is_this_computer_alone(host, expected):
    assert is_loopback(host) is expected


def is_shared(server):
    """Return whether a page that requests a public address makes the server request one."""
    asked = []
    server.request_share_url = lambda: asked.append(True)  # instead of a network access
    slider = server.gui.add_slider('order', 0.0, 1.0, 0.5, 0.0)
    with connected(server) as connection:
        for message in (
                {'type': 'ShareUrlRequest'},
                {'type': 'GuiUpdateMessage', 'uuid': slider._impl.uuid, 'updates': {'value': 1}}):
            connection.send(msgspec.msgpack.encode(message))
        wait_until(lambda: slider.value == 1.0, 'the message after the request')
    return asked


def test_the_page_never_gets_a_public_address(server, capsys):
    assert not is_shared(server)
    plain = viser.ViserServer('127.0.0.1', 0, verbose=False)
    try:
        wait_until(lambda: is_shared(plain), 'a request where nothing prevents it')
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


@pytest.mark.parametrize(('host', 'reason'), [
    ('127.0.0.1', errno.EADDRINUSE), ('203.0.113.1', errno.EADDRNOTAVAIL)])
def test_a_port_that_cannot_be_had_is_reported(server, host, reason):
    with pytest.raises(InvalidInputError) as error:
        start_server(host, server.get_port(), 'another')
    assert str(error.value) == (
        f"--port is {server.get_port()} at --host '{host}', where the page cannot be served "
        f"({os.strerror(reason)}); expected a free port (0 finds one) of this computer's address")


# --- the displayed arm ---------------------------------------------------------------------------

class Watched:
    def __init__(self, viewer, work):
        self.viewer, self._work = viewer, work

    def wait_for(self, *words, without=(), meanwhile=lambda: None):
        """Wait until the page contains each of `words`, and none of `without`."""
        def is_so():
            meanwhile()
            said = self.viewer._words.content
            return self._work.done() or (
                all(word in said for word in words) and not any(word in said for word in without))

        try:
            wait_until(is_so, f'{words} without {without}')
        except AssertionError as error:
            pytest.fail(f'{error}; the page says\n{self.viewer._words.content}')
        assert not self._work.done(), self._work.result()

    def sliders(self):
        return [slider.value for slider in self.viewer._shown.panel._sliders]


@contextmanager
def watched(namespace, robot=None):
    context, over = Context(), threading.Event()
    rclpy.init(context=context)
    node = ViewerNode(rclpy.create_node('viewer', context=context, namespace=namespace),
                      'dynamics', 'simulated_arm')
    with served() as server, ThreadPoolExecutor(1) as pool:
        viewer = Viewer(server, node, robot)
        work = pool.submit(viewer.run, over.is_set)
        try:
            yield Watched(viewer, work)
        finally:
            over.set()
            work.result(TIMEOUT)
            viewer.close()
            node.close()
            rclpy.shutdown(context=context)


@contextmanager
def described(client, namespace):
    """Yield a function that publishes a URDF on the topic robot_description."""
    topic = client.publisher(String, f'{namespace}/robot_description', LATCHED, 0)
    yield lambda xml: topic.publish(String(data=xml))
    client.node.destroy_publisher(topic)


def one_link(name):
    return planar_arm_urdf([2.0], [1.0], [0.5], [0.1], name=name)


def test_the_arm_is_that_of_dynamics_and_changes_with_it():
    with watched('/viewed') as page:
        page.wait_for('no arm yet', 'no node dynamics', 'joint_states has no publisher')
        simulated = NodeProcess(SIMULATED_ARM, {
            'initial_position': [0.5, -0.5], 'rate': 100.0, 'command_timeout': 0.0},
            namespace='/viewed')
        with running(NodeProcess(DYNAMICS, namespace='/viewed'), simulated):
            page.wait_for('**planar_arm**, 2 joints', 'gravity compensation',
                          without=('no node', 'no joint states'))
            wait_until(lambda: page.sliders() == pytest.approx([0.5, -0.5], abs=0.1), 'sliders')
        page.wait_for('**planar_arm**', 'no node dynamics', 'joint_states has no publisher')
        parameters = {'robot_description_file': str(robot_path('ur10'))}
        with NodeProcess(DYNAMICS, parameters, namespace='/viewed'):
            page.wait_for('**ur10**, 6 joints', without=('planar_arm', 'not drawn', 'no node'))


def test_diagnostics_of_another_namespace_are_skipped(client):
    context = Context()
    rclpy.init(context=context)
    viewer = ViewerNode(
        rclpy.create_node('viewer', context=context, namespace='/viewed'), 'dynamics', 'arm')
    try:
        publisher = client.publisher(DiagnosticArray, '/diagnostics')
        found, namespaces = [], cycle(('/other', '/viewed'))

        def has_received():
            publisher.publish(DiagnosticArray(status=[
                DiagnosticStatus(name=f'{next(namespaces)}/dynamics: command')]))
            message = viewer.receive().diagnostics
            found.extend([] if message is None else message.status)
            return found

        wait_until(has_received, 'diagnostics of /viewed/dynamics')
        assert {status.name for status in found} == {'/viewed/dynamics: command'}
    finally:
        viewer.close()
        rclpy.shutdown(context=context)


def test_without_dynamics_the_arm_is_that_of_the_topic(client):
    with described(client, '/topical') as publish:
        publish(one_link('first'))
        with watched('/topical') as page:
            page.wait_for(
                '**first**, 1 joint', 'no node dynamics', 'joint_states has no publisher')
            publish(one_link('second'))
            page.wait_for('**second**', without=['first'])
            publish('<robot name="broken"')
            page.wait_for('**second**', 'robot_description is not well-formed XML')
            publish(default_arm_urdf())
            page.wait_for('**planar_arm**', without=['well-formed'])


def test_nothing_is_wrong_any_more_when_the_description_is_the_former_one_again(client):
    with described(client, '/corrected') as publish, watched('/corrected') as page:
        for xml, words in ((one_link('first'), '**first**'), ('<robot', 'not well-formed XML')):
            publish(xml)
            page.wait_for(words)
        publish(one_link('first'))
        page.wait_for('**first**', without=['well-formed'])


def test_a_description_that_is_none_is_reported_while_states_come(client):
    states = client.publisher(JointState, '/broken/joint_states', subscribers=0)
    state = JointState(name=['joint1', 'joint2'], position=[0.2, 0.1])
    with described(client, '/broken') as publish, \
            NodeProcess(DYNAMICS, namespace='/broken'), watched('/broken') as page:
        page.wait_for('**planar_arm**', without=['no joint states'],
                      meanwhile=lambda: states.publish(state))
        publish('<robot name="broken"')
        page.wait_for('**planar_arm**', 'robot_description is not well-formed XML',
                      meanwhile=lambda: states.publish(state))


def test_a_file_of_another_computer_is_reported_until_the_topic_has_the_arm(client, tmp_path):
    file = tmp_path / 'arm.urdf'
    file.write_text(one_link('elsewhere'))
    parameters = {'robot_description_file': str(file)}
    with described(client, '/remote') as publish, \
            NodeProcess(DYNAMICS, parameters, namespace='/remote'):
        file.unlink()
        with watched('/remote') as page:
            page.wait_for('no arm yet', str(file), 'or on the topic robot_description')
            publish(one_link('elsewhere'))
            page.wait_for('**elsewhere**', without=[str(file)])


def test_a_named_robot_is_shown_independent_of_other_nodes(client, tmp_path):
    (tmp_path / 'arm.urdf').write_text(one_link('named'))
    other = NodeProcess(DYNAMICS, {'robot_description': one_link('other')}, namespace='/named')
    with described(client, '/named') as publish, \
            watched('/named', str(tmp_path / 'arm.urdf')) as page:
        publish(one_link('topical'))
        page.wait_for('**named**', 'no node dynamics')
        with other:
            source = page.viewer._source
            wait_until(lambda: source._described and source._topic_xml, 'what both say')
            page.wait_for('**named**', 'gravity compensation', without=['other', 'topical'])


@pytest.mark.parametrize(('names', 'position', 'words'), [
    (['joint1', 'finger'], [0.1, 0.2], "joint_states lack ['joint2']"),
    ([], [], "joint_states lack ['joint1', 'joint2']"),
    (['joint1', 'joint2'], [0.1], "joint_states lack ['joint2']"),
    (['joint1', 'joint2'], [0.1, float('nan')], "no finite position of ['joint2']")])
def test_states_that_cannot_be_shown_are_reported_until_others_come(
        client, tmp_path, names, position, words):
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf())
    states = client.publisher(JointState, '/stated/joint_states', subscribers=0)
    with watched('/stated', str(tmp_path / 'arm.urdf')) as page:
        page.wait_for('joint_states', words, meanwhile=lambda: states.publish(
            JointState(name=names, position=position)))
        page.wait_for(without=['joint_states'], meanwhile=lambda: states.publish(
            JointState(name=['joint2', 'joint1'], position=[0.2, 0.1])))
        assert page.sliders() == [0.1, 0.2]
    client.node.destroy_publisher(states)


# --- the command line ----------------------------------------------------------------------------

def run(*arguments, without=()):
    """Run the command to its end, as if some libraries were not installed."""
    script = (
        f'import sys; sys.modules.update(dict.fromkeys({list(without)!r}))\n'
        f'from {VIEWER}.cli import main; sys.exit(main({list(arguments)!r}))')
    return children.run(
        [sys.executable, '-c', script], capture_output=True, text=True, stdin=subprocess.DEVNULL,
        timeout=3 * TIMEOUT)


def check_one_line(done, status, words):
    assert done.returncode == status, done.stderr
    assert done.stdout == ''
    assert re.fullmatch(rf'viewer: [^\n]*{words}[^\n]*\n', done.stderr), done.stderr


def test_help_needs_no_library():
    done = run('--help', without=('viser', 'websockets', 'trimesh', 'rclpy'))
    assert (done.returncode, done.stderr) == (0, '')
    assert all(f'--{option}' in done.stdout for option in ('host', 'port', 'robot', 'dynamics'))


def test_without_viser_one_line_names_the_installation():
    check_one_line(run('--port', '0', without=['viser']), 1, 'pip install viser')


@pytest.mark.parametrize('arguments', [
    ('--port', '-1'), ('--port', '65536'), ('--port', 'http'), ('--port', '8080.0'),
    ('--port', '²'), ('--port',), ('--robt', 'x'), ('a.urdf',)])
def test_mistakes_in_the_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    line = r'viewer: [^\n]+ \(viewer --help lists the options\)\n'
    assert re.fullmatch(line, capsys.readouterr().err)


@pytest.mark.parametrize('robot', ['gone.urdf', 'package://no_such_package/a.urdf', 'ftp://a'])
def test_a_robot_that_is_not_there_is_one_line(robot, tmp_path):
    name = robot if '://' in robot else str(tmp_path / robot)
    check_one_line(run('--port', '0', '--robot', name), 1, re.escape(name))


@pytest.mark.parametrize('arguments', [
    ('--dynamics', 'no name'), ('--simulated-arm', '7'), ('--ros-args', '-r', '__ns:=no-name')])
def test_names_that_are_none_are_reported(arguments):
    done = run('--port', '0', *arguments)
    assert (done.returncode, done.stdout, done.stderr.count('Traceback')) == (1, '', 0)
    assert done.stderr.splitlines()[-1].startswith('viewer: ')  # rcl may log a line before


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM'])
@pytest.mark.parametrize('arm', [(), ('--robot', 'arm.urdf')])
def test_a_signal_ends_it_in_order_while_a_page_is_open(name, arm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf())
    with NodeProcess(
            VIEWER, namespace='/ended', arguments=('--port', '0', *arm), ready=OPEN) as viewer:
        address = re.search(r'http(://\S+)', viewer.wait_for_log(OPEN))[1]
        with connect(f'ws{address}', subprotocols=[PROTOCOL], max_size=None) as page:
            page.recv(TIMEOUT)
            os.kill(viewer.pid, getattr(signal, name))
            assert viewer.wait() == 0
        assert viewer.log.count('\n') <= 2, viewer.log  # including the line of the page


def test_beyond_this_computer_there_is_a_warning_on_stderr():
    only_errors = ('sh', '-c', 'exec "$@" >/dev/null', 'sh')
    arguments = ('--port', '0', '--host', '0.0.0.0')
    with NodeProcess(VIEWER, namespace='/ended', arguments=arguments, prefix=only_errors,
                     ready=re.compile('other computers can reach this page')) as viewer:
        pass
    assert viewer.log.count('\n') == 1


class MutatingWaiter:
    """Waits for an event; while the event is first set, another waiter is added."""

    def __init__(self, event):
        self.event, self.races = event, 0

    def done(self):
        if self.races == 0:
            self.races += 1
            self.event._waiters.append(self)
        return True


def test_a_race_in_viser_neither_ends_the_sender_nor_leaves_a_waiter_asleep():
    with served() as server:
        buffer = server._websock_server.get_message_buffer()
        event, woken = asyncio.Event(), threading.Event()

        async def wait():
            await event.wait()
            woken.set()

        asyncio.run_coroutine_threadsafe(wait(), buffer.event_loop)
        wait_until(lambda: len(event._waiters) == 1, 'the waiter')
        waiter = MutatingWaiter(event)
        event._waiters.appendleft(waiter)
        usual, buffer.message_event = buffer.message_event, event
        try:
            server.gui.add_markdown('a message')
            assert woken.wait(TIMEOUT)
        finally:
            buffer.message_event = usual
    assert waiter.races == 1
