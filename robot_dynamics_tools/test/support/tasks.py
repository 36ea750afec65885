# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks of the tests of `batch`, which other processes must be able to import."""

from dataclasses import dataclass
import os
from pathlib import Path
import signal

import numpy as np
from robot_dynamics.exceptions import RecordingError


@dataclass(frozen=True, eq=False)
class Factor:
    """Settings of `scale`."""

    values: np.ndarray


@dataclass(frozen=True, eq=False)
class Scaled:
    """The result of `scale`, with all types that a result may contain."""

    sizes: tuple[int, ...]
    span: tuple[str, float]
    factor: Factor
    by_name: dict[str, Factor]
    missing: Factor | None
    present: Factor | None


def scale(bag, settings: Factor) -> Scaled:
    """Return the factor, nested, with the size of the file."""
    return Scaled((len(bag.read_text()),) * 2, (bag.name, np.inf), settings, {'a': settings},
                  None, settings)


def measure(bag, configuration):
    """Record the call; fail, die or return the size, depending on the content of the file."""
    with Path(configuration['log']).open('a') as log:
        log.write(f'{bag.name}\n')
    text = bag.read_text()
    if text == 'refuse':
        raise RecordingError('this one cannot be read')
    if text == 'fail':
        raise ZeroDivisionError('an accident')
    if text == 'die':
        os.kill(os.getpid(), signal.SIGKILL)
    return {'size': len(text), 'factor': configuration['factor'] * np.arange(3.0),
            'process': os.getpid(), 'one_thread': os.environ.get('OMP_NUM_THREADS')}


def is_large(bag, result):
    """Return whether a cached result is valid; this test compares its size."""
    return result['size'] > 3
