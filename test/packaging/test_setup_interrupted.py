# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`scripts/setup` interrupted during a download reports that, not a missing network."""

import os
from pathlib import Path
import shutil
import signal
import socket
import subprocess
import sys

import children
import pytest

ROOT = Path(__file__).parents[2]
UV = Path(sys.prefix, 'bin', 'uv')


@pytest.mark.skipif(
    not UV.exists(), reason='scripts/setup has not made this environment from wheels')
def test_an_interrupt_during_a_download(tmp_path: Path) -> None:
    """The index of packages is a server that accepts the connection and does not answer."""
    for name in ('scripts', 'requirements'):
        shutil.copytree(ROOT / name, tmp_path / name)
    venv = tmp_path / '.venv'
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', venv], check=True)
    (venv / 'bin' / 'uv').symlink_to(UV)
    (venv / 'made_for').write_text(f'{tmp_path}\n', encoding='utf-8')
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(children.TIMEOUT)
        index = f'http://127.0.0.1:{server.getsockname()[1]}/simple'
        process = children.popen(
            [str(tmp_path / 'scripts' / 'setup')], text=True, stderr=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, 'UV_DEFAULT_INDEX': index, 'UV_NO_CACHE': '1',
                 'ROS_PREFIX': str(tmp_path)})
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
    assert 'Installing ros libraries' in steps[0]
