# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Every finding of the model check on a URDF with that fault, and none on the default arm."""

import struct

import numpy as np
from one_joint_arm import arm_of, BOX, CORNERS, inertial, LIMIT, link_behind, text_stl
import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model_check import mesh_bounds
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.finding import CHECKS, errors_of, refuse_errors
from robot_dynamics.model_check.mesh_bounds import bounding_box, MeshReader
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf import mesh_files


def found(urdf, **options):
    return {(f.check, f.level, f.where) for f in check_model(urdf, **options)}


# ---------------------------------------------------------------------------------- good models

def test_nothing_is_found_on_good_arms():
    for urdf in (default_arm_urdf(), arm_of()):
        assert check_model(urdf) == []


def test_fixed_links_are_not_checked():
    fixed = link_behind(inertial(0.0), 'fixed', 'stand', 'base')
    root = '<link name="base"><inertial><mass value="9"/>' \
        '<inertia ixx="1" iyy="1" izz="9" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    assert check_model(arm_of(more=fixed).replace('<link name="base"/>', root)) == []


def safe(k_velocity: float) -> str:
    return arm_of(limit=(
        f'{LIMIT}<safety_controller k_velocity="{k_velocity}" soft_lower_limit="-1"/>'))


def test_a_safety_controller_must_let_the_effort_limit_through():
    """The velocity limit is 2 rad/s, the effort limit 100 N·m."""
    assert found(safe(50.0)) == set()
    assert found(safe(49.0)) == {('limits', 'warning', 'hinge')}
    finding, = check_model(safe(0.0))
    assert 'has k_velocity 0: with ros2_control at most 0 of the effort limit 100' in str(finding)


def test_an_arm_that_is_lighter_than_any_is_found():
    far = link_behind(inertial(0.02)).replace('<axis', '<origin xyz="0 0 1"/><axis', 1)
    assert ('mass', 'warning', '') in found(arm_of(inertial(0.02), more=far))
    assert ('mass', 'warning', '') not in found(arm_of(inertial(0.5), more=far))


def test_a_joint_that_may_not_leave_zero_is_found():
    closed = link_behind(inertial(), 'revolute').replace(
        '</joint>', '<limit lower="0" upper="0" effort="1" velocity="1"/></joint>')
    finding, = [one for one in check_model(arm_of(more=closed)) if one.where == 'to_hand']
    assert (finding.check, finding.level) == ('limits', 'warning')
    assert 'counts as fixed' in finding.message


# -------------------------------------------------------------------------------------- findings

