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

"""The components of the viewer without a browser: requests, scene, controls and plots."""

from contextlib import closing

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_table import fault
from geometry_msgs.msg import Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pinocchio as pin
import pytest
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.pictures.arm_marks import ArmMarks
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.reporting.figures import BLUE, GREY, ORANGE, PURPLE, VERMILION
from robot_dynamics.ros.conversions import payload_from_ros, trajectory_from_ros
from robot_dynamics.ros.dynamics.markers import drawn
from robot_dynamics.trajectories.follower import TrajectoryFollower
from robot_dynamics.trajectories.interpolation import sample_segment
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robot_dynamics.urdf.visuals import read_visuals
from robots import must_have_everything, robot_path, robot_urdf
from sensor_msgs.msg import JointState

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
    pytest.importorskip('trimesh', reason='the viewer needs trimesh')
from robot_dynamics.tools.viewer import requests
from robot_dynamics.tools.viewer.app import values_of
from robot_dynamics.tools.viewer.node import worst_words
from robot_dynamics.tools.viewer.panel import ArmPanel, hand_of, legend
from robot_dynamics.tools.viewer.plots import LivePlot, SHOWN
from robot_dynamics.tools.viewer.scene import ArmScene
from robot_dynamics.tools.viewer.server import start_server, stop_server
import trimesh

SECOND = 1_000_000_000
ONE_JOINT = """
<robot name="one_joint"><link name="base"/><link name="tip"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="one" type="{}"><parent link="base"/><child link="tip"/>{}</joint></robot>"""


def one_joint(kind, limit=''):
    return load_arm(ONE_JOINT.format(kind, limit and f'<limit effort="1" {limit}/>'))


def arm_called(name):
    return load_arm(default_arm_urdf() if name == 'default' else robot_urdf(name))


@pytest.fixture(scope='module')
def server():
    started = start_server('127.0.0.1', 0, 'x')
    yield started
    stop_server(started)


# --- requests ------------------------------------------------------------------------------------

def check_motion_time(arm, fastest, q, goal, speed):
    """Check on the motion that no joint is too fast, and that the motion is not slower."""
    T = requests.motion_time(arm, q, goal, speed)
    turns = np.array(arm.joint_kinds) == 'continuous'  # dynamics takes the shorter direction
    goal = np.where(turns, q + wrap_to_pi(goal - q), goal)
    p0, p1 = quintic_point_to_point(arm.joint_names, q, goal, T).points
    samples = [sample_segment(t, 0.0, p0, T, p1) for t in np.linspace(0.0, T, 601)]
    v = np.abs([sample.velocity for sample in samples]).max(axis=0) / (speed * fastest)
    a = np.abs([sample.acceleration for sample in samples]).max(axis=0) / (speed * fastest)
    used = max(v.max(), requests.RISE_TIME * a.max(), requests.SHORTEST_MOTION / T)
    assert used == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize('name', ['default', 'ur10', 'panda', 'kinova'])
def test_no_motion_is_too_fast_and_none_takes_longer_than_that(name):
    arm = arm_called(name)
    positions = st.lists(
        st.floats(-3.0, 3.0), min_size=arm.joint_count, max_size=arm.joint_count).map(np.array)

    @settings(deadline=None, derandomize=True, max_examples=30)
    @given(positions, positions, st.floats(0.05, 1.0))
    def check(q, goal, speed):
        check_motion_time(arm, arm.limits.velocity, q, goal, speed)

    check()


@pytest.mark.parametrize('way', [1e-6, 0.01, 3.0])
def test_joints_without_a_limit_have_a_moderate_speed(way):
    for kind, limit, fastest in (
            ('continuous', '', 1.0), ('prismatic', 'lower="-5" upper="5"', 0.25),
            ('revolute', 'lower="-5" upper="5" velocity="0"', 1.0)):
        arm = one_joint(kind, limit)
        check_motion_time(arm, np.array([fastest]), np.zeros(1), np.array([way]), 0.5)


