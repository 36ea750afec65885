# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The command line of the viewer: mistakes, signals, and warnings."""

import os
import re
import signal
import subprocess
import sys

import children
import pytest
from robot_dynamics_tools.viewer.cli import main
from robots import must_have_everything
from ros_harness import NodeProcess, TIMEOUT

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
from viewer_bench import PROTOCOL, TOOLS
from websockets.sync.client import connect

OPEN = re.compile('viewer: open')


pytestmark = pytest.mark.usefixtures('_no_proxy')


def run(*arguments, without=()):
    """Run the command to its end, as if some libraries were not installed."""
    script = (
        f'import sys; sys.modules.update(dict.fromkeys({list(without)!r}))\n'
        f'from {TOOLS}.viewer.cli import main; sys.exit(main({list(arguments)!r}))')
    return children.run(
        [sys.executable, '-c', script], capture_output=True, text=True, stdin=subprocess.DEVNULL,
        timeout=3 * TIMEOUT)


def test_help_needs_no_library():
    done = run('--help', without=('viser', 'websockets', 'trimesh', 'rclpy'))
    assert (done.returncode, done.stderr) == (0, '')
    assert all(f'--{option}' in done.stdout for option in ('host', 'port', 'robot', 'dynamics'))


def test_without_viser_one_line_names_the_installation():
    done = run('--port', '0', without=['viser'])
    assert (done.returncode, done.stdout) == (1, '')
    assert re.fullmatch(r'viewer: [^\n]*pip install viser[^\n]*\n', done.stderr), done.stderr


@pytest.mark.parametrize('arguments', [
    ('--port', '65536'), ('--port', '²'), ('--robt', 'x')])
def test_mistakes_in_the_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    line = r'viewer: [^\n]+ \(viewer --help lists the options\)\n'
    assert re.fullmatch(line, capsys.readouterr().err)


@pytest.mark.parametrize(('option', 'value', 'words'), [
    ('--robot', 'package://no_such_package/a.urdf', 'package://no_such_package/a.urdf'),
    ('--dynamics', 'no name', '')])
def test_a_value_that_cannot_be_used_is_one_line(option, value, words, monkeypatch, capsys):
    monkeypatch.setattr(signal, 'signal', lambda *_: None)  # of the tests
    assert main(['--port', '0', option, value]) == 1
    out, err = capsys.readouterr()
    assert out == ''
    assert re.fullmatch(rf'viewer: [^\n]*{re.escape(words)}[^\n]*\n', err), err


def test_a_signal_ends_it_in_order_while_a_page_is_open():
    """SIGTERM; the next test ends it by SIGINT."""
    arguments = ('viewer', '--port', '0')
    with NodeProcess(TOOLS, namespace='/ended', arguments=arguments, ready=OPEN) as viewer:
        address = re.search(r'http(://\S+)', viewer.wait_for_log(OPEN))[1]
        with connect(f'ws{address}', subprotocols=[PROTOCOL], max_size=None) as page:
            page.recv(TIMEOUT)
            os.kill(viewer.pid, signal.SIGTERM)
            assert viewer.wait() == 0
        assert viewer.log.count('\n') <= 2, viewer.log  # including the line of the page


def test_beyond_this_computer_there_is_a_warning_on_stderr():
    only_errors = ('sh', '-c', 'exec "$@" >/dev/null', 'sh')
    arguments = ('viewer', '--port', '0', '--host', '0.0.0.0')
    with NodeProcess(TOOLS, namespace='/ended', arguments=arguments, prefix=only_errors,
                     ready=re.compile('other computers can reach this page')) as viewer:
        pass
    assert viewer.log.count('\n') == 1
