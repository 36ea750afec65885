# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the tests of the viewer, and of verbs of `ros2 dynamics`."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope='module')
def server() -> Iterator[Any]:
    """Return a server of the viewer; the modules that use it are skipped without viser."""
    from viewer_bench import served
    with served() as started:
        yield started


@pytest.fixture(scope='module')
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Return a browser; the modules that use it are skipped without one."""
    from browser import chromium
    with chromium(tmp_path_factory.mktemp('browser')) as started:
        yield started


@pytest.fixture
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Connect to servers of this computer without a proxy of the environment."""
    monkeypatch.setenv('no_proxy', '*')


@pytest.fixture(scope='module')
def dynamics_client() -> Iterator[Any]:
    """Return a client of /dynamics for all tests: the discovery takes most of the time."""
    from children import TIMEOUT
    from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
    with DynamicsClient('dynamics', TIMEOUT) as client:
        yield client


@pytest.fixture
def ask(capsys: pytest.CaptureFixture[str], dynamics_client: Any) -> Any:
    """Return a function that runs a verb: exit status, output, error output."""
    from verb_bench import asking
    return asking(capsys, dynamics_client)
