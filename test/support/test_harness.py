# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Test infrastructure: children end with the tests, and a failed fixture is reported once."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import blocked_ends
from children import is_gone, popen, run
import pytest
from ros_harness import DYNAMICS, NodeProcess, wait_until
from shared_memory import DIRECTORY, files_in_use, remove_orphans, SEGMENT

TEST_RUN = """
import sys
from ros_harness import DYNAMICS, NodeProcess
node = NodeProcess(DYNAMICS, namespace='/orphan').start()
print(node.pid, flush=True)
sys.stdin.read()
"""
"""Starts a node as the tests do, and keeps running."""
IGNORED = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""
"""Executes Python with these arguments and SIGINT ignored, like a background job of a script."""
INTERRUPTED = """
import sys
from children import run

def test_a_child_is_interrupted():
    child = 'import os, signal; os.kill(os.getpid(), signal.SIGINT); print("still here")'
    done = run([sys.executable, '-c', child], capture_output=True, text=True)
    assert 'KeyboardInterrupt' in done.stderr
    assert not done.stdout
"""
SHARED = """
import pytest

@pytest.fixture(scope='module')
def node():
    raise AssertionError('the log of the node')

@pytest.mark.parametrize('case', range(3))
def test_it(node, case):
    pass
"""
HERE = Path(__file__).parent


def path_with_tests() -> dict[str, str]:
    """Return an environment in which the test helpers can be imported."""
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(
        [str(HERE), os.environ.get('PYTHONPATH', '')])}


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='PR_SET_PDEATHSIG is of Linux')
def test_a_node_ends_with_a_test_run_that_is_killed():
    with popen(
            [sys.executable, '-c', TEST_RUN], env=path_with_tests(), stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, text=True) as test_run:
        pid = int(test_run.stdout.readline())
        assert not is_gone(pid)
        test_run.kill()
    try:
        wait_until(lambda: is_gone(pid), 'the end of the node')
    finally:
        if not is_gone(pid):
            os.kill(pid, signal.SIGKILL)


def pytest_here(directory: Path, text: str, *prefix: str) -> 'subprocess.CompletedProcess[str]':
    """Run this test module with the conftest of the tests."""
    (directory / 'conftest.py').symlink_to(HERE.parent / 'conftest.py')
    (directory / 'test_it.py').write_text(text, encoding='utf-8')
    return run(
        [sys.executable, *prefix, '-m', 'pytest', '-q', '-p', 'no:cacheprovider',
         str(directory)], env=path_with_tests(), cwd=directory, capture_output=True, text=True)


def test_children_can_be_interrupted_where_the_run_ignores_sigint(tmp_path):
    """A shell script starts its background jobs with SIGINT ignored, and children inherit that."""
    done = pytest_here(tmp_path, INTERRUPTED, '-c', IGNORED)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_log_of_a_shared_fixture_is_reported_once(tmp_path):
    """Each test that needs the fixture is an error; the first one has the reason."""
    out = pytest_here(tmp_path, SHARED).stdout
    assert '3 errors' in out
    assert out.count('E       AssertionError: the log of the node') == 1, out
    assert out.count('as the report of test_it.py::test_it[0] shows') >= 2, out


@pytest.mark.skipif(not DIRECTORY.is_dir(), reason='there is no /dev/shm')
def test_shared_memory_of_a_killed_node_is_removed():
    """The memory of a running node stays, including its mappings of the killed one."""
    with NodeProcess(DYNAMICS, namespace='/running') as running:
        killed = NodeProcess(DYNAMICS, namespace='/killed').start()
        of_killed, of_running = (
            set(filter(SEGMENT.fullmatch, files_in_use(Path('/proc', str(node.pid)))))
            for node in (killed, running))
        killed.kill()
        removed = set(remove_orphans())
        assert not of_running & removed
        assert all(SEGMENT.fullmatch(name) for name in removed), 'a port belongs to all nodes'
        assert of_running <= set(os.listdir(DIRECTORY))
    assert of_killed - of_running

    def left() -> set[str]:
        """Return files that no process uses; other test processes may use the remaining ones."""
        remove_orphans()
        used = {name for process in Path('/proc').glob('[0-9]*') for name in files_in_use(process)}
        return of_killed & set(os.listdir(DIRECTORY)) - used

    wait_until(lambda: not left(), 'the removal of what the killed node left')


def test_one_end_that_fast_dds_blocks_is_no_failure(monkeypatch):
    monkeypatch.setattr(blocked_ends, '_seen', [])
    log = f'Ending: no command was active.\n{blocked_ends.WATCHDOG}\n  {blocked_ends.PLACE}\n'
    assert not blocked_ends.is_excused(log.replace(blocked_ends.PLACE, 'in _spin'))
    assert blocked_ends.is_excused(log)
    assert not blocked_ends.is_excused(log)