CASES = {
    'negative mass': (arm_of(inertial(-1.0)), ('mass', 'error', 'arm')),
    'no mass behind a joint': (arm_of(more=link_behind('')), ('mass', 'error', 'to_hand')),


    'negative moment': (
        arm_of(inertial(moments=(0.1, 0.1, -0.01))), ('inertia', 'error', 'arm')),

    'point mass on the axis': (
        arm_of(inertial(moments=(0, 0, 0))), ('inertia', 'error', 'hinge')),
    'point mass': (
        arm_of(inertial(moments=(0, 0, 0), xyz='0 0 0.3')), ('inertia', 'warning', 'arm')),
    'too dense': (arm_of(inertial(42.9, (4, 4, 0.07))), ('density', 'warning', 'arm')),
    'geometry without mass': (
        arm_of(more=link_behind(BOX, 'fixed')), ('lost_mass', 'warning', 'hand')),
    'two inertials': (arm_of(inertial() + inertial()), ('lost_mass', 'warning', 'arm')),
    'no effort limit': (
        arm_of(limit='<limit lower="-2" upper="2" effort="0" velocity="2"/>'),
        ('limits', 'warning', 'hinge')),

    'no limit at all': (arm_of(limit='', kind='continuous'), ('limits', 'warning', 'hinge')),
    'infinite travel': (
        arm_of(limit='<limit lower="-inf" upper="inf" effort="9" velocity="2"/>'),
        ('limits', 'warning', 'hinge')),
    'no travel': (
        arm_of(limit='<limit lower="1" upper="1" effort="9" velocity="2"/>'),
        ('limits', 'warning', 'hinge')),
    'too weak': (
        arm_of(inertial(xyz='0 0 0.4'),
               '<limit lower="-2" upper="2" effort="3.9" velocity="2"/>'),
        ('gravity_capability', 'warning', 'hinge')),
    'two joints, one point mass': (
        arm_of('', geometry='', more=link_behind(inertial(moments=(0, 0, 0), xyz='0 0 0.3'))),
        ('condition', 'error', '')),
    'dry friction above the limit': (
        arm_of(limit=f'{LIMIT}<dynamics friction="101"/>'), ('friction', 'error', 'hinge')),
    'a link without the rotor of its drive': (
        arm_of(limit='<limit lower="-2" upper="2" effort="1e6" velocity="2"/>'),
        ('rotors', 'warning', 'hinge')),
}
# Each check with an arm of one number, and this number just inside and just beyond its bound.
BOUNDS = {
    'mass below 1e-6 kg': (
        'mass', lambda x: arm_of(more=link_behind(inertial(x, (0, 0, 0)), 'fixed')),
        1.01e-6, 0.99e-6),
    'moments up to 1e-12 are zero': (
        'inertia', lambda x: arm_of(more=link_behind(inertial(1e-5, (x, x, x)), 'fixed')),
        1.01e-12, 0.99e-12),
    'moment below -1e-6 of the largest': (
        'inertia', lambda x: arm_of(inertial(moments=(0.1, 0.1, x))), -0.99e-7, -1.01e-7),
    'triangle inequality with a tolerance of 1 %': (
        'triangle_inequality',
        lambda x: arm_of(inertial(moments=(0.01, 0.01, x)), geometry=''),
        0.0202, 0.02021),
    'radius of gyration of 1.1 times the half diagonal': (
        'radius_of_gyration', lambda x: arm_of(inertial(moments=(x, x, 0.002))), 0.305, 0.306),
    'center of mass a quarter of the diagonal outside': (
        'radius_of_gyration', lambda x: arm_of(inertial(xyz=f'0 0 {x}')), 0.752, 0.753),
    'radius of gyration of twice the distance of the joints': (
        'radius_of_gyration',
        lambda x: arm_of(inertial(moments=(x, x, x), xyz='0 0 0.1'), geometry=''),
        0.0399, 0.0401),
    'condition number of 1e6': (
        'condition', lambda x: arm_of(
            inertial(1000.0, (50, 50, 2)), more=link_behind(inertial(1e-4, (0, x, 0)))),
        5.01e-5, 4.99e-5),
}


@pytest.mark.parametrize('name', CASES)
def test_it_finds(name):
    urdf, expected = CASES[name]
    assert expected in found(urdf)


@pytest.mark.parametrize('name', BOUNDS)
def test_it_finds_what_is_beyond_a_bound(name):
    check, make, inside, beyond = BOUNDS[name]
    assert check not in {each[0] for each in found(make(inside))}
    assert check in {each[0] for each in found(make(beyond))}


def test_every_check_has_a_case():
    cases = {expected[0] for _, expected in CASES.values()}
    assert cases | {check for check, *_ in BOUNDS.values()} == set(CHECKS)


@pytest.mark.parametrize('name', ['negative moment', 'no mass behind a joint'])
def test_one_cause_is_one_kind_of_error(name):
    """Otherwise an operator who ignores one finding by name would get the next one."""
    urdf, (check, _, _) = CASES[name]
    assert {finding.check for finding in errors_of(check_model(urdf))} == {check}
    assert errors_of(check_model(urdf), [check]) == []


def test_a_value_at_the_bound_is_no_finding():
    weight = 9.81 * 0.4
    strong = arm_of(inertial(xyz='0 0 0.4'),
                    f'<limit lower="-2" upper="2" effort="{weight + 1e-6}" velocity="2"/>')
    assert check_model(strong) == []
    # Within ±0.5 rad of upright the gravity torque reaches only the sine of 0.5 rad.
    narrow = arm_of(
        inertial(xyz='0 0 0.4'),
        f'<limit lower="-0.5" upper="0.5" effort="{weight * np.sin(0.5) + 1e-6}" velocity="2"/>')
    assert check_model(narrow) == []


@pytest.mark.parametrize(('parameter', 'value', 'is_found'), [
    ('coulomb', 99.0, False), ('coulomb', 101.0, True), ('sigmoid', 101.0, True)])
def test_friction_parameters_are_compared_with_the_effort_limit(parameter, value, is_found):
    arm = arm_from_parameters(arm_of(), {f'friction.{parameter}': [value]})
    assert (errors_of(check_model(arm_of(), arm)) != []) is is_found


