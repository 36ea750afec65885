# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The gain of a drive whose effort is a current, or another quantity proportional to torque.

τ = K i: the gain K [N·m/A] is identifiable if the joint bears a known load, such as that of the
URDF or of a weighed payload: i = (1/K) τ_URDF + I a / K + friction, by least squares for each
joint separately. If the load is small compared with friction, as at the last wrist joint, K is not
identifiable.
Source: M. Gautier, S. Briot, "Global identification of joint drive gains and dynamic parameters of
robots", J. Dynamic Systems, Measurement, and Control 136(5), 2014.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics_tools.estimation.effort_fit import fit_effort, Rows
from robot_dynamics_tools.identification import friction_regressor
from robot_dynamics_tools.identification.qr_information import QrInformation
from robot_dynamics_tools.identification.regularized_fit import Prior

LEAST_CERTAINTY = 5.0
"""Smallest ratio of 1/K to its standard deviation with which K counts as known."""
LEAST_JOINTS = 3
LARGEST_RATIO = 2.0
"""Factor by which half of the gains may differ from their median."""
MASS_ERROR = 0.2
"""Assumed relative error of the masses and inertias of the URDF."""
LEAST_TOTAL_CERTAINTY = 2.0
"""Smallest ratio of K to its standard deviation with errors of the masses."""
SEEMS_OFF = 2.0
"""A drive gain that differs from 1 by more than this factor suggests a unit other than N·m."""
CONFOUNDED = 2.0
"""Ratio of both deviations above which a gain is confounded with the masses of the URDF."""
_FRICTION = friction_regressor.structure('sigmoid 0.03').columns
_DRY = 1 + _FRICTION.index(friction_regressor.COLUMN_NAMES.index('sigmoid 0.03'))
"""Place of dry friction among the load and these columns."""


class GainEstimate(NamedTuple):
    """
    Gains K (n,) and their standard deviations (n,), in joint effort per unit of recorded effort.

    A gain is negative if the effort has the opposite sign. `deviation` includes errors of the
    masses of the URDF, `noise` (n,) does not. `is_known` (n,) is false for joints whose K is not
    identifiable from the recorded motion. `sign` (n,) is ±1, from the friction, which opposes the
    motion, where the load does not determine it.
    """

    gain: FloatArray
    deviation: FloatArray
    is_known: BoolArray
    noise: FloatArray
    sign: FloatArray

    @property
    def is_confounded(self) -> BoolArray:
        """Marks the gains (n,) whose deviation is mostly that of the masses of the URDF."""
        return np.asarray(self.deviation > CONFOUNDED * self.noise)

    @property
    def scale(self) -> FloatArray:
        """The gains (n,), ±1 for a joint whose gain is not known."""
        return np.where(self.is_known, self.gain, self.sign)

    @property
    def differ(self) -> bool:
        """
        Return whether the gains of most joints differ, so that efforts cannot have a common unit.

        Wrong masses in the URDF at one or two joints, or a common factor of all masses, do not
        have this effect.
        """
        sizes = np.log(np.abs(self.gain[self.is_known]))
        if len(sizes) < LEAST_JOINTS:
            return False
        return bool(np.median(np.abs(sizes - np.median(sizes))) > np.log(LARGEST_RATIO))

    @property
    def is_off(self) -> BoolArray:
        """Marks the gains (n,) far from 1, if those of most joints are: another unit."""
        size = np.abs(self.gain)
        off = self.is_known & ((size > SEEMS_OFF) | (size < 1.0 / SEEMS_OFF))
        # At one of several joints, a wrong mass is more likely.
        return np.asarray(off & (off.sum() > 0.5 * self.is_known.sum()))

    @property
    def is_reversed(self) -> BoolArray:
        """Marks the gains (n,) below 0."""
        return np.asarray(self.scale < 0.0)


def other_unit(names: Sequence[str], gains: GainEstimate) -> str:
    """Return a sentence about the joints whose effort seems to be in another unit."""
    listed = ', '.join(f'{name} ({1.0 / gain:.3g} times)' for name, gain, is_off in zip(
        names, gains.gain, gains.is_off) if is_off)
    return (f'the effort differs from the torque of the URDF at {listed}: if it is a current or '
            'in another unit, use --effort current, with the masses of the URDF as reference')


def drive_gains(information: QrInformation, prior: Prior) -> GainEstimate:
    """
    Return the gains for which the efforts fit the bodies of the URDF and the known payloads.

    The masses of the URDF have errors of `MASS_ERROR`, which are a part of the deviations. If the
    effort of a payload is a column of the information, the masses are estimated with the gain, and
    the URDF is their prior: recordings with and without a payload determine the gain by its mass.
    """
    factors, own = information.together(), np.array(_FRICTION)
    n, p = len(information.joint_names), prior.count
    counts = float(information.rows.sum()) / information.samples_per_independent_sample
    spread = MASS_ERROR * np.linalg.inv(prior.rows)
    gain, deviation, noise = np.full(n, np.nan), np.full(n, np.inf), np.full(n, np.inf)
    sign, first = np.ones(n), 1 + len(own)
    z, unit = np.eye(factors.shape[-1]), np.eye(first + p)
    known, masses = prior.parameters @ z[:p] + z[p + friction_regressor.PAYLOAD], z[:, :p] @ spread
    friction, errors = z[:, p + own] @ unit[1:first], masses @ unit[first:]
    linear = np.column_stack([known, z[:, p + own]])
    for j in np.flatnonzero(information.is_measured).tolist():
        R = factors[j]
        if np.linalg.norm(R @ known) <= 1e-9 * np.linalg.norm(R[:, -1]):
            continue
        fit = fit_effort([Rows(R, counts[j], z[-1], linear)], np.zeros(first))
        inverse, by_noise = fit.values[0], np.linalg.norm(fit.solution.back, axis=1)
        by_masses = inverse * (fit.solution.inverse[0] @ R @ masses) / np.sqrt(fit.variances)
        error = np.hypot(by_noise[0], np.linalg.norm(by_masses))
        if fit.values[_DRY] < -LEAST_CERTAINTY * by_noise[_DRY]:
            sign[j] = -1.0
        noise[j] = by_noise[0] / inverse**2 if inverse else np.inf
        if R[:, p + friction_regressor.PAYLOAD].any():
            wide = fit_effort([Rows(R, counts[j], z[-1], friction, 0, known, errors)],
                              np.zeros(first + p), prior=lambda _: unit[first:])
            of_wide = np.linalg.norm(wide.solution.back[0])
            if of_wide < error:
                inverse, error = wide.values[0], of_wide
        if inverse:
            gain[j], deviation[j] = 1.0 / inverse, error / inverse**2
    size = np.abs(gain)
    is_known = (size > LEAST_CERTAINTY * noise) & (size > LEAST_TOTAL_CERTAINTY * deviation)
    return GainEstimate(gain, deviation, is_known, noise, sign)
