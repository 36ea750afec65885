# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The viewer in a real browser, with real nodes: its display, and its controls."""

from contextlib import closing
import re
import signal

from browser import Page, SIZE
from demo_process import start_demo, wait_for_line
from geometry_msgs.msg import InertiaStamped, WrenchStamped
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.files import write_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robots import must_have_everything
from ros_harness import KEEP_MANY, LATCHED, LONG, TIMEOUT, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
from robot_dynamics_tools.viewer import views
from robot_dynamics_tools.viewer.panel import ArmPanel
from robot_dynamics_tools.viewer.scene import ArmScene
from robot_dynamics_tools.viewer.server import address_of
import trimesh
from viewer_bench import TESTED_TOKEN

START, END = (0.785, 0.524), (0.885, 0.524)
"""Of the motion of the demo [rad]."""
COARSE, NO_PICTURE = 0.4, 0.1
"""Scales of pages, which software draws."""


def wait_for_position(states, joint, value, tolerance=0.01):
    """Wait until a joint is at the expected position."""
    return states.wait_for(lambda state: abs(
        dict(zip(state.name, state.position))[joint] - value) < tolerance, LONG)


# --- the camera ----------------------------------------------------------------------------------

@pytest.fixture(scope='module')
def page_of_scene(browser, server, tmp_path_factory):
    """Yield a page, a function that moves the arm, and the camera of the page."""
    arm, cameras = load_arm(default_arm_urdf()), views.Cameras(server)
    with closing(ArmScene(
            server, arm, default_arm_urdf(), tmp_path_factory.mktemp('none'))) as scene, \
            closing(ArmPanel(server.gui, arm, lambda do: do())):
        def move(*angles, size=1.0):
            scene.move(np.array(angles))
            cameras.show(size * scene.extent())

        scene.move(np.zeros(2))
        cameras.restart(scene.extent())
        with Page(browser, address_of(server, TESTED_TOKEN), NO_PICTURE) as page:
            wait_until(server.get_clients, 'the page')
            (client,) = server.get_clients().values()
            move(0.0, 0.0)
            yield page, move, client.camera
        wait_until(lambda: not server.get_clients(), 'the end of the page')


def test_the_camera_comes_closer_again(page_of_scene, monkeypatch):
    monkeypatch.setattr(views, 'PATIENCE', 0.5)
    _, move, camera = page_of_scene
    near = float(np.linalg.norm(camera.position))
    move(0.0, 0.0, size=3.0)
    wait_until(lambda: np.linalg.norm(camera.position) > 2.0 * near, 'the camera farther')

    def is_near():
        move(0.0, 0.0)
        return np.linalg.norm(camera.position) < 1.1 * near
    wait_until(is_near, 'the camera closer')


def test_a_camera_that_the_user_moves_stays(page_of_scene):
    """The last test of the page, because the camera belongs to the user from now on."""
    page, move, camera = page_of_scene
    before = np.array(camera.position)
    page.tab.mouse.move(0.5 * SIZE['width'], 0.5 * SIZE['height'])
    page.tab.mouse.wheel(0, -400)  # closer
    wait_until(lambda: np.linalg.norm(camera.position - before) > 0.3, 'the closer camera')

    def rests():
        position = np.array(camera.position)
        page.tab.wait_for_timeout(500)
        return np.allclose(camera.position, position, atol=1e-4)
    wait_until(rests, 'the camera at rest')
    own = np.array(camera.position)
    move(1.5, -1.5)
    page.tab.wait_for_timeout(500)
    np.testing.assert_allclose(camera.position, own, atol=1e-3)
    page.tab.close()


# --- the page of the demo, on one page for all tests ---------------------------------------------

@pytest.fixture(scope='module')
def page(browser, tmp_path_factory):
    """
    Yield the page of an arm with a mesh, and with a mesh that is missing.

    The motion of the demo waits for the page. After the motion the demo continues.
    """
    directory = tmp_path_factory.mktemp('arm')
    trimesh.creation.box((0.1, 0.1, 1.0)).export(directory / 'box.stl')
    urdf = default_arm_urdf().replace('0.9 0.45 0.1', '0.3 0.3 0.3')  # a link as red as an arc
    for box, mesh in (('0.1 0.1 1.0', 'box.stl'), ('0.08 0.08 0.8', 'gone.stl')):
        urdf = urdf.replace(f'<box size="{box}" />', f'<mesh filename="{mesh}" />')
    (directory / 'arm.urdf').write_text(urdf)
    write_trajectory(directory / 'path.yaml', quintic_point_to_point(
        ['joint1', 'joint2'], START, END, 1.0))
    with start_demo(
            directory, '--viewer', '0', '--robot', 'arm.urdf', '--trajectory', 'path.yaml',
            '--rate', '50', '--no-plot', '--out', 'here', shares_domain=True) as demo:
        try:
            address = wait_for_line(
                demo.stdout, r'Open (http://127\.0\.0\.1:\d+/\?token=\S+) in a browser')[1]
            with Page(browser, address, COARSE) as page:
                wait_for_line(demo.stdout, 'Following')
                wait_for_line(demo.stdout, 'Move the arm with the sliders')
                yield page
            demo.send_signal(signal.SIGINT)
            out, err = demo.communicate(timeout=4 * TIMEOUT)
        except BaseException:
            demo.kill()
            raise
    assert demo.returncode == 0 or 'did not track' in err, out + err  # possible on a busy machine
    assert re.search(r'^joint2 .* 10 mrad', out, re.MULTILINE)
    assert 'Traceback' not in err


