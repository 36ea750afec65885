# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the fault tests."""

import pytest


@pytest.fixture(scope='module')
def bench(client, request):
    """
    Return a running node and its driver, in a namespace with the name of the test module.

    `BENCH` of the module has further arguments of `fault_bench`. By default the node holds the
    arm at `Q`, and commands g(q); tests restore this state.
    """
    from fault_bench import fault_bench
    name = request.path.stem.removeprefix('test_')
    with fault_bench(client, f'/{name}', **getattr(request.module, 'BENCH', {})) as one:
        yield one


@pytest.fixture
def holding(bench):
    """Check before and after a test that the node commands g(q), without an error."""
    bench.check_alive()
    yield
    bench.check_alive()


@pytest.fixture(scope='module')
def control(bench):
    """Return checks that control continues during requests."""
    from request_bench import ControlContinues
    return ControlContinues(bench)
