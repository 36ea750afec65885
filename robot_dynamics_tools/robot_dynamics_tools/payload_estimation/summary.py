# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""An estimate as text, and as a dictionary for JSON."""

from collections.abc import Iterable
import math
from typing import Any

from robot_dynamics.model.regressor import NAMES
from robot_dynamics_tools.payload_estimation.result import NO_EFFECT, PayloadEstimate, UNITS
from robot_dynamics_tools.reporting.text_table import json_numbers, percent


def headline(estimate: PayloadEstimate) -> str:
    """Return mass and centre of mass with their standard deviations."""
    mass = f'{estimate.mass:.4g} kg ± {estimate.deviations[0]:.2g} kg'
    if not estimate.is_observable or estimate.implausible:
        return f'mass {mass} on {estimate.link!r}, {estimate.verdicts[0]}'
    com = ', '.join(
        f'{axis} without effect' if verdict == NO_EFFECT else
        f'{axis} {value:.3f} ± {deviation:.2g}' for axis, value, deviation, verdict in zip(
            'xyz', estimate.com.tolist(), estimate.com_deviations.tolist(),
            estimate.verdicts[1:4]))
    return f'mass {mass} on {estimate.link!r}, centre of mass [m]: {com}'


def data_text(estimate: PayloadEstimate) -> str:
    """Return the amount of data."""
    return (f'{estimate.duration:.1f} s: {estimate.holds} holds ({estimate.pairs} pairs and '
            f'{estimate.singles} single rests of joints), {estimate.blocks} blocks of motion')


def fit_text(estimate: PayloadEstimate) -> str:
    """Return the quality of the fit: the residual of each joint, relative to its effort."""
    listed = ', '.join(
        f'{name} {percent(residual)}' for name, residual in zip(
            estimate.joint_names, estimate.residual.tolist()) if math.isfinite(residual))
    return f'residual by the effort, RMS: {listed or "no data"}'


def parameter_rows(
    values: Iterable[float], deviations: Iterable[float], per_percent: Iterable[float],
    verdicts: Iterable[str],
) -> list[list[str]]:
    """Return a table: a row of headings, then one row per parameter of π."""
    rows = [['parameter', 'value', 'deviation', 'per 1 % of effort', 'unit', 'verdict']]
    for name, value, deviation, change, unit, verdict in zip(
            NAMES, values, deviations, per_percent, UNITS, verdicts):
        cells = 3 * ['-'] if verdict == NO_EFFECT else [
            f'{value:.4f}', f'{deviation:.2g}', f'{change:+.2g}']
        rows.append([name, *cells, unit, verdict])
    return rows


def as_dictionary(estimate: PayloadEstimate) -> dict[str, Any]:
    """Return all figures with their units; numbers that do not exist become null."""
    return {
        'link': estimate.link, 'parameters': list(NAMES), 'units': list(UNITS),
        'values': json_numbers(estimate.values), 'deviations': json_numbers(estimate.deviations),
        'verdicts': list(estimate.verdicts),
        'per_percent_of_effort': json_numbers(estimate.per_percent),
        'covariance': estimate.covariance.tolist(),
        'centre_of_mass_m': json_numbers(estimate.com),
        'centre_of_mass_deviations_m': json_numbers(estimate.com_deviations),
        'residual_by_effort': json_numbers(estimate.residual),
        'is_observable': estimate.is_observable, 'duration_s': estimate.duration,
        'holds': estimate.holds, 'pairs': estimate.pairs, 'single_rests': estimate.singles,
        'blocks_of_motion': estimate.blocks, 'friction': estimate.friction,
        'advice': list(estimate.advice), 'implausible': list(estimate.implausible),
        'remarks': list(estimate.remarks)}
