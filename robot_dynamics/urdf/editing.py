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

"""
Replacement of elements in the text of a URDF, which leaves every other character unchanged.

Comments, order, spaces and elements that this package does not read are preserved.
"""

from collections.abc import Mapping
from typing import NamedTuple
from xml.parsers import expat

from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import check_document


class _Change(NamedTuple):
    """`text` replaces the bytes from `first` to `last`."""

    first: int
    last: int
    text: bytes


class _Finder:
    """Finds `<inertial>` of links and `<dynamics>` of joints, directly below the robot."""

    def __init__(
        self, data: bytes, links: Mapping[str, str | None], joints: Mapping[str, str],
    ) -> None:
        self.changes: list[_Change] = []
        self._data = data
        self._wanted: dict[tuple[str, str], str | None] = {
            **{('link', name): text for name, text in links.items()},
            **{('joint', name): text for name, text in joints.items()}}
        self._path: list[tuple[str, int]] = []
        self._owner: tuple[str, str] | None = None
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end

    def run(self) -> None:
        try:
            self._parser.Parse(self._data, True)
        except expat.ExpatError as error:
            raise ModelError(f'robot_description is not valid XML: {error}') from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        first = self._parser.CurrentByteIndex
        if len(self._path) == 1:
            owner = (tag, attributes.get('name', ''))
            self._owner = owner if owner in self._wanted else None
            if self._owner is not None:
                self._insert(first, tag)
        self._path.append((tag, first))

    def _insert(self, first: int, tag: str) -> None:
        """Insert the new element directly after the opening tag of its owner."""
        text = self._wanted[self._owner] if self._owner is not None else None
        if text is None:
            return
        last = _end_of_tag(self._data, first)
        if self._data[last - 2:last] == b'/>':
            self.changes.append(_Change(
                last - 2, last, f'>\n    {text}\n  </{tag}>'.encode()))
        else:
            self.changes.append(_Change(last, last, f'\n    {text}'.encode()))

    def _end(self, tag: str) -> None:
        _, first = self._path.pop()
        if len(self._path) == 2 and self._owner is not None and (self._owner[0], tag) in (
                ('link', 'inertial'), ('joint', 'dynamics')):
            end = self._parser.CurrentByteIndex
            # for an element without content, the position is already behind it
            last = _end_of_tag(self._data, end) if self._data[end:end + 2] == b'</' and (
                self._data[end + 2:].startswith(tag.encode())) else end
            before = self._data[:first].rstrip(b' \t')
            if before.endswith(b'\n'):  # also remove the line that would remain empty
                first = len(before.removesuffix(b'\n').removesuffix(b'\r'))
            self.changes.append(_Change(first, last, b''))


def _end_of_tag(data: bytes, first: int) -> int:
    """Return the offset after the > of the tag that begins at `first`."""
    quote = 0
    for i in range(first, len(data)):
        byte = data[i]
        if quote:
            quote = 0 if byte == quote else quote
        elif byte in b'"\'':
            quote = byte
        elif byte == ord('>'):
            return i + 1
    return len(data)


def with_elements(
    urdf: str, inertials: Mapping[str, str | None], dynamics: Mapping[str, str],
) -> str:
    """
    Return the URDF with new `<inertial>` elements of links and `<dynamics>` of joints, by name.

    None removes the element. Raises ModelError if the text is not valid XML, is too large or has a
    DTD.
    """
    check_document(urdf)
    data = urdf.strip().encode()
    declared = data.startswith(b'<?xml')
    # the text is UTF-8 now, regardless of its declaration
    head = data.index(b'?>') + 2 if declared else 0
    prefix, body = (b'<?xml version="1.0"?>' if declared else b''), data[head:]
    finder = _Finder(body, inertials, dynamics)
    finder.run()
    for change in sorted(finder.changes, reverse=True):
        body = body[:change.first] + change.text + body[change.last:]
    return (prefix + body).decode() + '\n'
