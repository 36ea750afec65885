# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The server of the viewer: permitted connections, ports, and a race in viser."""

import asyncio
import errno
import http.client
import os
import threading

from fault_table import fault
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics_tools.viewer.server import (
    address_of,
    is_loopback,
    new_token,
    start_server,
    stop_server,
)
from robots import must_have_everything
from ros_harness import TIMEOUT, wait_until

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
import msgspec
from viewer_bench import connected, PROTOCOL, served, TESTED_TOKEN
import viser
import websockets.asyncio.server
from websockets.exceptions import InvalidStatus

pytestmark = pytest.mark.usefixtures('_no_proxy')


# --- permitted connections -----------------------------------------------------------------------

@pytest.mark.parametrize('origin', [
    pytest.param('http://evil.example', marks=fault(
        'External files and web pages',
        'a web page of another origin opens the WebSocket of the viewer',
        'rejected with status 403')), 'http://evil.example:{port}',
    'http://localhost.evil.example:{port}', 'http://evil.example/http://localhost:{port}',
    'null', 'http://localhost', 'http://127.0.0.1:1{port}'])
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


def status_of(server, host, origin=None, **options):
    """Return the status of a request with these headers."""
    return answer_to(server, host, origin, **options)[0]


def answer_to(server, host, origin=None, upgrade=False, token=TESTED_TOKEN, cookie=None):
    """Return the status of a request with these headers, and the cookie of the response."""
    address, port = server.get_host(), server.get_port()
    connection = http.client.HTTPConnection(address, port, timeout=TIMEOUT)
    headers = {'Host': host.format(port=port)}
    if origin:
        headers['Origin'] = origin.format(port=port)
    if upgrade:
        headers |= {'Upgrade': 'websocket', 'Connection': 'Upgrade', 'Sec-WebSocket-Version': '13',
                    'Sec-WebSocket-Key': 'AAAAAAAAAAAAAAAAAAAAAA==',
                    'Sec-WebSocket-Protocol': PROTOCOL}
    if cookie:
        headers['Cookie'] = cookie
    try:
        connection.request('GET', f'/?token={token}' if token else '/', headers=headers)
        response = connection.getresponse()
        return response.status, response.getheader('Set-Cookie')
    finally:
        connection.close()


@pytest.mark.parametrize('upgrade', [False, True])
def test_only_requests_for_its_own_address_are_answered(server, upgrade):
    for host in ('127.0.0.1:{port}', 'localhost:{port}', '[::1]:{port}'):
        assert status_of(server, host, upgrade=upgrade) == (101 if upgrade else 200), host
    for host in ('localhost', 'localhost:1', 'evil.example:{port}',
                 '127.0.0.1.evil.example:{port}', ''):
        assert status_of(server, host, upgrade=upgrade) == 403, host


@pytest.mark.parametrize('upgrade', [False, True])
def test_a_request_needs_the_token(server, upgrade):
    assert len({new_token() for _ in range(100)}) == 100
    assert len(new_token()) >= 20
    accepted, host = 101 if upgrade else 200, '127.0.0.1:{port}'
    for token in ('', 'another', TESTED_TOKEN[:-1], f'{TESTED_TOKEN}x'):
        assert status_of(server, host, upgrade=upgrade, token=token) == 403, token
    status, cookie = answer_to(server, host)
    assert status == 200
    assert cookie.endswith('; Path=/; HttpOnly; SameSite=Strict')
    own = cookie.partition(';')[0]
    assert status_of(server, host, upgrade=upgrade, token='', cookie=own) == accepted
    assert status_of(server, host, upgrade=upgrade, token='', cookie=f'a=b; {own}') == accepted
    for other in (own[:-1], f'x{own}', own.replace('=', '_=')):
        assert status_of(server, host, upgrade=upgrade, token='', cookie=other) == 403, other


def test_beyond_this_computer_a_page_must_come_from_the_address_that_it_asks():
    server = start_server('0.0.0.0', 0, 'a page', TESTED_TOKEN)
    try:
        for origin, status in (('http://robot.example:{port}', 200), (None, 200),
                               ('https://robot.example:{port}', 200),
                               ('http://robot.example', 403), ('http://evil.example', 403)):
            assert status_of(server, 'robot.example:{port}', origin) == status, origin
    finally:
        stop_server(server)


def test_what_is_this_computer_alone():
    for host in ('127.0.0.1', '127.1.2.3', 'localhost', '::1'):
        assert is_loopback(host)
    for host in ('', '0.0.0.0', '::', '128.0.0.1', 'localhost.example.com'):
        assert not is_loopback(host)


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
            page = address_of(server, TESTED_TOKEN).partition('/?')[0]
            with connected(server, origin=page) as connection:
                connection.recv(TIMEOUT)
    assert websockets.asyncio.server.serve is serve
    assert capsys.readouterr() == ('', '')


@pytest.mark.parametrize(('host', 'reason'), [
    ('127.0.0.1', errno.EADDRINUSE), ('203.0.113.1', errno.EADDRNOTAVAIL)])
def test_a_port_that_cannot_be_had_is_reported(server, host, reason):
    with pytest.raises(InvalidInputError) as error:
        start_server(host, server.get_port(), 'another', TESTED_TOKEN)
    assert str(error.value) == (
        f"--port is {server.get_port()} at --host '{host}', where the page cannot be served "
        f"({os.strerror(reason)}); expected a free port (0 finds one) of this computer's address")


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
