# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Visual elements of a URDF: shapes, poses, colours."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pinocchio as pin
import pytest
from robot_dynamics.urdf.mesh_files import find_mesh
from robots import must_have_everything, robot_path

if not must_have_everything():
    pytest.importorskip('trimesh', reason='the viewer needs trimesh')
from robot_dynamics_tools.viewer.visuals import MeshFile, read_visuals

BALL = '<sphere radius="0.1"/>'
ANGLES = st.floats(-3.2, 3.2)
LENGTHS = st.floats(-10.0, 10.0)


def visuals_of(inside, outside=''):
    return read_visuals(f'<robot name="r">{outside}<link name="a">{inside}</link></robot>')


def one(geometry, more='', outside=''):
    """Return the only visual of a link with this geometry."""
    (visual,) = visuals_of(f'<visual>{more}<geometry>{geometry}</geometry></visual>', outside)
    return visual


# --- shapes --------------------------------------------------------------------------------------

def test_shapes_have_their_sizes():
    for geometry, edges in (
            ('<box size="0.1 2 3e-1"/>', [0.1, 2.0, 0.3]), ('<sphere radius="0.2"/>', 3 * [0.4]),
            ('<cylinder radius="0.2" length="1.5"/>', [0.4, 0.4, 1.5])):
        half = 0.5 * np.array(edges)
        npt.assert_allclose(one(geometry).shape.bounds, [-half, half], atol=1e-12)
    for written, scale in (('', [1, 1, 1]), ('scale="0.001 -0.002 1"', [0.001, -0.002, 1])):
        mesh = one(f'<mesh filename="package://p/arm.stl" {written}/>').shape
        assert isinstance(mesh, MeshFile)
        assert mesh.name == 'package://p/arm.stl'
        npt.assert_array_equal(mesh.scale, scale)


@pytest.mark.parametrize('geometry', [
    '', '<capsule radius="1" length="1"/>', '<box/>', '<box size="1 1"/>',
    '<box size="1 one 1"/>', '<box size="1 0 1"/>', '<box size="1 1e300 1"/>',
    '<sphere/>', '<sphere radius="-1"/>', '<sphere radius="nan"/>', '<cylinder radius="1"/>',
    '<cylinder length="1"/>', '<cylinder radius="1" length="0"/>', '<mesh filename=""/>',
    '<mesh filename="a.stl" scale="1 1"/>'])
def test_what_is_no_shape_is_left_out_and_what_is_one_stays(geometry):
    visuals = visuals_of(
        f'<visual><geometry>{geometry}</geometry></visual>'
        f'<visual><geometry>{BALL}</geometry></visual>')
    assert [visual.shape.bounds[1, 0] for visual in visuals] == [pytest.approx(0.1)]


def test_several_visuals_of_several_links_keep_their_order():
    visuals = read_visuals('<robot name="r" xmlns="http://www.ros.org">' + ''.join(
        f'<link name="{link}">' + ''.join(
            f'<visual><geometry><sphere radius="{radius}"/></geometry></visual>'
            for radius in radii) + '</link>'
        for link, radii in (('b', (1, 2)), ('none', ()), ('a', (3,)))) + '</robot>')
    assert [(visual.link, round(visual.shape.bounds[1, 0], 9)) for visual in visuals] == [
        ('b', 1.0), ('b', 2.0), ('a', 3.0)]


# --- poses ---------------------------------------------------------------------------------------

@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.tuples(LENGTHS, LENGTHS, LENGTHS), st.tuples(ANGLES, ANGLES, ANGLES))
def test_the_origin_is_the_place_in_the_frame_of_the_link(xyz, rpy):
    def in_words(values):
        return ' '.join(map(repr, values))

    visual = one(BALL, f'<origin xyz="{in_words(xyz)}" rpy="{in_words(rpy)}"/>')
    npt.assert_array_equal(visual.place, xyz)
    npt.assert_allclose(visual.rotation, pin.rpy.rpyToMatrix(np.array(rpy)), atol=1e-12)


def test_without_an_origin_a_shape_is_at_its_link_and_with_a_wrong_one_left_out():
    for origin in ('', '<origin/>'):
        visual = one(BALL, origin)
        npt.assert_array_equal(visual.place, np.zeros(3))
        npt.assert_array_equal(visual.rotation, np.eye(3))
    for origin in ('xyz="0 0"', 'xyz="0 0 nan"', 'rpy="0 inf 0"', 'rpy=""'):
        assert visuals_of(f'<visual><origin {origin}/><geometry>{BALL}</geometry></visual>') == []


# --- colours -------------------------------------------------------------------------------------

PALETTE = (
    '<material name="red"><color rgba="1 0 0 0.5"/></material>'
    '<material name="bad"><color rgba="1 0 0"/></material>'
    '<material name="texture"><texture filename="a.png"/></material>')


@pytest.mark.parametrize(('material', 'colour'), [
    ('', None),
    ('<material name="red"/>', (1.0, 0.0, 0.0, 0.5)),
    ('<material name="red"><color rgba="0 1 0 1"/></material>', (0.0, 1.0, 0.0, 1.0)),
    ('<material><color rgba="0 0.25 1 1"/></material>', (0.0, 0.25, 1.0, 1.0)),
    ('<material name="red"><color rgba="0 1"/></material>', (1.0, 0.0, 0.0, 0.5)),
    ('<material><color rgba="2 -1 0.5 1.5"/></material>', (1.0, 0.0, 0.5, 1.0)),
    ('<material><color rgba="0 0 nan 1"/></material>', None),
    ('<material><color/></material>', None),
    ('<material name="unknown"/>', None),
    ('<material name="bad"/>', None),
    ('<material name="texture"/>', None)])
def test_the_colour_is_its_own_or_that_of_the_name(material, colour):
    assert one(BALL, material, PALETTE).colour == colour


# --- real robots ---------------------------------------------------------------------------------

def test_the_meshes_of_a_real_arm_are_found_next_to_its_urdf(monkeypatch):
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    path = robot_path('ur10')
    names = [visual.shape.name for visual in read_visuals(path.read_text(encoding='utf-8'))
             if isinstance(visual.shape, MeshFile)]
    assert len(names) >= 7
    assert [name for name in names if find_mesh(name, path.parent) is None] == []
