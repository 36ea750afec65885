# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Which recordings one model cannot describe together, and how far a model is from the URDF.

Recordings of one arm with one load have a common model, whose residual is hardly larger than that
of one model per recording (G. C. Chow, Econometrica 28(3), 1960). The recording without which the
residual decreases most contradicts the others.
"""

from collections.abc import Sequence

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.regressor import COUNT
from robot_dynamics_tools.identification import regularized_fit
from robot_dynamics_tools.identification.model_selection import REGULARIZATIONS
from robot_dynamics_tools.identification.qr_information import QrInformation
from robot_dynamics_tools.pseudo_inertia import pseudo_inertia_matrix

LEAST_RATIO = 2.0
"""Ratio of the residuals of a common model and of separate ones that is a contradiction."""
LEAST_RESIDUAL = 0.01
"""Residual relative to the effort, below which a difference does not count."""
_LEAST_EIGENVALUE = 1e-9


def contradicting_recordings(
    parts: Sequence[QrInformation], problem: regularized_fit.Problem,
) -> dict[int, str]:
    """
    Return the recordings that contradict the others, by number, with a sentence about each.

    If the last two contradict each other, both are returned. `problem` is that of the common
    model.
    """
    problem = problem._replace(regularization=REGULARIZATIONS[0])
    grams = [regularized_fit.grams_of(part.together()) for part in parts]
    left, found = list(range(len(parts))), dict[int, str]()

    def squares(chosen: Sequence[int]) -> FloatArray:
        own = np.sum([grams[i] for i in chosen], axis=0)
        return regularized_fit.solve(own, problem).squares(own)

    while len(left) > 1:
        together = squares(left)
        power = np.sum([grams[i][:, -1, -1] for i in left], axis=0)
        least = np.maximum(LEAST_RESIDUAL**2 * power, 1e-300)
        ratios = [np.sqrt(np.maximum(together, least) / np.maximum(
            squares([i]) + squares([k for k in left if k != i]), least)) for i in left]
        worst = int(np.argmax([np.log(ratio).sum() for ratio in ratios]))
        joint, ratio = int(np.argmax(ratios[worst])), float(ratios[worst].max())
        if ratio < LEAST_RATIO:
            break
        is_pair = len(left) == 2
        text = (f'contradicts the other recording{"" if is_pair else "s"}: a common model has '
                f'{ratio:.1f} times the residual of separate models at '
                f'{parts[0].joint_names[joint]}: another arm, load, friction or unit')
        odd = left if is_pair else [left[worst]]
        found.update(dict.fromkeys(odd, text))
        left = [i for i in left if i not in odd]
    return found


def difference_from_urdf(fit: regularized_fit.Fit, prior: regularized_fit.Prior) -> FloatArray:
    """
    Return how much each body of a consistent fit differs from that of the URDF, (b,).

    This is the RMS of the logarithms of the eigenvalues of P₀⁻¹ P, with the pseudo-inertias P of
    the fit and P₀ of the URDF: ln 2 for a body of twice the density. (T. Lee, F. C. Park, IEEE
    Robotics and Automation Letters 3(3), 2018.)
    """
    differences = []
    for phi, L in zip(fit.parameters.reshape(-1, COUNT), prior.roots):
        inverse = np.linalg.inv(L)
        ratios = np.linalg.eigvalsh(inverse @ pseudo_inertia_matrix(phi) @ inverse.T)
        differences.append(np.sqrt(np.mean(np.log(np.maximum(ratios, _LEAST_EIGENVALUE))**2)))
    return np.array(differences)


def factor_of(difference: FloatArray) -> float:
    """Return the typical factor between the bodies of these differences (b,) and the URDF."""
    return float(np.exp(np.sqrt(np.mean(difference**2))))
