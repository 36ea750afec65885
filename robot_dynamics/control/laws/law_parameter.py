# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a control law declares for the node: its parameters and its topics, without ROS."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from robot_dynamics.validation import check_per_joint, check_scalar, is_empty, LARGEST_VALUE


class LawParameter(NamedTuple):
    """
    A parameter of a law, by the name that it has at the node.

    `default` is a text, a number, or the numbers of an array. An array has one value for all
    `entries`, by default the joints, or one per entry; an empty one is the default. `minimum` and
    `maximum` apply to each number.
    """

    name: str
    default: str | float | tuple[float, ...]
    description: str
    minimum: float = 0.0
    maximum: float = LARGEST_VALUE
    entries: tuple[str, ...] = ()

    @property
    def is_per_joint(self) -> bool:
        """Whether the parameter has one value per joint."""
        return isinstance(self.default, tuple) and not self.entries

    def checked(self, value: Any, joint_names: Sequence[str]) -> Any:
        """
        Return a text, a number, or an array with one value per entry, None if it has no default.

        Raises InvalidInputError, which names the parameter, for an invalid value.
        """
        if isinstance(self.default, str):
            return value
        if not isinstance(self.default, tuple):
            return check_scalar(self.name, value, self.minimum, self.maximum)
        value = self.default if is_empty(value) else value
        if is_empty(value):
            return None
        entries = self.entries or joint_names
        values = check_per_joint(self.name, value, entries)
        for entry, one in zip(entries, values):
            check_scalar(f'{self.name} of {entry!r}', one, self.minimum, self.maximum)
        return values


class LawTopic(NamedTuple):
    """
    A topic to which the node subscribes for a law, such as `~/force_feedback`.

    `message_type` is a name such as `sensor_msgs/msg/JointState`; `take` gets each message.
    """

    name: str
    message_type: str
    take: Callable[[Any, Any], Any]
