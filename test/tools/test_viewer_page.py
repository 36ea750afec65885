# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The viewer in a real browser, with real nodes: its display, and its controls."""

import re
import signal

from browser import Page
from demo_process import start_demo, wait_for_line
from disturbances import wrench
from geometry_msgs.msg import InertiaStamped, WrenchStamped
import numpy as np
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import must_have_everything
from ros_harness import (
    DYNAMICS,
    KEEP_MANY,
    LATCHED,
    LONG,
    NodeProcess,
    running,
    SIMULATED_ARM,
    TIMEOUT,
    wait_until,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
import trimesh  # noqa: E402

VIEWER = 'robot_dynamics.tools.viewer'
TRAJECTORIES = '/default_arm/dynamics/joint_trajectory'
COARSE = 0.5
"""Scale of the page, which software draws: a quarter the pixels."""


def wait_for_position(states, joint, value, tolerance=0.01):
    """Wait until a joint is at the expected position."""
    return states.wait_for(lambda state: abs(
        dict(zip(state.name, state.position))[joint] - value) < tolerance, LONG)


# --- viewer and demo -----------------------------------------------------------------------------

def test_the_demo_waits_for_the_page_and_continues_after_the_motion(browser, tmp_path):
    with start_demo(tmp_path, '--viewer', '0', '--duration', '1', '--rate', '100', '--no-plot',
                    '--out', 'here') as demo:
        try:
            address = wait_for_line(
                demo.stdout, r'Open (http://127\.0\.0\.1:\d+/\?token=\S+) in a browser')[1]
            with Page(browser, address, COARSE):
                wait_for_line(demo.stdout, 'Following')
                wait_for_line(demo.stdout, 'Move the arm with the sliders')
            demo.send_signal(signal.SIGINT)
            out, err = demo.communicate(timeout=4 * TIMEOUT)
        except BaseException:
            demo.kill()
            raise
    assert demo.returncode == 0 or 'did not track' in err, out + err  # possible on a busy machine
    assert re.search(r'^joint2 .* 10 mrad', out, re.MULTILINE)
    assert 'Traceback' not in err


# --- the default arm, on one page for all tests --------------------------------------------------

@pytest.fixture(scope='module')
def page(browser, tmp_path_factory):
    """Yield the page of the default arm with a mesh, and with a mesh that is missing."""
    directory = tmp_path_factory.mktemp('arm')
    trimesh.creation.box((0.1, 0.1, 1.0)).export(directory / 'box.stl')
    urdf = default_arm_urdf().replace('0.9 0.45 0.1', '0.3 0.3 0.3')  # a link as red as an arc
    for box, mesh in (('0.1 0.1 1.0', 'box.stl'), ('0.08 0.08 0.8', 'gone.stl')):
        urdf = urdf.replace(f'<box size="{box}" />', f'<mesh filename="{mesh}" />')
    path = directory / 'arm.urdf'
    path.write_text(urdf)
    parameters = {'robot_description_file': str(path)}
    nodes = (
        NodeProcess(DYNAMICS, parameters, namespace='/default_arm'),
        NodeProcess(SIMULATED_ARM, {
            **parameters, 'rate': 200.0, 'lock_step': True, 'real_time_factor': 1.0,
            'initial_position': [0.785, 0.524]}, namespace='/default_arm'))
    viewer = NodeProcess(
        VIEWER, namespace='/default_arm', arguments=('--port', '0', '--robot', str(path)),
        ready=re.compile('viewer: open'))
    with running(*nodes), viewer:
        address = re.search(r'http://\S+', viewer.wait_for_log('viewer: open'))[0]
        with Page(browser, address, COARSE) as page:
            yield page


def test_the_page_has_everything_and_fetches_nothing_from_elsewhere(page):
    page.wait_for_words('1 mesh is not drawn; the first one: gone.stl')
    page.wait_for_words('follows a reference')
    words = page.words()
    for expected in ('planar_arm', '2 joints', 'joint1 [rad]', 'joint2 [rad]', 'Attach', 'Push',
                     'joint1: effort by term [N·m]', 'joint1: tracking error [mrad]'):
        assert expected in words
    assert page.elsewhere == []
    assert [error for error in page.errors if 'favicon' not in error] == []


def test_the_arm_is_held_where_it_is(page, client):
    with client.collect(JointTrajectory, TRAJECTORIES, KEEP_MANY) as trajectories:
        page.press('Hold here')
        page.wait_for_words('follows a reference')
        held = trajectories.wait_for()
    np.testing.assert_allclose(held.points[-1].positions, [0.785, 0.524], atol=0.01)


def test_a_slider_moves_the_arm_and_its_picture(page, client):
    with client.collect(JointState, '/default_arm/joint_states', KEEP_MANY) as states:
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
    with client.collect(InertiaStamped, '/default_arm/dynamics/payload', LATCHED) as payloads:
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
    topic = '/default_arm/simulated_arm/external_wrench'
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


@pytest.mark.soak
def test_the_wrench_on_a_link_its_axes_and_ellipsoid_are_drawn(page, client):
    drawn = {f'/marks/{mark}' for mark in (
        'external force/0', 'external torque/0', 'frame axes/0', 'frame axes/1', 'frame axes/2',
        'manipulability/0')}
    pushes = client.publisher(WrenchStamped, '/default_arm/simulated_arm/external_wrench')
    before = page.picture()
    pushes.publish(wrench('tool0', (10.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    wait_until(lambda: drawn <= set(page.tab.evaluate(
        'Object.keys(window.__viserMutable.nodeRefFromName)')), 'the marks of the wrench')
    assert page.differs_from(before, 0.01)
    pushes.publish(wrench('tool0'))


def test_a_reset_puts_the_simulated_arm_back(page, client):
    with client.collect(JointState, '/default_arm/joint_states', KEEP_MANY) as states:
        page.press('Reset')
        wait_for_position(states, 'joint1', 0.785)


@pytest.mark.soak
def test_the_arcs_have_the_colour_of_their_ratio_to_the_limit(page):
    """At the start joints take 33 and 19 % of their limits; with 6 kg at the tool, 91 and 95 %."""
    blue, red = '#0072B2', '#D55E00'
    assert page.shows(blue)
    assert not page.has(page.picture(), red)
    page.tab.get_by_label('mass [kg]').fill('6')
    page.press('Attach')
    page.wait_for_words('payload of the controller: 6 kg on tool0')
    assert page.shows(red)
    page.press('Detach')