def test_rotors_are_inertia_too():
    urdf = arm_of(inertial(moments=(0, 0, 0)))
    assert errors_of(check_model(urdf)) != []
    assert errors_of(check_model(urdf, load_arm(urdf).with_reflected_inertia(0.25))) == []


def test_locked_joints_are_not_checked():
    urdf = arm_of(more=link_behind('', name='hand'))
    assert errors_of(check_model(urdf)) != []
    assert check_model(urdf, load_arm(urdf, ['hinge'])) == []


def test_a_rejection_names_the_parameter_that_accepts_the_model():
    findings = check_model(CASES['no mass behind a joint'][0])
    with pytest.raises(ModelError, match=r"mass: joint 'to_hand' .*ignore_checks: \[mass\]"):
        refuse_errors(findings)
    refuse_errors(findings, ['mass'])
    with pytest.raises(ModelError, match='not well-formed XML'):
        check_model('<robot')


# ---------------------------------------------------------------------------------------- geometry

def binary_stl(header=b'solid, as some begin'):
    content = header.ljust(80, b' ') + struct.pack('<I', 2)
    for triangle in CORNERS:
        content += struct.pack('<12fH', *np.zeros(3), *np.ravel(triangle), 0)
    return content


def obj():
    vertices = '\n'.join(f'v {x} {y} {z}' for triangle in CORNERS for x, y, z in triangle)
    return f'# a\n{vertices}\nvn 9 9 9\nvt 9 9\nf 1 2 3\nf 4 5 6'.encode()


def collada():
    """Return the mesh in millimetres, with a vertex offset of 1 m along y that a node cancels."""
    numbers = ' '.join(str(1000 * x) for x in np.ravel(np.array(CORNERS) + [0.0, 1.0, 0.0]))
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="18">{numbers}</float_array><technique_common>
<accessor source="#a" count="6" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2 3 4 5</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><matrix>1 0 0 0 0 1 0 -1000 0 0 1 0 0 0 0 1
</matrix><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


@pytest.mark.parametrize(('name', 'content'), [
    ('a.stl', binary_stl()), ('b.STL', text_stl()), ('c.obj', obj()), ('d.dae', collada())])
def test_bounds_of_meshes(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    np.testing.assert_array_equal(bounding_box(tmp_path / name), [[0, 0, 0], [1, 2, 3]])


@pytest.mark.parametrize(('name', 'content'), [
    ('b.stl', b'solid\nvertex 1 2'), ('c.obj', b'v a b c'), ('d.dae', b'<a/>')])
def test_meshes_that_cannot_be_read(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    assert bounding_box(tmp_path / name) is None


def test_a_collada_file_that_takes_too_long_or_has_a_dtd_cannot_be_read(tmp_path, monkeypatch):
    file = tmp_path / 'a.dae'
    file.write_bytes(b'<!DOCTYPE COLLADA [<!ENTITY e "x">]>' + collada().partition(b'?>')[2])
    assert bounding_box(file) is None
    file.write_bytes(collada())
    assert bounding_box(file) is not None
    monkeypatch.setattr(mesh_bounds, 'COLLADA_TIMEOUT', 0.01)
    assert bounding_box(file) is None


def test_a_mesh_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    file = tmp_path / 'a.stl'
    file.write_bytes(binary_stl())
    monkeypatch.setattr(mesh_files, 'LARGEST_MESH', file.stat().st_size)
    assert bounding_box(file) is not None
    monkeypatch.setattr(mesh_files, 'LARGEST_MESH', file.stat().st_size - 1)
    assert bounding_box(file) is None


MESH = '<visual><geometry><mesh filename="{}" scale="0.1 0.1 0.1"/></geometry></visual>'


def test_a_link_is_compared_with_its_mesh_where_it_can_be_read(tmp_path):
    meshes = tmp_path / 'my_robot' / 'meshes'
    meshes.mkdir(parents=True)
    (meshes / 'arm.stl').write_bytes(binary_stl())
    urdf = arm_of(inertial(moments=(0.4, 0.4, 0.4), xyz='0.05 0.1 0.15'),
                  LIMIT.replace('100', '9'),
                  geometry=MESH.format('package://my_robot/meshes/arm.stl'))
    expected = {('radius_of_gyration', 'warning', 'arm')}
    assert found(urdf, meshes=MeshReader(tmp_path / 'my_robot' / 'urdf')) == expected
    assert found(urdf) == set()
    assert found(urdf.replace('0.4', '0.01'), meshes=MeshReader(tmp_path)) == set()
