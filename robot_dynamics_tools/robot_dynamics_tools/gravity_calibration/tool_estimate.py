# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Mass and first moments of a tool, from the gravity parameters of a calibration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics_tools.gravity_calibration.gravity_model import (
    gravity_parameters,
    link_columns,
    NAMES,
)
from robot_dynamics_tools.gravity_calibration.scale_fit import linear_fit, ScaleFit


class Tool(NamedTuple):
    """A tool on a link that the URDF does not contain; `mass` [kg] may be unknown: None."""

    link: str
    mass: float | None = None


@dataclass(frozen=True, eq=False)
class ToolEstimate:
    """
    The mass [kg] and first moments [kg·m] of a tool in the frame of its link, (4,).

    The standard deviations and half widths of the 95 % intervals (4,) are 0 for a mass that was
    given, infinite if not observable.
    """

    link: str
    values: FloatArray
    deviations: FloatArray
    intervals: FloatArray


def estimate_tool(
    arm: ArmModel, tool: Tool, has_weight: bool, basis: FloatArray, fit: ScaleFit,
) -> ToolEstimate:
    """
    Return the tool; `basis` (4 × bodies, k) are the gravity parameters of β of the fit.

    With a known weight, β is the whole arm, and the tool is the difference to the URDF. Otherwise
    β are the first moments.
    """
    n = arm.joint_count
    given = np.array([] if tool.mass is None else [tool.mass])
    known, of_unknown = ~fit.is_lost[2 * n:], slice(len(given), len(NAMES))
    G, target = np.eye(len(fit.beta)), fit.beta
    is_lost = ~known
    if has_weight:
        T = basis.T @ link_columns(arm, tool.link)
        target = fit.beta - basis.T @ gravity_parameters(arm) - T[:, :len(given)] @ given
        G = np.zeros((len(NAMES) - len(given), len(fit.beta)))
        G[:, known], is_lost = linear_fit(
            T[known, of_unknown], fit.covariance[2 * n:, 2 * n:][np.ix_(known, known)])
    spread = fit.spread(np.column_stack([np.zeros((len(G), 2 * n)), G]))
    no_spread = np.zeros(len(given))
    return ToolEstimate(tool.link, np.concatenate([given, G @ target]), *(
        np.concatenate([no_spread, np.where(is_lost, np.inf, one)]) for one in spread))
