# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The view of a page: no label covers another one, and the arm fills the image."""

import numpy as np
import pytest
from robot_dynamics_tools.viewer.views import framed, spread, View, with_room_below

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


def test_on_a_narrow_page_the_arm_is_in_the_upper_part():
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.5], [0.6, 0.0, 1.0]])
    columns, rows, _ = view_from(with_room_below(points), 420.0 / 800.0).project(points)
    assert 0.0 < rows.min() < rows.max() < 0.45 * 800.0
    assert 0.0 < columns.min() < columns.max() < 420.0
