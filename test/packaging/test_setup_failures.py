# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`scripts/setup` reports why a download failed: an interrupt or a certificate."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import shutil
import signal
import socket
import ssl
import subprocess
import sys

import children
import pytest

ROOT = Path(__file__).parents[2]
UV = Path(sys.prefix, 'bin', 'uv')


pytestmark = pytest.mark.skipif(
    not UV.exists(), reason='scripts/setup has not made this environment from wheels')


@contextmanager
def started(tmp_path: Path, index: str) -> Iterator['subprocess.Popen[str]']:
    """Start the script with an empty environment and this index of packages."""
    for name in ('scripts', 'requirements'):
        shutil.copytree(ROOT / name, tmp_path / name)
    venv = tmp_path / '.venv'
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', venv], check=True)
    (venv / 'bin' / 'uv').symlink_to(UV)
    (venv / 'made_for').write_text(f'{tmp_path}\n', encoding='utf-8')
    with children.popen(
            [str(tmp_path / 'scripts' / 'setup')], text=True, stderr=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, 'UV_DEFAULT_INDEX': index, 'UV_NO_CACHE': '1',
                 'UV_HTTP_RETRIES': '0', 'ROS_PREFIX': str(tmp_path)}) as process:
        yield process


def test_an_interrupt_during_a_download(tmp_path):
    """The index of packages is a server that accepts the connection and does not answer."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(children.TIMEOUT)
        with started(tmp_path, f'http://127.0.0.1:{server.getsockname()[1]}/simple') as process:
            connection, _ = server.accept()
            with connection:
                os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C in a terminal
                _, errors = process.communicate(timeout=children.TIMEOUT)
    assert process.returncode == 130, errors
    *steps, message = errors.splitlines()
    assert message == (
        'robot_dynamics: Set-up was interrupted. Run the same command again to continue: '
        'completed steps are kept.')
    assert len(steps) == 1
    assert 'Installing libraries of requirements/: ros python' in steps[0]


def test_a_certificate_that_is_not_accepted_is_named(tmp_path):
    """As behind a proxy that replaces certificates by its own."""
    key, certificate = tmp_path / 'key.pem', tmp_path / 'certificate.pem'
    children.run(
        ['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-subj', '/CN=localhost',
         '-keyout', str(key), '-out', str(certificate)], check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    with socket.create_server(('127.0.0.1', 0)) as server:
        with started(tmp_path, f'https://localhost:{server.getsockname()[1]}/simple') as process:
            server.settimeout(1.0)
            while process.poll() is None:
                with suppress(OSError):  # each attempt of the client fails
                    context.wrap_socket(server.accept()[0], server_side=True).close()
            _, errors = process.communicate(timeout=children.TIMEOUT)
    assert process.returncode == 1
    assert 'the certificate of the server was not accepted (TLS)' in errors
    assert 'SSL_CERT_FILE' in errors
