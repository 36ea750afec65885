# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks of the XML of a description before it is parsed: a limited size, and no DTD.

A document type declaration (DTD) may define entities. A parser expands them while it reads: a
document of 390 KB becomes gigabytes of elements. No URDF, xacro or Collada file needs one.
Source: Extensible Markup Language (XML) 1.0, section 2.8 (prolog and document type declaration)
and appendix F (detection of the encoding).
"""

import codecs
import re

from robot_dynamics.exceptions import ModelError

LARGEST_DESCRIPTION = 10_000_000
"""Limit in characters for a description in a file or a parameter, in bytes for one on a topic."""

# Elements that XML permits before a DTD or the root element; both end at their first closing mark.
_PROLOG = re.compile(r'(?:[\s\ufeff]+|<\?.*?\?>|<!--.*?-->)*', re.DOTALL)
_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def find_dtd(document: str | bytes) -> str:
    """
    Return the first characters of the DTD of an XML document, '' if it has none.

    The document is not parsed, and no entity is expanded.
    """
    text = document if isinstance(document, str) else _as_text(document)
    prolog = _PROLOG.match(text)
    start = 0 if prolog is None else prolog.end()
    return text[start:start + 40] if text.startswith('<!', start) else ''


def _as_text(data: bytes) -> str:
    """
    Return the bytes of an XML document with at least its markup decoded.

    Besides UTF-16, a parser accepts only encodings in which markup has the bytes of ASCII.
    """
    if data[:2] in _MARKS or b'\0' in data[:2]:
        big = data[:2] == codecs.BOM_UTF16_BE or data[:1] == b'\0'
        return data.decode('utf-16-be' if big else 'utf-16-le', errors='replace')
    return data.decode(errors='replace')


def check_document(xml: str | bytes, field: str = 'robot_description') -> None:
    """Raise ModelError if a description is too large or has a DTD; `field` names it."""
    if len(xml) > LARGEST_DESCRIPTION:
        unit = 'characters' if isinstance(xml, str) else 'bytes'
        raise ModelError(
            f'{field} has more than {LARGEST_DESCRIPTION} {unit}, expected at most this number')
    dtd = find_dtd(xml)
    if dtd:
        raise ModelError(
            f'{field} has a document type declaration (DTD), {dtd!r}, which is rejected because '
            'its entities can expand without limit; expected a URDF without one')
