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

"""Fixtures of the tests of the viewer."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope='module')
def server() -> Iterator[Any]:
    """Return a server of the viewer; the modules that use it are skipped without viser."""
    from viewer_bench import served
    with served() as started:
        yield started


@pytest.fixture
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Connect to servers of this computer without a proxy of the environment."""
    monkeypatch.setenv('no_proxy', '*')
