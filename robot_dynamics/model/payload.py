# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A load that is fixed to a link, in addition to the link's own inertia."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import check_scalar, check_tensor, check_vector, LARGEST_VALUE

# Relative tolerance of the triangle inequality: inertias in files have few digits.
_INERTIA_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Payload:
    """
    A rigid load: `mass` [kg], `com` (3,) [m] and `inertia` (3, 3) [kg·m²] about the COM.

    Both are expressed in the frame of `link`. Zero inertia (a point mass) is permitted.
    """

    link: str
    mass: float
    com: FloatArray
    inertia: FloatArray

    @property
    def body(self) -> pin.Inertia:
        """The load as a body of Pinocchio."""
        return pin.Inertia(self.mass, self.com, self.inertia)

    def __repr__(self) -> str:
        return f'<Payload of {self.mass:g} kg on {self.link!r}>'


def make_payload(
    link: str, mass: float, com: npt.ArrayLike = (0, 0, 0), inertia: npt.ArrayLike | None = None,
) -> Payload:
    """
    Return a checked Payload.

    Raises InvalidInputError for a negative mass, a number beyond LARGEST_VALUE, or a physically
    inconsistent inertia: the tensor must be symmetric, and its principal moments non-negative and
    each at most the sum of the other two.
    """
    mass = check_scalar('payload.inertia.m', mass, 0.0, LARGEST_VALUE)
    com = check_vector('payload.inertia.com', com, 3, ('x', 'y', 'z'), LARGEST_VALUE)
    tensor = np.zeros((3, 3)) if inertia is None else (
        check_tensor('payload.inertia', inertia, LARGEST_VALUE))
    if abs(tensor - tensor.T).max() > _INERTIA_TOLERANCE * abs(tensor).max():
        raise InvalidInputError(
            f'payload.inertia is {tensor.tolist()}, expected a symmetric tensor')
    tensor = 0.5 * (tensor + tensor.T)
    if mass == 0.0 and tensor.any():
        raise InvalidInputError(
            'payload.inertia.m is 0 with a moment of inertia, expected a mass > 0, '
            'or all zeros to clear the payload')
    _check_physical(tensor)
    # Corrects moments that are negative because of rounding, which Pinocchio would reject.
    np.fill_diagonal(tensor, np.maximum(np.diagonal(tensor), 0.0))
    return Payload(link, mass, com.copy(), tensor)


def with_payload_on(
    payloads: Iterable[Payload], link: str, payload: Payload | None,
) -> tuple[Payload, ...]:
    """
    Return the loads with `payload` instead of the load on `link`; None removes that load.

    `payload` is the last one. Without a payload and without a link (`''`), no load remains.
    """
    others = tuple(one for one in payloads if link and one.link != link)
    return others if payload is None else (*others, payload)


def describe_payloads(payloads: Iterable[Payload]) -> str:
    """Return masses and links of loads as text."""
    return ', '.join(f'{one.mass:g} kg on {one.link!r}' for one in payloads) or 'no payload'


def describe_change(before: Iterable[Payload], after: Sequence[Payload]) -> str:
    """Return the loads after a change as text, and the load that the newest one has replaced."""
    replaced = [one for one in before if after and one.link == after[-1].link]
    is_new = replaced and replaced != [after[-1]]
    return describe_payloads(after) + (
        f' (replaces {describe_payloads(replaced)})' if is_new else '')


def merged(payloads: Iterable[Payload]) -> tuple[Payload, ...]:
    """Return the same loads combined into one body per link, which has the same efforts."""
    bodies: dict[str, pin.Inertia] = {}
    for payload in payloads:
        bodies[payload.link] = payload.body + bodies.get(payload.link, pin.Inertia.Zero())
    return tuple(Payload(link, body.mass, body.lever.copy(), body.inertia.copy())
                 for link, body in bodies.items())


def _check_physical(tensor: FloatArray) -> None:
    moments = np.asarray(np.linalg.eigvalsh(tensor))
    in_words = f'payload.inertia has the principal moments {moments.tolist()} kg·m²'
    slack = _INERTIA_TOLERANCE * abs(moments).max()
    if moments[0] < -slack:
        raise InvalidInputError(
            f'{in_words}, expected none below 0')
    if moments[2] > moments[0] + moments[1] + slack:
        raise InvalidInputError(
            f'{in_words}, expected each to be at most the sum of the other two '
            '(triangle inequality)')
