# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The view of a page: the arm and its labels are between the panels, until a user moves it."""

from contextlib import closing

from browser import Page
import numpy as np
import pytest
from robot_dynamics.pictures.arm_marks import ArmMarks
from robot_dynamics.ros.dynamics.markers import drawn
from robots import must_have_everything, robot_urdf
from ros_harness import wait_until

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
from robot_dynamics.tools.viewer import framing
from robot_dynamics.tools.viewer.framing import Cameras, framed
from robot_dynamics.tools.viewer.labels import spread, View
from robot_dynamics.tools.viewer.panel import ArmPanel
from robot_dynamics.tools.viewer.scene import ArmScene
from robot_dynamics.tools.viewer.server import address_of
from viewer_bench import arm_called, TESTED_TOKEN

LAPTOP = {'width': 1300, 'height': 800}
COARSE = 0.5
"""Scale of the page, which software draws: a quarter the pixels."""
FOLD = 'Collapse panel area'
VIEW = View(
    position=np.array([0.0, -4.0, 0.0]),
    rotation=np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    field_of_view=0.8, width=700.0, height=800.0)
"""A view along y, with x to the right."""
WRIST = 'wrist_2_joint: 1.2 N·m'
CHARACTER, LINE = 6.3, 16.0
"""Width of a character and height of a label [pixel]."""


# --- labels --------------------------------------------------------------------------------------

def test_a_point_has_its_pixel_and_depth():
    columns, rows, depths = VIEW.project(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]]))
    np.testing.assert_allclose(columns, [350.0, 350.0 + VIEW.focal_length / 4.0])
    np.testing.assert_allclose(rows, [400.0, 400.0 - VIEW.focal_length / 8.0])
    np.testing.assert_allclose(depths, 4.0)
    assert VIEW.focal_length == pytest.approx(400.0 / np.tan(0.4))


@pytest.mark.parametrize(('x', 'text', 'anchor'), [
    (0.0, WRIST, 'top-left'), (1.2, WRIST, 'top-right'), (1.2, '0 N', 'top-left'),
    (-1.2, WRIST, 'top-left')])
def test_no_label_extends_below_the_panel(x, text, anchor):
    assert spread(VIEW, np.array([[x, 0.0, 0.0]]), [text]) == [anchor]


def overlaps(view, points, texts, anchors):
    """Return the pairs of texts whose labels overlap in the image."""
    columns, rows, _ = view.project(points)
    widths = CHARACTER * np.array([len(text) for text in texts])
    left = columns - widths * np.equal(anchors, 'top-right')
    return [
        (texts[i], texts[k]) for i in range(len(texts)) for k in range(i)
        if left[i] < left[k] + widths[k] and left[k] < left[i] + widths[i]
        and abs(rows[i] - rows[k]) < LINE - 1e-6]


@pytest.mark.parametrize('scale', [0.0, 0.02, 0.3])
def test_labels_do_not_overlap_in_the_image(scale):
    points = scale * np.random.default_rng(3).normal(size=(12, 3))
    before = VIEW.project(points)
    texts = [f'joint{i}: {-i} N·m' for i in range(len(points))]
    anchors = spread(VIEW, points, texts)
    assert overlaps(VIEW, points, texts, anchors) == []
    after = VIEW.project(points)
    np.testing.assert_allclose(after[[0, 2]], before[[0, 2]])  # they only rise


# --- cameras -------------------------------------------------------------------------------------

def view_from(points, aspect):
    """Return the view of a camera that shows points, 800 pixels high."""
    position, target = framed(points, aspect)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(forward, right), forward])
    return View(position, rotation, 0.8, 800.0 * aspect, 800.0)


@pytest.mark.parametrize(('aspect', 'size'), [(0.75, 0.1), (1.5, 30.0)])
def test_an_arm_of_any_size_fills_the_same_part_of_the_image(aspect, size):
    points = size * np.random.default_rng(5).uniform(-1.0, 1.0, (40, 3))
    view = view_from(points, aspect)
    columns, rows, _ = view.project(points)
    middle = np.array([view.width, view.height]) / 2.0
    filled = np.abs(np.column_stack([columns, rows]) - middle).max(axis=0) / middle
    assert filled.max() == pytest.approx(0.8)


@pytest.fixture(scope='module')
def page_of_ur10(browser, server, tmp_path_factory):
    """Yield a page at 1300 x 800, a function that moves the robot, and the camera of the page."""
    arm, marks = arm_called('ur10'), ArmMarks(arm_called('ur10'))
    cameras = Cameras(server)
    bones = robot_urdf('ur10').replace('example-robot-data', 'gone')  # meshes are drawn slowly
    with closing(ArmScene(server, arm, bones, tmp_path_factory.mktemp('gone'))) as scene, \
            closing(ArmPanel(server.gui, arm, lambda do: do())):
        def move(*angles, size=1.0):
            q = np.clip(
                np.resize(angles, arm.joint_count), arm.limits.lower, arm.limits.upper)
            scene.move(q)
            effort = 0.3 * np.minimum(arm.limits.effort, 100.0)
            scene.mark(drawn(marks, arm, q, effort, None).markers)
            cameras.show(size * scene.extent())

        scene.move(np.zeros(arm.joint_count))
        cameras.restart(scene.extent())
        with Page(browser, address_of(server, TESTED_TOKEN), COARSE, LAPTOP) as page:
            wait_until(server.get_clients, 'the page')
            (client,) = server.get_clients().values()
            move(0.0)
            yield page, move, client.camera
        wait_until(lambda: not server.get_clients(), 'the end of the page')


def test_the_arm_is_between_the_panels(page_of_ur10):
    page, move, _ = page_of_ur10
    assert page.tab.get_by_label(FOLD).count() == 2
    image = page.tab.locator('canvas').first.bounding_box()
    assert image['width'] < LAPTOP['width'] - 600  # the image ends at the panels
    for angles in ((0.0,), (0.7, -0.8, 0.9, -0.4)):
        move(*angles)
        wait_until(page.has_arm_in_view, 'the arm between the panels')


def test_the_camera_comes_closer_again(page_of_ur10, monkeypatch):
    monkeypatch.setattr(framing, 'PATIENCE', 0.5)
    _, move, camera = page_of_ur10
    move(0.0)
    near = float(np.linalg.norm(camera.position))
    move(0.0, size=3.0)
    wait_until(lambda: np.linalg.norm(camera.position) > 2.0 * near, 'the camera farther')

    def is_near():
        move(0.0)
        return np.linalg.norm(camera.position) < 1.1 * near
    wait_until(is_near, 'the camera closer')


def test_a_camera_that_the_user_moves_stays(page_of_ur10):
    """The last test of the page, because the camera belongs to the user from now on."""
    page, move, camera = page_of_ur10
    before = np.array(camera.position)
    page.tab.mouse.move(0.5 * LAPTOP['width'], 0.5 * LAPTOP['height'])
    page.tab.mouse.wheel(0, -400)  # closer
    wait_until(lambda: np.linalg.norm(camera.position - before) > 0.3, 'the closer camera')
    page.tab.wait_for_timeout(1000)  # the camera comes to rest
    own = np.array(camera.position)
    move(1.5, -1.5)
    page.tab.wait_for_timeout(1000)
    np.testing.assert_allclose(camera.position, own, atol=1e-3)
