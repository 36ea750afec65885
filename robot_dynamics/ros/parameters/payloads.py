# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The payloads of a node: a list by link, checked for its arm."""

from collections.abc import Iterable, Sequence

from geometry_msgs.msg import InertiaStamped
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import Payload, with_payload_on
from robot_dynamics.model.payload_check import check_payloads
from robot_dynamics.ros.middleware.conversions import payload_from_ros
from robot_dynamics.ros.parameters.declared_parameters import flag, Values

PAYLOAD_SPEC = flag('allow_implausible_payload', False, (
    'Accept payloads that are rejected by default: those whose weight exceeds the effort limits '
    'in more than 99 % of the poses of the arm, and those whose centre of mass is farther from '
    'the origin of their link than 2 times the reach of the arm.'))
_REMEDY = ' (allow_implausible_payload: true accepts it)'


def changed_payloads(
    arm: ArmModel, payloads: Iterable[Payload], message: InertiaStamped, values: Values,
) -> tuple[Payload, ...]:
    """
    Return the payloads after a request that sets or removes the payload of one link.

    A mass of 0 removes the payload of the link in `frame_id`, and all payloads if it is empty.
    Raises InvalidInputError for a payload that is not physical, or implausible on this arm.
    """
    payload = payload_from_ros(arm, message)
    changed = with_payload_on(payloads, message.header.frame_id, payload)
    if payload is not None:
        check_all(arm, changed, values)
    return changed


def payload_warnings(arm: ArmModel, payloads: Sequence[Payload], values: Values) -> list[str]:
    """Return why these payloads are implausible, if `allow_implausible_payload` permits them."""
    if not values[PAYLOAD_SPEC.name]:
        return []
    try:
        check_payloads(arm, payloads)
    except InvalidInputError as error:
        return [str(error)]
    return []


def check_all(arm: ArmModel, payloads: Iterable[Payload], values: Values) -> None:
    """Raise InvalidInputError for an unknown link, or for an implausible payload."""
    loads = tuple(payloads)
    if not values[PAYLOAD_SPEC.name]:
        check_payloads(arm, loads, _REMEDY)
    for payload in loads:
        arm.link_frame(payload.link, 'payload.header.frame_id')