@pytest.mark.parametrize('name', ['default', 'ur10', 'panda'])
@pytest.mark.parametrize('seconds', [0.3, 1.2345678901, 100.0])
def test_a_reference_arrives_at_rest_and_stays(name, seconds):
    arm = arm_called(name)
    q = np.linspace(-0.3, 0.3, arm.joint_count)
    goal = np.linspace(0.7, -0.5, arm.joint_count)
    message = requests.reference_to(arm, goal, seconds, 'me')
    assert (message.header.frame_id, message.header.stamp) == ('me', Time())  # starts immediately
    follower = TrajectoryFollower(arm.joint_names)
    trajectory = trajectory_from_ros(message, arm.joint_names)
    assert not trajectory.is_set_point
    follower.start(trajectory, 7 * SECOND, q, np.zeros(arm.joint_count))
    p0, p1 = quintic_point_to_point(arm.joint_names, q, goal, seconds).points
    for t in seconds * np.array([0.0, 0.2, 0.5, 0.9]):
        npt.assert_allclose(
            follower.sample(7 * SECOND + round(t * SECOND)),
            sample_segment(t, 0.0, p0, seconds, p1), atol=1e-6)
    for later in (0.0, 1.0, 0.5 * requests.HELD, 2.0 * requests.HELD):
        reference = follower.sample(7 * SECOND + round((seconds + later) * SECOND))
        npt.assert_allclose(reference.position, goal, atol=1e-9)
        npt.assert_allclose(np.concatenate(reference[1:]), 0.0, atol=1e-6)


@settings(deadline=None, derandomize=True)
@given(st.floats(1e-3, 1e3))
def test_a_load_is_a_ball_that_is_accepted(mass):
    arm = arm_called('default')
    payload = payload_from_ros(arm, requests.ball('tool0', mass))
    assert (payload.link, payload.mass, *payload.com) == ('tool0', mass, 0.0, 0.0, 0.0)
    radius = np.sqrt(payload.inertia[0, 0] / (0.4 * mass))
    npt.assert_allclose(payload.inertia, 0.4 * mass * radius**2 * np.eye(3), atol=1e-15)
    assert requests.DENSITY * 4.0 / 3.0 * np.pi * radius**3 == pytest.approx(mass)


def test_no_mass_clears_a_load_and_a_strange_one_is_refused():
    assert payload_from_ros(arm_called('default'), requests.ball('tool0', 0.0)) is None
    with pytest.raises(InvalidInputError, match='payload'):
        requests.ball('tool0', float('nan'))


@settings(deadline=None, derandomize=True)
@given(*2 * [st.tuples(*3 * [st.floats(-200.0, 200.0)])])
def test_a_push_is_the_same_force_whatever_the_link_is_turned_by(turn, force):
    R = pin.exp3(np.array(turn))
    message = requests.force_on('hand', np.array(force), R)
    f = message.wrench.force
    assert message.header.frame_id == 'hand'
    npt.assert_allclose(R @ [f.x, f.y, f.z], force, atol=1e-9)
    assert message.wrench.torque == Vector3()


# --- received messages ---------------------------------------------------------------------------

def test_values_are_found_by_name():
    arm = arm_called('default')
    state = JointState(
        name=['joint2', 'finger', 'joint1'], position=[2.0, float('nan'), 1.0], velocity=[4.0])
    npt.assert_array_equal(values_of(arm, state), [1.0, 2.0])
    assert values_of(arm, state, 'velocity') is None
    for position in ([], [1.0], [1.0, float('nan')], [float('inf'), 1.0]):
        assert values_of(arm, JointState(name=['joint1', 'joint2'], position=position)) is None
    assert values_of(arm, JointState(name=['joint1'], position=[1.0])) is None


def test_a_status_that_is_not_ok_is_shown_by_its_name():
    levels = [getattr(DiagnosticStatus, name) for name in ('OK', 'WARN', 'ERROR', 'STALE')]
    message = DiagnosticArray(status=[
        DiagnosticStatus(name=f'/left/dynamics: part {i}', message=f'why {i}', level=level)
        for i, level in enumerate(levels)])
    assert worst_words(message) == ['part 1: why 1', 'part 2: why 2', 'part 3: why 3']


@pytest.mark.parametrize(('robot', 'link'), [
    ('panda', 'panda_hand_tcp'), ('ur10', 'tool0'), ('default', 'tool0')])
def test_the_hand_is_what_holds_the_tool(robot, link):
    assert hand_of(arm_called(robot)) == link


# --- the scene -----------------------------------------------------------------------------------

def nodes_of(scene, i):
    """Return the names of the scene nodes of the i-th link."""
    names = [f'/arm/{i}/{kind}{k}' for kind in ('', 'bone') for k in range(20)]
    return [name for name in names if scene.get_handle_by_name(name) is not None]


@pytest.mark.parametrize('robot', ['ur10', 'panda'])
def test_a_real_arm_is_drawn_moved_and_taken_away(server, robot):
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


@pytest.mark.parametrize('name', [
    'broken.obj', 'broken.glb', 'broken.dae', 'broken.xyzzy', 'broken',
    'broken.stl'])
