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

"""The efforts that a trajectory takes at its points, and whether the arm has them."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from robot_dynamics.arm_dynamics import ArmDynamics
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.trajectory import ActiveTrajectory, JointTrajectory, Reference
from robot_dynamics.validation import FloatArray


class TrajectoryEfforts(NamedTuple):
    """
    Efforts (points, n) at the points, and where they come closest to the arm's limits.

    `worst_ratio` is |value| / limit of `worst_joint` at `worst_time` [s] from the start, and
    `worst_limit` says of what: 'effort', or with motors 'current' or 'voltage', which are steady
    (`Actuators.load`). Without any limit it is 0.
    """

    efforts: FloatArray
    feasible: bool
    worst_joint: str
    worst_ratio: float
    worst_time: float
    worst_limit: str


def trajectory_efforts(dynamics: ArmDynamics, trajectory: JointTrajectory) -> TrajectoryEfforts:
    """
    Return inverse dynamics along a trajectory, whose joints are in the arm's order.

    A point's own velocity and acceleration are used; what it leaves out is what the
    interpolation has at that time.
    """
    q, v, a = (np.array(rows) for rows in zip(*_motion(trajectory)))
    efforts = dynamics.inverse_dynamics_batch(q, v, a)
    shares = _shares(dynamics.arm, efforts, v, a)
    ratios = np.array(list(shares.values()))
    limit, i, joint = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    worst = float(ratios[limit, i, joint])
    return TrajectoryEfforts(
        efforts, worst <= 1.0, dynamics.arm.joint_names[joint], worst,
        trajectory.points[i].time_from_start, list(shares)[limit])


def _motion(trajectory: JointTrajectory) -> Iterator[Reference]:
    """Yield position, velocity and acceleration at each point."""
    first = trajectory.points[0].position
    at_rest = Reference(first, np.zeros_like(first), np.zeros_like(first))
    active = ActiveTrajectory(trajectory, 0, 0, at_rest)
    for point in trajectory.points:
        v, a = point.velocity, point.acceleration
        if v is None or a is None:
            sample = active.sample(round(1e9 * point.time_from_start))
            v, a = sample.velocity if v is None else v, sample.acceleration if a is None else a
        yield Reference(point.position, v, a)


def _shares(
    arm: ArmModel, efforts: FloatArray, v: FloatArray, a: FloatArray,
) -> dict[str, FloatArray]:
    """Return |value| / limit, (points, n), of all that is limited."""
    shares: dict[str, FloatArray] = {'effort': np.abs(efforts) / arm.limits.effort}
    if arm.actuators is not None:
        load = arm.actuators.load(efforts, v, a)
        shares.update(current=load.current_ratio, voltage=load.voltage_ratio)
    return shares
