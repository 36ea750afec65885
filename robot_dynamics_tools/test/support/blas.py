# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Environments in which numpy runs with different BLAS kernels and numbers of threads."""

import os
from pathlib import Path
import platform

import pytest

CPU_FLAGS = {'Nehalem': 'sse4_2', 'Sandybridge': 'avx', 'Haswell': 'avx2', 'SkylakeX': 'avx512f'}
"""Processor features that a kernel of OpenBLAS needs, from the slowest to the fastest."""


def blas_environments() -> dict[str, dict[str, str]]:
    """
    Return environments by name: slowest kernel with one thread, and fastest with two threads.

    The test is skipped on other machines than x86_64.
    """
    if platform.machine() != 'x86_64':
        pytest.skip('OPENBLAS_CORETYPE selects kernels of x86_64 here')
    flags = Path('/proc/cpuinfo').read_text(encoding='ascii').split()
    kernels = [kernel for kernel, flag in CPU_FLAGS.items() if flag in flags]
    return {
        f'{kernel}, threads {threads}': {
            **os.environ, 'OPENBLAS_CORETYPE': kernel, 'OPENBLAS_NUM_THREADS': threads}
        for kernel, threads in ((kernels[0], '1'), (kernels[-1], '2'))}
