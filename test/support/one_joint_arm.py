# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""URDFs of a plausible arm with one joint, whose elements a test of the model check replaces."""

CORNERS = [
    [(0, 0, 0), (1, 0, 0), (0, 2, 0)], [(0, 0, 0), (0, 2, 0), (0, 0, 3)]]
"""Triangles of a mesh with the bounding box from 0 to (1, 2, 3)."""
BOX = '<collision><geometry><box size="0.1 0.1 1"/></geometry></collision>'
LIMIT = '<limit lower="-2" upper="2" effort="100" velocity="2"/>'


def inertial(mass=1.0, moments=(0.1, 0.1, 0.002), xyz='0 0 0'):
    xx, yy, zz = moments
    return (
        f'<inertial><origin xyz="{xyz}"/><mass value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" '
        f'izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>')


def arm_of(link=None, limit=LIMIT, kind='revolute', more='', axis='0 1 0', geometry=BOX):
    """Return an arm of one joint whose link has these elements."""
    link = inertial() if link is None else link
    return f"""<robot name="r"><link name="base"/><link name="arm">{link}{geometry}</link>
      <joint name="hinge" type="{kind}"><parent link="base"/><child link="arm"/>
      <axis xyz="{axis}"/>{limit}</joint>{more}</robot>"""


def text_stl():
    """Return a mesh file with the triangles of CORNERS."""
    facets = ''.join(
        'facet normal 0 0 1\nouter loop\n'
        + ''.join(f'vertex {x} {y} {z}\n' for x, y, z in triangle) + 'endloop\nendfacet\n'
        for triangle in CORNERS)
    return f'solid a\n{facets}endsolid a\n'.encode()


def link_behind(link, kind='continuous', name='hand', parent='arm'):
    limit = '' if kind == 'fixed' else '<limit effort="100" velocity="1"/>'
    return f"""<link name="{name}">{link}</link><joint name="to_{name}" type="{kind}">
      <parent link="{parent}"/><child link="{name}"/><axis xyz="0 1 0"/>{limit}</joint>"""
