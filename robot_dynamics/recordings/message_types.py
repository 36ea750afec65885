# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Decoding of the messages of a recording, by its own definitions or by the common ones."""

from collections.abc import Iterable
from typing import Any

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.recordings.storage import StoredTopic
from robot_dynamics.recordings.topics import common_types
from robot_dynamics.recordings.type_checks import (
    check_field_count,
    check_types,
    LARGEST_DEFINITION,
)

_DAMAGED = (AssertionError, NameError, RecursionError, SyntaxError, ValueError)
"""
Errors that rosbags raises for damaged definitions, in addition to its own errors.

rosbags makes Python classes from definitions: a damaged name or number may be invalid Python.
"""
_UNDECODABLE = (KeyError, OverflowError, RecursionError)
"""
Errors that rosbags raises when it decodes a message, in addition to its own errors.

KeyError: a type without a definition; OverflowError: an array longer than any memory;
RecursionError: a type that contains itself.
"""


class MessageTypes:
    """Decodes messages by the definitions in the recording, or else by those of ROS 2 Jazzy."""

    def __init__(self) -> None:
        typesys = optional('rosbags.typesys', 'a recording')
        self._typesys = typesys
        self._common = common_types()
        self._own = typesys.get_typestore(typesys.Stores.EMPTY)
        self.errors = (optional('rosbags.serde', 'a recording').SerdeError, *_UNDECODABLE)
        """The errors that `deserialize` raises for a message that cannot be decoded."""
        self._refused: dict[str, RecordingError] = {}
        self._counted: set[str] = set()

    def learn(self, topics: Iterable[StoredTopic]) -> None:
        """
        Store the definitions of topics; definitions that cannot be read are skipped.

        A definition that is rejected (see `type_checks`) is replaced with the definition of ROS 2
        Jazzy, if there is one.
        """
        for topic in topics:
            if topic.message_type in self._own.fielddefs or not topic.definition:
                continue
            try:
                types = self._parse(topic)
                check_types(types)
                self._own.register({
                    name: fields for name, fields in types.items()
                    if name not in self._own.fielddefs})
            except RecordingError as error:
                self._refused[topic.message_type] = error
            except (self._typesys.TypesysError, *_DAMAGED):
                continue

    def _parse(self, topic: StoredTopic) -> dict[str, Any]:
        if len(topic.definition) > LARGEST_DEFINITION:
            raise RecordingError(
                f'message type {topic.message_type!r} has a definition of '
                f'{len(topic.definition)} characters, expected at most {LARGEST_DEFINITION}')
        if topic.encoding == 'MSG':
            return dict(self._typesys.get_types_from_msg(topic.definition, topic.message_type))
        separator = 80 * '=' + '\n'
        if not topic.definition.startswith(f'{separator}IDL: '):
            return dict(self._typesys.get_types_from_idl(topic.definition))
        types: dict[str, Any] = {}
        for part in topic.definition.split(separator)[1:]:
            types |= self._typesys.get_types_from_idl(part.partition('\n')[2])
        return types

    def deserialize(self, data: bytes, message_type: str) -> Any:
        """
        Return a message.

        Raises RecordingError if its definition was rejected, and one of `errors` if the message
        cannot be decoded.
        """
        own = message_type in self._own.fielddefs
        if not own and message_type in self._refused and (
                message_type not in self._common.fielddefs):
            raise self._refused[message_type]
        if own and message_type not in self._counted:
            check_field_count(message_type, self._own.fielddefs)
            self._counted.add(message_type)
        return (self._own if own else self._common).deserialize_cdr(data, message_type)
