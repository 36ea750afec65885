# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The web server of the viewer: only for its own page, and only with its token.

Any client that is accepted can move the arm. A request needs the token, in its address or in the
cookie (RFC 6265) that the first page with the token sets: other users of this computer do not know
it. A browser lets any page of any site open a connection to this computer. The headers Host and
Origin (RFC 9110, section 7.2; RFC 6454) of a request contain the server and the page: requests for
another server or from another page are rejected.
"""

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
import functools
from http import HTTPStatus
import io
import ipaddress
import re
import secrets
import socket
from typing import Any, TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError

if TYPE_CHECKING:
    import viser

_THIS_COMPUTER = re.compile(r'localhost|127(\.\d{1,3}){3}|\[::1\]')
_HTTP_PORT = 80
TOKEN = 'token'
"""Name of the token in addresses, and beginning of the name of its cookie."""


def is_loopback(host: str) -> bool:
    """Return whether only this computer can reach an address."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(16)


def start_server(host: str, port: int, title: str, token: str) -> Any:
    """
    Return a running viser server that answers requests with a token.

    Raises MissingDependencyError without viser, InvalidInputError if the port is unavailable.
    """
    viser = optional('viser', 'the viewer')
    _check_port(host, port)
    _tolerate_races()
    with redirect_stdout(io.StringIO()):  # viser prints a greeting
        with _own_pages_alone(is_loopback(host), token):
            server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    server.gui.main_panel.dock_right()
    # Without a graphics card, shadows take most of the time of a browser.
    server.scene.configure_default_lights(cast_shadow=False)
    # a page must not ask viser for a public address of this server
    server._websock_server.unregister_handler(
        optional('viser._messages', 'the viewer').ShareUrlRequest)
    return server


def stop_server(server: 'viser.ViserServer') -> None:
    """Stop a server without its message on stdout."""
    with redirect_stdout(io.StringIO()):
        server.stop()


def address_of(server: 'viser.ViserServer', token: str) -> str:
    """Return the address of the page, which contains the token."""
    host = server.get_host()
    return f'http://{f"[{host}]" if ":" in host else host}:{server.get_port()}/?{TOKEN}={token}'


def _check_port(host: str, port: int) -> None:
    """Raise InvalidInputError for an unavailable port; viser would try others without end."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise InvalidInputError(
            f'--port is {port} at --host {host!r}, where the page cannot be served '
            f'({error.strerror or error}); expected a free port (0 finds one) of this '
            "computer's address") from None


@contextmanager
def _own_pages_alone(is_local: bool, token: str) -> Iterator[None]:
    """
    Reject other pages and requests without the token, for servers that start in `with`.

    The WebSocket server of viser has no such check; it is added to the call that starts it.
    """
    from websockets.asyncio import server as sockets
    serve = sockets.serve

    def serve_own(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def checked(connection: Any, request: Any) -> Any:
            port = connection.local_address[1]
            if not _is_own(request.headers, port, is_local):
                return connection.respond(
                    HTTPStatus.FORBIDDEN,
                    f'Rejected: expected a request from the page of this viewer at port {port}.\n')
            name = f'{TOKEN}_{port}'
            if not _has_token(request, name, token):
                return connection.respond(
                    HTTPStatus.FORBIDDEN, 'Rejected: expected the address with the token that '
                    'the viewer has printed.\n')
            response = process_request(connection, request)
            if response is not None:
                response.headers['Set-Cookie'] = (
                    f'{name}={token}; Path=/; HttpOnly; SameSite=Strict')
            return response

        return serve(*arguments, process_request=checked, **options)

    sockets.serve = serve_own
    try:
        yield
    finally:
        sockets.serve = serve


def _has_token(request: Any, name: str, token: str) -> bool:
    """Return whether the address of a request or its cookie of this name has the token."""
    given = parse_qs(urlsplit(request.path).query).get(TOKEN, [])
    for header in request.headers.get_all('Cookie'):
        given += [value for one, _, value in (
            part.strip().partition('=') for part in header.split(';')) if one == name]
    return any(secrets.compare_digest(one.encode(), token.encode()) for one in given)


def _is_own(headers: Any, port: int, is_local: bool) -> bool:
    """
    Return whether a request is for this server, and from its page or from a program.

    Programs send no Origin. If others can reach the server (`is_local` is false), its name is
    unknown: then Origin must be the same as Host.
    """
    hosts, origins = headers.get_all('Host'), headers.get_all('Origin')
    if len(hosts) != 1 or len(origins) > 1:
        return False
    pages = [re.sub('^https?://', '', origin) for origin in origins]
    if not is_local:
        return all(page == hosts[0] for page in pages)
    return all(_is_own_address(address, port) for address in (*hosts, *pages))


def _is_own_address(address: str, port: int) -> bool:
    """Return whether HOST:PORT is this server; browsers omit the default port of HTTP."""
    name = address.removesuffix(f':{port}')
    return (name != address or port == _HTTP_PORT) and bool(_THIS_COMPUTER.fullmatch(name))


def _tolerate_races() -> None:
    """
    Complete a call of viser that a race between its threads interrupts.

    viser puts a message into a buffer and then calls `asyncio.Event.set` in the thread that sends
    it. That raises RuntimeError ("deque mutated during iteration") if the thread of the event loop
    begins to wait at the same moment, which ended the viewer on a busy computer. The message is
    already in the buffer: the thread of the event loop sets the event again and wakes all waiters.
    """
    from viser.infra._async_message_buffer import AsyncMessageBuffer
    push = AsyncMessageBuffer.push
    if hasattr(push, '__wrapped__'):
        return

    @functools.wraps(push)
    def push_and_wake(buffer: Any, message: Any) -> None:
        try:
            push(buffer, message)
        except RuntimeError:
            buffer.event_loop.call_soon_threadsafe(wake, buffer.message_event)

    def wake(event: Any) -> None:
        event.clear()  # otherwise `set` has no effect
        event.set()

    AsyncMessageBuffer.push = push_and_wake

