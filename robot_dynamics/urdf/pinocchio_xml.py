# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The URDF that Pinocchio reads: only the checked parts of a robot description.

Continuous joints become unlimited revolute ones, with one coordinate each instead of cosine and
sine; geometry, limits and mimic relations are omitted.
"""

import xml.etree.ElementTree as ElementTree

INERTIA_ENTRIES = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
"""The attributes of `<inertia>`."""

# Represents "no limit" if the parser of Pinocchio requires a number.
_UNLIMITED = '1e30'
_NUMBERS_OF = {
    'origin': ('xyz', 'rpy'), 'mass': ('value',), 'inertia': INERTIA_ENTRIES, 'axis': ('xyz',)}


def pinocchio_urdf(root: ElementTree.Element) -> str:
    """Return the text for Pinocchio of a `<robot>` that was checked (see `urdf.parse_urdf`)."""
    tree = ElementTree.Element('robot', {'name': root.get('name') or 'arm'})
    for link in root.findall('link'):
        copy = ElementTree.SubElement(tree, 'link', {'name': link.get('name') or ''})
        inertial = link.find('inertial')
        if inertial is not None:
            _copy_first(
                ElementTree.SubElement(copy, 'inertial'), inertial, 'origin', 'mass', 'inertia')
    for joint in root.findall('joint'):
        kind = joint.get('type') or ''
        copy = ElementTree.SubElement(tree, 'joint', {
            'name': joint.get('name') or '',
            'type': 'revolute' if kind == 'continuous' else kind})
        _copy_first(copy, joint, 'origin', 'parent', 'child')
        if kind != 'fixed':
            _copy_first(copy, joint, 'axis')
            ElementTree.SubElement(copy, 'limit', {
                'lower': f'-{_UNLIMITED}', 'upper': _UNLIMITED,
                'effort': _UNLIMITED, 'velocity': _UNLIMITED})
    return ElementTree.tostring(tree, encoding='unicode')


def _copy_first(target: ElementTree.Element, source: ElementTree.Element, *tags: str) -> None:
    """
    Append the first child of each tag, which is the one that was checked.

    Its numbers are formatted again: if the parser of Pinocchio cannot read a number (followed by a
    space, or separated by a tab), it discards the whole inertia of a link and continues. Other
    attributes and elements of the child were not checked, and are omitted.
    """
    for tag in tags:
        element = source.find(tag)
        if element is None:
            continue
        copy = ElementTree.SubElement(target, tag)
        if tag in ('parent', 'child'):
            copy.set('link', element.get('link', ''))
        for attribute in _NUMBERS_OF.get(tag, ()):
            if attribute in element.attrib:
                copy.set(attribute, ' '.join(
                    repr(float(word)) for word in element.attrib[attribute].split()))
