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

"""
The gain of a drive whose effort is a current, or another quantity proportional to torque.

τ = K i: the gain K [N·m/A] is identifiable if the joint bears a known load, such as that of the
URDF or of a weighed payload: i = (1/K) τ_URDF + I a / K + friction, by least squares for each
joint separately. If the load is small compared with friction, as at the last wrist joint, K is not
identifiable.
Source: M. Gautier, S. Briot, "Global identification of joint drive gains and dynamic parameters of
robots", J. Dynamic Systems, Measurement, and Control 136(5), 2014.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.identification.friction_regressor import FrictionStructure
from robot_dynamics.identification.qr_information import QrInformation

LEAST_CERTAINTY = 5.0
"""Smallest ratio of 1/K to its standard deviation with which K counts as known."""
LEAST_JOINTS = 3
LARGEST_RATIO = 2.0
"""Factor by which half of the gains may differ from their median."""
_FRICTION = FrictionStructure(sigmoid=1).columns


class DriveGains(NamedTuple):
    """
    Gains K (n,) and their standard deviations (n,), in joint effort per unit of recorded effort.

    `is_known` (n,) is false for joints whose K is not identifiable from the recorded motion.
    """

    gain: FloatArray
    deviation: FloatArray
    is_known: BoolArray

    @property
    def scale(self) -> FloatArray:
        """The gains (n,), 1 for a joint whose gain is not known."""
        return np.where(self.is_known, self.gain, 1.0)

    @property
    def differ(self) -> bool:
        """
        Return whether the gains of most joints differ, so that efforts cannot have a common unit.

        Wrong masses in the URDF at one or two joints, or a common factor of all masses, do not
        have this effect.
        """
        sizes = np.log(self.gain[self.is_known])
        if len(sizes) < LEAST_JOINTS:
            return False
        return bool(np.median(np.abs(sizes - np.median(sizes))) > np.log(LARGEST_RATIO))


def drive_gains(information: QrInformation, parameters: FloatArray) -> DriveGains:
    """Return the gains for which the efforts fit the rigid bodies with the parameters φ (p,)."""
    factors = information.together()
    n, p = len(information.joint_names), len(parameters)
    rows = max(float(information.rows.sum()), 1.0)
    samples = information.samples_per_independent_sample
    gain, deviation = np.full(n, np.nan), np.full(n, np.inf)
    for j in np.flatnonzero(information.is_measured).tolist():
        R = factors[j]
        X = np.column_stack([R[:, :p] @ parameters, R[:, p + np.array(_FRICTION)]])
        scale = np.linalg.norm(X, axis=0)
        if scale[0] <= 1e-9 * np.linalg.norm(R[:, -1]):
            continue
        scale[scale == 0.0] = 1.0
        x, *_ = np.linalg.lstsq(X / scale, R[:, -1], rcond=1e-10)
        squares = float(np.sum((X / scale @ x - R[:, -1])**2))
        covariance = np.linalg.pinv((X / scale).T @ (X / scale))
        inverse = x[0] / scale[0]
        error = np.sqrt(squares / rows * samples[j] * covariance[0, 0]) / scale[0]
        gain[j], deviation[j] = 1.0 / inverse, error / inverse**2
    known = (gain > 0.0) & (gain > LEAST_CERTAINTY * deviation)
    return DriveGains(gain, deviation, known)
