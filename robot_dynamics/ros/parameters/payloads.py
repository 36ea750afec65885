# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The payloads of a node: a list by link, checked for its arm."""

from collections.abc import Iterable, Sequence

from geometry_msgs.msg import InertiaStamped
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import make_payload, Payload, with_payload_on
from robot_dynamics.model.payload_check import check_held_at, check_payloads
from robot_dynamics.model_check.finding import CHECKS
from robot_dynamics.ros.middleware.conversions import payload_from_ros
from robot_dynamics.ros.parameters.declared_parameters import numbers, texts, Values
from robot_dynamics.validation import LARGEST_VALUE

IGNORED = 'payload'
"""The check of payloads in `ignore_checks`."""
PAYLOAD_SPECS = (
    texts('ignore_checks', (
        'Names of model checks whose errors are logged as warnings instead of rejecting the '
        'model. payload accepts payloads whose weight exceeds the effort limits in more than 99 % '
        'of the poses of the arm, or in its present configuration, and those whose centre of mass '
        'is farther from the origin of their link than 2 times the reach of the arm.'),
        choices=(*CHECKS, IGNORED)),
    texts('payload.links', (
        'Links with a payload at the start, each once. ~/set_payload changes payloads until the '
        'node ends.'), read_only=True),
    numbers('payload.mass', 0.0, LARGEST_VALUE, (
        'Mass [kg] of each payload of payload.links.'), read_only=True),
    numbers('payload.com', -LARGEST_VALUE, LARGEST_VALUE, (
        'Centre of mass [m] of each payload in the frame of its link: x, y, z. If empty, 0.'),
        read_only=True),
    numbers('payload.inertia', -LARGEST_VALUE, LARGEST_VALUE, (
        'Inertia [kg·m²] of each payload about its centre of mass: xx, xy, xz, yy, yz, zz. If '
        'empty, 0.'), read_only=True),
)
_REMEDY = ' (ignore_checks: [payload] accepts it)'


def changed_payloads(
    arm: ArmModel, payloads: Iterable[Payload], message: InertiaStamped, values: Values,
    q: FloatArray | None = None,
) -> tuple[Payload, ...]:
    """
    Return the payloads after a request that sets or removes the payload of one link.

    `q` (n,) is the present configuration, None if it is not known. A mass of 0 removes the payload
    of the link in `frame_id`, and all payloads if it is empty. Raises InvalidInputError for a
    payload that is not physical, or implausible on this arm.
    """
    payload = payload_from_ros(arm, message)
    changed = with_payload_on(payloads, message.header.frame_id, payload)
    if payload is not None:
        check_all(arm, changed, values)
        if q is not None and IGNORED not in values['ignore_checks']:
            check_held_at(arm, changed, q, _REMEDY)
    return changed


def payloads_at_start(values: Values) -> tuple[Payload, ...]:
    """Return the payloads of the parameters; raise InvalidInputError if they do not match."""
    links = values['payload.links']
    parts = []
    for name, size in (('mass', 1), ('com', 3), ('inertia', 6)):
        field = f'payload.{name}'
        given = values[field]
        if len(given) != size * len(links) and (len(given) > 0 or name == 'mass'):
            raise InvalidInputError(
                f'{field} has {len(given)} values, expected {size} for each of payload.links '
                f'{list(links)}')
        parts.append(np.reshape(given or np.zeros(size * len(links)), (len(links), size)))
    if len(set(links)) < len(links):
        raise InvalidInputError(f'payload.links is {list(links)}, expected each link once')
    return tuple(
        make_payload(link, float(mass[0]), com, inertia[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
        for link, mass, com, inertia in zip(links, *parts))


def payload_warnings(arm: ArmModel, payloads: Sequence[Payload], values: Values) -> list[str]:
    """Return why these payloads are implausible, if `ignore_checks` permits them."""
    if IGNORED not in values['ignore_checks']:
        return []
    try:
        check_payloads(arm, payloads)
    except InvalidInputError as error:
        return [str(error)]
    return []


def check_all(arm: ArmModel, payloads: Sequence[Payload], values: Values) -> None:
    """Raise InvalidInputError for an unknown link, or for an implausible payload."""
    if IGNORED not in values['ignore_checks']:
        check_payloads(arm, tuple(payloads), _REMEDY)
    for payload in payloads:
        arm.link_frame(payload.link, 'payload.header.frame_id')
