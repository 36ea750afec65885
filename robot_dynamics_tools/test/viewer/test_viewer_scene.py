# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The three-dimensional scene of the viewer: links, meshes, and marks of efforts."""

from contextlib import closing

from fault_table import fault
import numpy as np
import numpy.testing as npt
import pinocchio as pin
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.monitor.markers import drawn
from robot_dynamics_tools.pictures.arm_marks import ArmMarks
from robots import must_have_everything, robot_path, robot_urdf

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
    pytest.importorskip('trimesh', reason='the viewer needs trimesh')
from robot_dynamics_tools.viewer.scene import ArmScene
from robot_dynamics_tools.viewer.visuals import read_visuals
import trimesh
from viewer_bench import arm_called


def nodes_of(scene, i):
    """Return the names of the scene nodes of the i-th link."""
    names = [f'/arm/{i}/{kind}{k}' for kind in ('', 'bone') for k in range(20)]
    return [name for name in names if scene.get_handle_by_name(name) is not None]


def test_a_real_arm_is_drawn_moved_and_taken_away(server):
    robot = 'panda'
    path, xml, arm = robot_path(robot), robot_urdf(robot), arm_called(robot)
    scene = ArmScene(server, arm, xml, path.parent)
    assert scene.missing == []
    seen = {visual.link for visual in read_visuals(xml)}
    for i, link in enumerate(arm.link_names):
        assert [name for name in nodes_of(server.scene, i) if 'bone' not in name] or (
            link not in seen)
    model = pin.buildModelFromXML(xml)
    data = model.createData()
    for q in np.random.default_rng(1).uniform(-0.5, 0.5, (3, arm.joint_count)):
        by_name = dict(zip(arm.joint_names, q))
        scene.move(q)
        pin.framesForwardKinematics(model, data, np.array([
            by_name.get(name, q[-1]) for name in model.names[1:]]))  # all fingers move equally
        for i, link in enumerate(arm.link_names):
            place = data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
            handle = server.scene.get_handle_by_name(f'/arm/{i}')
            npt.assert_allclose(handle.position, place.translation, atol=1e-5)
            w, x, y, z = handle.wxyz
            npt.assert_allclose(pin.Quaternion(w, x, y, z).matrix(), place.rotation, atol=1e-5)
            npt.assert_allclose(scene.rotation(link), place.rotation, atol=1e-9)
    scene.close()
    assert server.scene.get_handle_by_name('/ground') is None
    for i in range(len(arm.link_names)):
        assert server.scene.get_handle_by_name(f'/arm/{i}') is None
        assert nodes_of(server.scene, i) == []


def test_what_has_no_mesh_is_named_and_has_bones(server, tmp_path):
    xml = robot_urdf('ur10').replace('example-robot-data', 'gone')
    with closing(ArmScene(server, arm_called('ur10'), xml, tmp_path)) as scene:
        names = [visual.shape.name for visual in read_visuals(xml)]
        assert scene.missing == [f'{name}: not found' for name in names]
        nodes = [name for i in range(11) for name in nodes_of(server.scene, i)]
        assert len(nodes) >= 5
        assert all('bone' in name for name in nodes)


def scene_with_mesh(server, directory, name, mesh_paths=()):
    xml = default_arm_urdf().replace('</link>', (
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual></link>'), 1)
    return closing(ArmScene(server, load_arm(xml), xml, directory, mesh_paths))


def test_a_mesh_that_cannot_be_read_is_named_with_the_reason(server, tmp_path):
    (tmp_path / 'dtd.dae').write_text('<!DOCTYPE COLLADA [<!ENTITY e "x">]><COLLADA/>')
    for name in ('broken.obj', 'broken.dae', 'broken.xyzzy', 'broken', 'broken.stl'):
        (tmp_path / name).write_text('no mesh')
    for name in (*sorted(path.name for path in tmp_path.iterdir()), 'a' * 300):
        with scene_with_mesh(server, tmp_path, name) as scene:
            (words,) = scene.missing
            assert words.startswith(f'{name}: ')
            assert name.startswith('aaa') or 'not found' not in words
            assert ('(DTD)' in words) == (name == 'dtd.dae')


@fault('External files and web pages',
       'a description from a topic names a mesh outside packages and declared directories',
       'not opened; the page names the mesh')
def test_meshes_of_a_description_from_a_topic_are_drawn_from_declared_directories_only(
    server, tmp_path,
):
    trimesh.creation.box().export(tmp_path / 'body.stl')
    file = str(tmp_path / 'body.stl')
    with scene_with_mesh(server, tmp_path, file) as scene:
        assert scene.missing == []
    with scene_with_mesh(server, None, file) as scene:
        assert [words.partition(', expected')[0] for words in scene.missing] == [
            f'mesh {file!r} of a description from a topic is not opened']
    with scene_with_mesh(server, None, file, [tmp_path]) as scene:
        assert scene.missing == []


def test_marks_come_change_and_go(server, tmp_path):
    def shown(markers):
        return [server.scene.get_handle_by_name(f'/marks/{marker.ns}/{marker.id}')
                for marker in markers]

    def texts(handles):
        return [handle.text for handle in handles if hasattr(handle, 'text')]

    arm = arm_called('default').with_payloads([make_payload('tool0', 2.0)])
    scene = ArmScene(server, arm, default_arm_urdf(), tmp_path)
    q, effort, external = np.array([0.3, 0.4]), np.array([10.0, -5.0]), np.array([3.0, 2.0])
    wrench = np.array([5.0, 0.0, -9.0, 0.0, 1.0, 0.0])
    marks = drawn(ArmMarks(arm), arm, q, effort, external, wrench).markers
    assert {marker.ns for marker in marks} == {
        'effort', 'effort in numbers', 'external effort', 'external force', 'external torque',
        'frame axes', 'manipulability', 'payload'}
    scene.mark(marks)
    first = shown(marks)
    assert None not in first
    assert texts(first) == ['joint1: 10.0 N·m', 'joint2: -5.0 N·m']
    (arrow,) = [marker for marker in marks if marker.ns == 'external force']
    start = arrow.points[0]
    assert (start.x, start.y, start.z) in [tuple(point) for point in scene.extent()]

    changed = drawn(
        ArmMarks(arm), arm, q + 0.5, 2.0 * effort, 2.0 * external, 2.0 * wrench).markers
    scene.mark(changed)
    assert shown(changed) == first
    assert texts(first) == ['joint1: 20.0 N·m', 'joint2: -10.0 N·m']
    for marker, handle in zip(changed, first):
        if marker.points:
            written = np.array([(point.x, point.y, point.z) for point in marker.points])
            npt.assert_allclose(handle.points.reshape(-1, 3)[[0, -1]], written[[0, -1]], atol=1e-5)
        else:
            place = marker.pose.position
            npt.assert_allclose(handle.position, (place.x, place.y, place.z), atol=1e-5)
        if marker.ns == 'manipulability':
            size, turn = marker.scale, marker.pose.orientation
            npt.assert_allclose(2.0 * handle.radius * np.array(handle.scale), (
                size.x, size.y, size.z))
            npt.assert_allclose(handle.wxyz, (turn.w, turn.x, turn.y, turn.z), atol=1e-5)

    scene.mark([marker for marker in changed if marker.ns == 'effort'])
    left = [marker.ns for marker in changed if shown([marker]) != [None]]
    assert left == ['effort', 'effort']
    scene.mark(marks)
    scene.close()
    assert set(shown(changed)) == {None}
