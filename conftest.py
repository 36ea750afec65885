# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Shared by all tests: a separate ROS domain, and fixtures for ROS.

Without ROS, modules that import a ROS package are skipped; the reason is reported.
"""

from collections.abc import Generator, Iterator
from contextlib import suppress
from importlib.util import find_spec
import itertools
import json
import os
from pathlib import Path
import re
import signal
import socket
from typing import Any, TYPE_CHECKING

from fault_table import COLLECTED, Row, row_of, seen_words, write_page
from largest_error import ERRORS
import pytest
from robots import must_have_everything
from shared_memory import remove_orphans

if TYPE_CHECKING:
    from ros_harness import RosClient


def reserve_domain(port: socket.socket) -> str:
    """
    Return a free ROS domain; no other test run, and no demo, takes it while the socket is open.

    A domain is free if the port of its first participant is unused (7410 + 250 × domain, OMG
    DDSI-RTPS 2.3, section 9.6.1). Participants of the domain take the next ports.
    """
    for domain in range(1, 102):
        with suppress(OSError):
            port.bind(('', 7410 + 250 * domain))
            return str(domain)
    raise OSError('no ROS domain from 1 to 101 is free')


# Concurrent test runs and other nodes of this machine must not exchange messages.
# LOCALHOST uses shared memory and UDP in any case; with other ranges UDP suffices.
if 'ROS_DOMAIN_ID' not in os.environ or 'PYTEST_XDIST_WORKER' in os.environ:
    # (a worker inherits the domain of its parent process)
    DOMAIN_PORT = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    os.environ['ROS_DOMAIN_ID'] = reserve_domain(DOMAIN_PORT)
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
SUPPORT = Path(__file__).parent / 'test' / 'support'
os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(SUPPORT / 'fast_discovery.xml'))

# A process ignores SIGHUP if `nohup` has started the tests, and tests close terminals.
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# `colcon test` passes its own options (the file for the results, paths) in this variable; a pytest
# that a test starts would read them too.
os.environ.pop('PYTEST_ADDOPTS', None)

# The background job of a shell script ignores SIGINT, which processes started by it inherit: tests
# could not interrupt theirs. A handler is not inherited, and leaves them the default.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The verdict of a property must not depend on the load of the machine, nor on chance.
if find_spec('hypothesis') is not None:
    from hypothesis import settings
    settings.register_profile('suite', deadline=None, derandomize=True)
    settings.load_profile('suite')

NEEDED_FOR_ROS = ('rclpy', 'robot_dynamics_interfaces')
IMPORTS_ROS = re.compile(
    r'^(from|import) (ros_harness|fault_bench|fuzz_nodes|rclpy|'
    r'robot_dynamics_interfaces|robot_dynamics\.ros|robot_dynamics_tools\.(monitor|viewer|mujoco\.mujoco_arm)|'
    r'builtin_interfaces|\w+_msgs|std_srvs|rcl_interfaces)\b', re.MULTILINE)


def absent_for_ros() -> list[str]:
    """Return the modules that cannot be imported; a directory of that name is not a package."""
    specs = {name: find_spec(name) for name in NEEDED_FOR_ROS}
    return [name for name, spec in specs.items() if spec is None or spec.origin is None]


class ModuleWithoutRos(pytest.Module):
    """Replaces a test module that cannot be imported here."""

    def collect(self) -> Iterator[pytest.Item]:
        reason = f'{self.path.name} needs ROS, and {absent_for_ros()} cannot be imported'
        if must_have_everything():
            raise self.CollectError(f'{reason}; with CI set this is a failure')
        pytest.skip(reason, allow_module_level=True)


def pytest_pycollect_makemodule(
    module_path: Path, parent: pytest.Collector,
) -> pytest.Module | None:
    if not absent_for_ros():
        return None
    if not IMPORTS_ROS.search(module_path.read_text(encoding='utf-8')):
        return None
    module: ModuleWithoutRos = ModuleWithoutRos.from_parent(parent, path=module_path)
    return module


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With `-k NAME` import only the files that contain NAME: all of them take 20 s."""
    words = re.findall(r'\w+', config.option.keyword)
    if not words or {'not', 'and', 'or'} & set(words) or collection_path.suffix != '.py':
        return None
    text = f'{collection_path}\n{collection_path.read_text(encoding="utf-8")}'.lower()
    return None if all(word.lower() in text for word in words) else True


ROWS: pytest.StashKey[dict[str, Row]] = pytest.StashKey()
BROKEN: pytest.StashKey[dict[int, tuple[BaseException, str]]] = pytest.StashKey()
"""Errors of fixtures by identity, each with the test that met it first."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        '--write-fault-table', action='store_true',
        help='write the results of the fault tests to docs/evidence/fault_tests.md')
    parser.addoption(
        '--list-faults', metavar='FILE', help='write the faults that are collected, as JSON')


def pytest_configure(config: pytest.Config) -> None:
    config.stash[ROWS] = {}
    config.stash[BROKEN] = {}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    config.stash[COLLECTED] = list(filter(None, map(row_of, items)))
    if 'PYTEST_XDIST_WORKER' in os.environ:
        items[:] = alternating(items)


def alternating(items: list[pytest.Item]) -> list[pytest.Item]:
    """Alternate files that wait for nodes and files that compute, so that all cores are used."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    wait, compute = [], []
    for path, tests in files.items():
        waits = IMPORTS_ROS.search(path.read_text(encoding='utf-8')) is not None
        (wait if waits else compute).append(tests)
    pairs = itertools.zip_longest(wait, compute, fillvalue=())
    return [item for pair in pairs for tests in pair for item in tests]


def pytest_collection_finish(session: pytest.Session) -> None:
    rows = session.config.stash[ROWS]
    for item in session.items:
        row = row_of(item)
        if row is not None:
            rows[item.nodeid] = row
    file = session.config.getoption('--list-faults')
    if file:
        Path(file).write_text(
            json.dumps([[row.group, row.injected, row.expected] for row in rows.values()]),
            encoding='utf-8')


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None],
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    row, words = item.config.stash[ROWS].get(item.nodeid), seen_words(report)
    if row is not None and words is not None and not row.seen.startswith('**'):
        row.seen = words
    if report.when == 'setup' and report.failed and call.excinfo is not None:
        say_once(item, call.excinfo.value, report)
    return report


def say_once(item: pytest.Item, error: BaseException, report: pytest.TestReport) -> None:
    """Keep the log of a failed shared fixture only in the report of the first test."""
    _, first = item.config.stash[BROKEN].setdefault(id(error), (error, item.nodeid))
    if first != item.nodeid:
        report.longrepr = f'A fixture failed, as the report of {first} shows.'


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.getoption('--write-fault-table') and not session.config.option.collectonly:
        write_page(list(session.config.stash[ROWS].values()))


def pytest_unconfigure(config: pytest.Config) -> None:
    if 'PYTEST_XDIST_WORKER' not in os.environ:  # the workers have ended
        remove_orphans()


@pytest.fixture
def seen(record_property: Any) -> Any:
    """Return a function that adds text to the observation in the table of faults."""
    return lambda words: record_property('seen', words)


@pytest.fixture
def largest_error() -> Iterator[None]:
    """Print the largest of the errors that the test has checked with `assert_small`."""
    ERRORS.clear()
    yield
    if ERRORS:
        print('largest error {:.1e}, {}'.format(*max(ERRORS)))


@pytest.fixture(scope='module')
def client() -> Iterator['RosClient']:
    """Return a ROS node of the tests, which spins in a separate thread."""
    from ros_harness import RosClient
    with RosClient() as ros_client:
        yield ros_client
