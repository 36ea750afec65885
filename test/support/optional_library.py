# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Libraries that single tests need: to compare with, or for a function of an extra."""

import importlib
from typing import Any

from robots import missing


def library(module: str) -> Any:
    """Return a module; without it, skip the test (or fail it, see `missing`)."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing(f'the test needs {module}, which is not installed ({error})')