def test_a_mesh_that_cannot_be_read_is_named_with_the_reason(server, tmp_path, name):
    (tmp_path / name).write_text('no mesh')
    with scene_with_mesh(server, tmp_path, name) as scene:
        (words,) = scene.missing
        assert words.startswith(f'{name}: ')
        assert 'not found' not in words


@fault('External files and web pages',
       'a description from a topic names a mesh outside packages and declared directories',
       'not opened; the page names the mesh')
def test_meshes_of_a_description_from_a_topic_are_drawn_from_declared_directories_only(
        server, tmp_path):
    trimesh.creation.box().export(tmp_path / 'body.stl')
    file = str(tmp_path / 'body.stl')
    with scene_with_mesh(server, tmp_path, file) as scene:
        assert scene.missing == []
    with scene_with_mesh(server, None, file) as scene:
        assert [words.partition(', expected')[0] for words in scene.missing] == [
            f'mesh {file!r} of a description from a topic is not opened']
    with scene_with_mesh(server, None, file, [tmp_path]) as scene:
        assert scene.missing == []


def test_a_collada_file_with_a_dtd_is_not_drawn(server, tmp_path):
    (tmp_path / 'body.dae').write_text('<!DOCTYPE COLLADA [<!ENTITY e "x">]><COLLADA/>')
    with scene_with_mesh(server, tmp_path, 'body.dae') as scene:
        assert scene.missing[0].startswith(
            'body.dae: it has a document type declaration (DTD), ')


def test_a_mesh_whose_name_is_too_long_is_named(server, tmp_path):
    with scene_with_mesh(server, tmp_path, 'a' * 300) as scene:
        assert len(scene.missing) == 1


def test_marks_come_change_and_go(server, tmp_path):
    def shown(markers):
        return [server.scene.get_handle_by_name(f'/marks/{marker.ns}/{marker.id}')
                for marker in markers]

    def texts(handles):
        return [handle.text for handle in handles if hasattr(handle, 'text')]

    arm = arm_called('default').with_payloads([make_payload('tool0', 2.0)])
    scene = ArmScene(server, arm, default_arm_urdf(), tmp_path)
    q, effort, external = np.array([0.3, 0.4]), np.array([10.0, -5.0]), np.array([3.0, 2.0])
    marks = drawn(ArmMarks(arm), arm, q, effort, external).markers
    assert {marker.ns for marker in marks} == {
        'effort', 'effort in numbers', 'external effort', 'external force', 'payload'}
    scene.mark(marks)
    first = shown(marks)
    assert None not in first
    assert texts(first) == ['joint1: 10.0 N m', 'joint2: -5.0 N m']

    changed = drawn(ArmMarks(arm), arm, q + 0.5, 2.0 * effort, 2.0 * external).markers
    scene.mark(changed)
    assert shown(changed) == first
    assert texts(first) == ['joint1: 20.0 N m', 'joint2: -10.0 N m']
    for marker, handle in zip(changed, first):
        if marker.points:
            written = np.array([(point.x, point.y, point.z) for point in marker.points])
            npt.assert_allclose(handle.points.reshape(-1, 3)[[0, -1]], written[[0, -1]], atol=1e-5)
        else:
            place = marker.pose.position
            npt.assert_allclose(handle.position, (place.x, place.y, place.z), atol=1e-5)

    scene.mark([marker for marker in changed if marker.ns == 'effort'])
    left = [marker.ns for marker in changed if shown([marker]) != [None]]
    assert left == ['effort', 'effort']
    scene.mark(())
    assert set(shown(changed)) == {None}
    scene.mark(marks)
    scene.close()
    assert set(shown(changed)) == {None}


def test_labels_keep_their_distance(server, tmp_path):
    arm = arm_called('ur10')
    scene = ArmScene(server, arm, robot_path('ur10').read_text(), tmp_path)
    q = np.zeros(arm.joint_count)
    scene.mark(drawn(ArmMarks(arm), arm, q, np.ones(arm.joint_count), None).markers)
    places = np.array([
        server.scene.get_handle_by_name(f'/marks/effort in numbers/{i}').position
        for i in range(arm.joint_count)])
    for i, place in enumerate(places[:-1]):
        apart = np.linalg.norm(places[i + 1:] - place, axis=1)
        assert apart.min() > 0.119 * scene.reach
    scene.close()


def test_the_legend_has_the_colours_of_the_marks():
    text = legend()
    for colour in (BLUE, ORANGE, VERMILION, GREY, PURPLE):
        assert colour in text


# --- the controls --------------------------------------------------------------------------------

def panel_of(server, arm):
    return closing(ArmPanel(server.gui, arm, lambda do: do()))


