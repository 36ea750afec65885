# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""All errors that this package raises on purpose, under one base class."""


LONGEST_MESSAGE = 1600
"""Largest number of characters; a message that quotes its input could be unreadably long."""


class RobotDynamicsError(Exception):
    """Base of every error that `robot_dynamics` raises on purpose."""

    def __init__(self, message: str = '') -> None:
        """Take the message; if it exceeds LONGEST_MESSAGE, its middle is omitted."""
        super().__init__(shortened(message))


def shortened(message: str) -> str:
    """Return a text of at most LONGEST_MESSAGE characters, without the middle of a longer one."""
    if len(message) <= LONGEST_MESSAGE:
        return message
    # The field comes first and the expectation last.
    kept = LONGEST_MESSAGE // 2 - 25
    left_out = len(message) - 2 * kept
    return f'{message[:kept]} … ({left_out} characters left out) … {message[-kept:]}'


class InvalidInputError(RobotDynamicsError, ValueError):
    """A value from outside cannot be used; the message names field, value and expectation."""


class ModelError(RobotDynamicsError, ValueError):
    """A robot description cannot be turned into an arm; the message names the element."""


class TrajectoryError(InvalidInputError):
    """A joint trajectory cannot be followed; the message names the point and the field."""


class JointNamesError(TrajectoryError):
    """A joint trajectory is for other joints than those of the arm."""


class PastTrajectoryError(TrajectoryError):
    """A joint trajectory ended before now, by its stamp."""


class RecordingError(RobotDynamicsError, ValueError):
    """A recording cannot be read or does not contain the requested data."""


class MissingDependencyError(RobotDynamicsError, ImportError):
    """An optional library is not installed; the message names it and the ways to install it."""
