# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The residual, measured − modelled effort, of a measured motion, and its statistics."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray

_ROUNDING = 1e-12
"""Fraction of the mean square; a signal with a smaller variance is a constant."""


@dataclass(frozen=True, eq=False)
class ResidualStatistics:
    """
    The residual measured − model of m samples at n joints, each (n,).

    RMS, means and largest magnitudes are [N·m] or [N]. `relative` is the RMS of the residual
    divided by that of the measured effort. `r_squared` is 1 − Σ r² / Σ (τ − mean τ)², the fraction
    of the variance that the model explains (at best 1, negative if the mean explains more). Both
    are NaN if the measured effort is zero, or constant.
    """

    joint_names: tuple[str, ...]
    sample_count: int
    rms_measured: FloatArray
    mean_measured: FloatArray
    rms: FloatArray
    mean: FloatArray
    largest: FloatArray

    @property
    def relative(self) -> FloatArray:
        return np.sqrt(_ratio(self.rms**2, self.rms_measured**2))

    @property
    def r_squared(self) -> FloatArray:
        variance = self.rms_measured**2 - self.mean_measured**2
        constant = variance <= _ROUNDING * self.rms_measured**2
        return np.asarray(1.0 - _ratio(self.rms**2, np.where(constant, 0.0, variance)))


def residual_statistics(
    measured: FloatArray, model: FloatArray, joint_names: tuple[str, ...],
) -> ResidualStatistics:
    """Return the statistics of the residual, measured − model, both (m, n), m > 0."""
    residual = measured - model
    return ResidualStatistics(
        tuple(joint_names), len(measured), _rms(measured), np.asarray(measured.mean(axis=0)),
        _rms(residual), np.asarray(residual.mean(axis=0)),
        np.asarray(np.abs(residual).max(axis=0)))


def merged_statistics(parts: Sequence[ResidualStatistics]) -> ResidualStatistics:
    """Return the combined statistics of several parts of the same joints."""
    counts = np.array([part.sample_count for part in parts], dtype=np.float64)
    weights = counts / counts.sum()

    def mean(field: str) -> FloatArray:
        return np.asarray(weights @ np.array([getattr(part, field) for part in parts]))

    def root(field: str) -> FloatArray:
        return np.asarray(np.sqrt(weights @ np.array([getattr(part, field)**2 for part in parts])))

    return ResidualStatistics(
        parts[0].joint_names, int(counts.sum()), root('rms_measured'), mean('mean_measured'),
        root('rms'), mean('mean'), np.max([part.largest for part in parts], axis=0))


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return part / whole, NaN if the whole is 0."""
    safe = np.where(whole > 0.0, whole, 1.0)
    return np.asarray(np.where(whole > 0.0, part / safe, np.nan))