def test_the_page_has_everything_and_fetches_nothing_from_elsewhere(page):
    page.wait_for_words('1 mesh is not drawn; the first one: gone.stl')
    page.wait_for_words('follows a reference')
    words = page.words()
    for expected in ('planar_arm', '2 joints', 'joint1 [rad]', 'joint2 [rad]', 'Attach', 'Push',
                     'joint1: effort by term [N·m]', 'joint1: tracking error [mrad]'):
        assert expected in words
    assert page.tab.get_by_label('Collapse panel area').count() == 2
    image = page.tab.locator('canvas').first.bounding_box()
    assert image['width'] < SIZE['width'] - 600  # the image ends at the panels
    assert page.elsewhere == []
    assert [error for error in page.errors if 'favicon' not in error] == []


def test_the_arm_is_held_where_it_is(page, client):
    with client.collect(JointTrajectory, '/dynamics/joint_trajectory', KEEP_MANY) as trajectories:
        for _ in range(10):  # the viewer may not have discovered this subscriber
            page.press('Hold here')
            held = trajectories.find(lambda _: True, 3.0)
            if held is not None:
                break
        page.wait_for_words('follows a reference')
    np.testing.assert_allclose(held.points[-1].positions, END, atol=0.01)


def test_a_slider_moves_the_arm_and_its_picture(page, client):
    with client.collect(JointState, '/joint_states', KEEP_MANY) as states:
        before = page.picture()
        assert before.std() > 0.05, 'the picture is blank'
        page.drag(1, 0.75)
        page.wait_for_words('follows a reference')
        goal = page.value(1)
        assert abs(goal - 0.5 * np.pi) < 0.2
        wait_for_position(states, 'joint1', goal)
        wait_for_position(states, 'joint2', 0.524, 0.02)
    wait_until(page.has_arm_in_view, 'the arm between the panels')
    assert page.differs_from(before, 0.02), 'the picture of the arm has not moved'


def test_the_plots_draw_what_the_arm_does(page):
    plots = page.tab.locator('.uplot canvas')
    assert plots.count() == 2
    inked = """canvas => {
        const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return data.filter((value, i) => i % 4 == 3 && value > 0).length;
    }"""
    assert plots.nth(0).evaluate(inked) > 1000


def test_a_load_is_attached_and_taken_off(page, client):
    with client.collect(InertiaStamped, '/dynamics/payload', LATCHED) as payloads:
        place = page.place_of('Detach')
        page.press('Attach')
        attached = payloads.wait_for(lambda payload: payload.inertia.m == 1.0)
        assert attached.header.frame_id == 'tool0'
        page.wait_for_words('payload of the controller: 1 kg on tool0')
        assert page.place_of('Detach') == place, 'the button moves under the pointer'
        payloads.clear()
        page.press('Detach')
        payloads.wait_for(lambda payload: payload.inertia.m == 0.0)


def test_a_push_is_a_force_in_the_frame_of_the_link_and_ends(page, client):
    topic = '/simulated_arm/external_wrench'
    with client.collect(WrenchStamped, topic, KEEP_MANY) as wrenches:
        wrenches.wait_matched()
        page.press('Push')
        wrenches.wait_for(lambda message: size_of(message) == 0.0)
        pushes = [message for message in wrenches.messages if size_of(message) > 0.0]
    assert {message.header.frame_id for message in pushes} == {'tool0'}
    np.testing.assert_allclose([size_of(message) for message in pushes], 30.0)


def size_of(message):
    force = message.wrench.force
    return float(np.linalg.norm((force.x, force.y, force.z)))


def test_a_reset_puts_the_simulated_arm_back(page, client):
    with client.collect(JointState, '/joint_states', KEEP_MANY) as states:
        page.press('Reset')
        wait_for_position(states, 'joint1', START[0])