@pytest.mark.parametrize('name', ['default', 'ur10', 'panda', 'kinova', 'tiago_no_hand'])
def test_sliders_are_within_the_limits_of_their_joints(server, name):
    arm = arm_called(name)
    with panel_of(server, arm) as panel:
        for i, slider in enumerate(panel._sliders):
            kind = arm.joint_kinds[i]
            unit = 'm' if kind == 'prismatic' else 'rad'
            assert slider.label == f'{arm.joint_names[i]} [{unit}]'
            assert arm.limits.lower[i] - 1e-9 <= slider.min <= slider.value <= slider.max
            assert slider.max <= arm.limits.upper[i] + 1e-9
            whole = 6.284 if kind == 'continuous' else arm.limits.upper[i] - arm.limits.lower[i]
            assert slider.max - slider.min == pytest.approx(whole, abs=0.002)
        assert panel.load[1] == panel.push[1] == hand_of(arm)


@pytest.mark.parametrize(('low', 'high'), [(-0.0004, 0.0004), (0.5, 0.5)])
def test_sliders_of_a_joint_that_hardly_moves_are_within_its_limits(server, low, high):
    arm = one_joint('prismatic', f'lower="{low}" upper="{high}" velocity="1"')
    with panel_of(server, arm) as panel:
        assert low <= panel._sliders[0].min <= panel._sliders[0].max <= high


def test_sliders_follow_the_arm_until_one_is_moved(server):
    with panel_of(server, arm_called('ur10')) as panel:
        def shown():
            return [slider.value for slider in panel._sliders]

        q = np.linspace(-1.0, 1.0, 6)
        panel.follow(q)
        npt.assert_allclose(shown(), q, atol=1e-3)
        panel._sliders[2].value = 0.777
        panel.follow(-q)
        npt.assert_allclose(shown(), [*q[:2], 0.777, *q[3:]], atol=1e-3)
        npt.assert_allclose(panel.take_goal(), [*q[:2], 0.777, *q[3:]], atol=1e-3)
        panel.follow(-q)
        npt.assert_allclose(shown(), -q, atol=1e-3)
        panel.follow(np.full(6, 100.0))
        assert shown() == [slider.max for slider in panel._sliders]


def test_the_slider_of_a_joint_that_has_turned_round_shows_where_it_is(server):
    with panel_of(server, one_joint('continuous')) as panel:
        panel.follow(np.array([4.0]))
        assert panel._sliders[0].value == pytest.approx(4.0 - 2.0 * np.pi, abs=1e-3)
        assert panel.take_goal()[0] == 4.0  # the user has not moved the slider
        panel._sliders[0].value = 1.5
        assert panel.take_goal()[0] == 1.5


# --- the plots -----------------------------------------------------------------------------------

@pytest.fixture
def plot(server):
    made = LivePlot(server.gui, 'a plot', ('gravity', 'effort'), least_span=2.0)
    yield made
    made.remove()


def drawn_of(plot):
    """Return the plotted columns, (3, m), and the range of the values."""
    return np.array(plot._handle.data), plot._handle.scales['y']['range']


def test_a_plot_shows_the_last_seconds(plot):
    for time in np.arange(100.0, 140.0, 0.5):
        plot.add(time, [time, -time])
        plot.show(time)
    columns, (low, high) = drawn_of(plot)
    times = np.arange(139.5 - SHOWN, 140.0, 0.5)
    npt.assert_allclose(columns, [times - 139.5, times, -times])
    assert low < -139.5
    assert high > 139.5
    plot.show(150.0)  # no new data
    npt.assert_allclose(drawn_of(plot)[0][0], np.arange(135.0, 140.0, 0.5) - 150.0)
    plot.show(200.0)
    assert np.array(plot._handle.data).shape == (3, 0)


def test_a_plot_restarts_if_time_goes_back(plot):
    for time, value in ((7.0, 1.0), (8.0, 2.0), (8.0, 9.0), (3.0, 4.0), (3.5, 5.0)):
        plot.add(time, [value, value])
    plot.show(3.5)
    npt.assert_allclose(drawn_of(plot)[0], [[-0.5, 0.0], [4.0, 5.0], [4.0, 5.0]])


def test_small_values_are_not_blown_up(plot):
    plot.add(1.0, [5.0, 5.001])
    plot.show(1.0)
    low, high = drawn_of(plot)[1]
    assert high - low >= 2.0
    assert 0.5 * (low + high) == pytest.approx(5.0005)
    plot.add(2.0, [5.0, 95.0])
    plot.show(2.0)
    low, high = drawn_of(plot)[1]
    assert low < 5.0 < 95.0 < high < 130.0
