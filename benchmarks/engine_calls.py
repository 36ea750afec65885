# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The calls of an engine, and what the modules of several engines need."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import importlib.metadata
import os
import sys
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
GRAVITY = (0.0, 0.0, -9.81)


class Calls(NamedTuple):
    """
    The calls of an engine: efforts (n,), M (n, n), accelerations (n,).

    `weight` is the gravitational acceleration [m/s²]; it differs only where an engine fixes it.
    """

    engine: str
    inverse_dynamics: Callable[[Array, Array, Array], Any]
    gravity: Callable[[Array], Any]
    mass_matrix: Callable[[Array], Any]
    forward_dynamics: Callable[[Array, Array, Array], Any]
    weight: float = -GRAVITY[2]


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress what engines print while they are loaded: build times, warnings."""
    sys.stdout.flush()
    kept = {stream: os.dup(stream) for stream in (1, 2)}
    with open(os.devnull, 'wb') as nowhere:
        for stream in kept:
            os.dup2(nowhere.fileno(), stream)
    try:
        yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)


def named(name: str, distribution: str) -> str:
    """Return the name with the installed version, if there is one."""
    try:
        return f'{name} {importlib.metadata.version(distribution)}'
    except importlib.metadata.PackageNotFoundError:
        return name  # from apt
