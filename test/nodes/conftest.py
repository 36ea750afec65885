# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the tests of running nodes."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from fault_bench import FaultBench
    from ros_harness import RosClient
    from service_bench import Served


@pytest.fixture(scope='module')
def planar(client: 'RosClient') -> Iterator['Served']:
    """Return a node on the embedded planar arm, and its services."""
    from service_bench import served
    with served(client, '/planar') as node:
        yield node


@pytest.fixture(scope='module')
def arm_with_limits(client: 'RosClient', request: pytest.FixtureRequest) -> Iterator['FaultBench']:
    """Return a node with default parameters for an arm with limits, as left by the last test."""
    from interruption_bench import interruption_bench
    with interruption_bench(client, f'/{request.path.stem.removeprefix("test_")}') as bench:
        yield bench


@pytest.fixture
def arm(arm_with_limits: 'FaultBench') -> Iterator['FaultBench']:
    """Return this node with the arm at rest at `Q` and following `Q`."""
    from interruption_bench import following
    with following(arm_with_limits) as bench:
        yield bench
