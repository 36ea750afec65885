# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Replacement of elements in the text of a URDF, which leaves all other text unchanged.

Comments, order, spaces and elements that this package does not read are preserved.
"""

from collections.abc import Mapping
import html
import re
from typing import NamedTuple
from xml.parsers import expat

from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import check_document

_ENCODING = re.compile(r"""(\bencoding\s*=\s*["'])([^"']*)(["'])""")


class _Change(NamedTuple):
    """`text` replaces the bytes from `first` to `last`."""

    first: int
    last: int
    text: bytes


class _Finder:
    """Finds `<inertial>` of links and `<dynamics>` of joints, directly below the robot."""

    def __init__(
        self, data: bytes, links: Mapping[str, str | None],
        joints: Mapping[str, Mapping[str, str]],
    ) -> None:
        self.changes: list[_Change] = []
        self._data = data
        self._links, self._joints = links, joints
        self._others: dict[str, str] = {}
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
            name = attributes.get('name', '')
            wanted = {'link': self._links, 'joint': self._joints}.get(tag, {})
            self._owner, self._others = (tag, name) if name in wanted else None, {}
        elif len(self._path) == 2 and (tag, self._path[-1][0]) == ('dynamics', 'joint'):
            self._others = attributes
        self._path.append((tag, first))

    def _text(self, tag: str, name: str) -> str | None:
        """Return the new element of an owner, with the other attributes of the replaced one."""
        if tag == 'link':
            return self._links[name]
        attributes = {**self._others, **self._joints[name]}
        listed = ''.join(f' {key}="{html.escape(value)}"' for key, value in attributes.items())
        return f'<dynamics{listed}/>'

    def _insert(self, first: int, tag: str, name: str) -> None:
        """Insert the new element directly after the opening tag of its owner."""
        text = self._text(tag, name)
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
        if len(self._path) == 1 and self._owner is not None:
            self._insert(first, *self._owner)
            self._owner = None
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
    urdf: str, inertials: Mapping[str, str | None],
    dynamics: Mapping[str, Mapping[str, str]],
) -> str:
    """
    Return the URDF with new `<inertial>` of links and attributes of `<dynamics>` of joints.

    None removes an `<inertial>`. Other attributes of `<dynamics>` are kept. The XML declaration is
    unchanged, except for an encoding other than UTF-8: the result is to be written in UTF-8.
    Raises ModelError if the text is not valid XML, is too large or has a
    DTD.
    """
    check_document(urdf)
    text = urdf.lstrip('\ufeff \t\r\n')
    head = text.index('?>') + 2 if text.startswith('<?xml') else 0
    prefix, body = _ENCODING.sub(_as_utf8, text[:head]), text[head:].encode()
    finder = _Finder(body, inertials, dynamics)
    finder.run()
    for change in sorted(finder.changes, reverse=True):
        body = body[:change.first] + change.text + body[change.last:]
    return prefix + body.decode()


def _as_utf8(declared: re.Match[str]) -> str:
    return declared[0] if declared[2].lower() == 'utf-8' else f'{declared[1]}UTF-8{declared[3]}'
