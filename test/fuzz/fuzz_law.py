# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The requirement for every input of the fuzz tests, and the conversion of messages by rclpy.

Code that takes an input either returns finite numbers, or rejects the input: it raises a
`RobotDynamicsError` with a message for the user.
"""

from array import array
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from robot_dynamics.exceptions import RobotDynamicsError

LONGEST_MESSAGE = 2000
"""Characters that a person reads to learn what is wrong."""


class RefusalError(Exception):
    """A rejection by a service, topic or parameter, with its message."""


def over_the_wire(message: Any) -> Any:
    """Return the message as its receiver gets it."""
    return deserialize_message(serialize_message(message), type(message))


def accepts(take: Callable[..., None], *inputs: Any) -> bool:
    """Return whether an input is accepted; fail if a rejection has no usable message."""
    try:
        take(*inputs)
    except (RobotDynamicsError, RefusalError) as error:
        check_words(str(error))
        return False
    return True


def check_words(words: str) -> None:
    """Fail if the message of a rejection does not explain the error to a user."""
    assert words.strip(), 'the message is empty'
    assert len(words) <= LONGEST_MESSAGE, f'{len(words)} characters: {words[:300]}…'
    assert 'internal error' not in words, words


def check_finite(value: Any, path: str = '') -> None:
    """Fail if any number in a message is not finite."""
    if hasattr(value, 'get_fields_and_field_types'):
        for field in value.get_fields_and_field_types():
            check_finite(getattr(value, field), f'{path}.{field}')
    elif isinstance(value, (float, array, np.ndarray)):
        assert np.isfinite(value).all(), f'{path} is {value}'
    elif isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        for i, entry in enumerate(value):
            check_finite(entry, f'{path}[{i}]')
