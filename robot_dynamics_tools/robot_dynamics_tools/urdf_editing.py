# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Replacement of elements in a URDF.

Comments, order, indentation and elements that this package does not read are preserved.
"""

from collections.abc import Mapping
from typing import Any
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.document import check_document


def with_elements(
    urdf: str, inertials: Mapping[str, str], dynamics: Mapping[str, Mapping[str, str]],
    limits: Mapping[str, Mapping[str, str]] | None = None,
) -> str:
    """
    Return the URDF with new `<inertial>` of links, and attributes of elements of joints.

    Other attributes of `<dynamics>` and `<limit>` are kept. The result declares UTF-8, and is to
    be written in it. Raises ModelError if the text is not valid XML, is too large or has a DTD.
    """
    document = _parsed(urdf)
    robot = document.documentElement
    for link in _children(robot, 'link'):
        if link.getAttribute('name') in inertials:
            for old in _children(link, 'inertial'):
                link.removeChild(old)
            text = inertials[link.getAttribute('name')]
            _insert_first(document, link, minidom.parseString(text).documentElement)
    for joint in _children(robot, 'joint'):
        for tag, by_joint in (('dynamics', dynamics), ('limit', limits or {})):
            values = by_joint.get(joint.getAttribute('name'), {})
            if values and not _children(joint, tag):
                _insert_first(document, joint, document.createElement(tag))
            for name, value in values.items():
                _children(joint, tag)[0].setAttribute(name, value)
    return _text(document)


def with_continuous_joints(urdf: str) -> tuple[str, list[str]]:
    """
    Return the URDF with revolute joints that have no `<limit>` as continuous, and their names.

    Raises ModelError like `with_elements`.
    """
    document = _parsed(urdf)
    joints = [joint for joint in _children(document.documentElement, 'joint')
              if joint.getAttribute('type') == 'revolute' and not _children(joint, 'limit')]
    for joint in joints:
        joint.setAttribute('type', 'continuous')
    return _text(document) if joints else urdf, [joint.getAttribute('name') for joint in joints]


def _parsed(urdf: str) -> minidom.Document:
    check_document(urdf)
    try:
        return minidom.parseString(urdf.lstrip('\ufeff \t\r\n'))
    except ExpatError as error:
        raise ModelError(f'robot_description is not valid XML: {error}') from None


def _text(document: minidom.Document) -> str:
    nodes = '\n'.join(node.toxml() for node in document.childNodes)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{nodes}\n'


def _children(element: Any, tag: str) -> list[Any]:
    """Return the elements with this tag directly below another one."""
    return [node for node in element.childNodes if node.nodeName == tag]


def _insert_first(document: minidom.Document, element: Any, child: Any) -> None:
    if not element.hasChildNodes():
        element.appendChild(document.createTextNode('\n  '))
    for node in (child, document.createTextNode('\n    ')):
        element.insertBefore(node, element.firstChild)
