# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/viewer.png: the page of the viewer, with a UR10 that moves a load of 5 kg.

The script needs Chromium.
"""

from contextlib import ExitStack
import os
from pathlib import Path
import re
import sys
import tempfile
import time

from matplotlib.image import imread
import numpy as np
from robot_dynamics_tools.demo.loop import STEP_BY_STEP
from robot_dynamics_tools.processes import (
    choose_domain,
    DYNAMICS,
    MONITOR,
    Nodes,
    SIMULATED_ARM,
    VERBS,
)
from robot_dynamics_tools.reporting.figures import PURPLE

sys.path.insert(0, str(Path(__file__).parents[2] / 'test' / 'support'))
import browser  # noqa: E402
from robots import robot_path  # noqa: E402

JOINTS = ['shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint',
          'wrist_2_joint', 'wrist_3_joint']
POSE = [0.3, -1.0, 1.6, -0.6, -1.4, 0.0]
LIFT, ELBOW, FORCE, SECONDS = 2, 3, 7, 8
"""Sliders, the speed being number 0."""
SIZE = {'width': 1400, 'height': 800}
SCENE = slice(370, 1070)
"""Columns of pixels between the panels."""
ARROW_PIXELS = 2000
"""Purple pixels of an image that shows the arrow of the push, and not only arcs."""
TRIES = 10
"""A busy machine draws some pushes too late."""
PATIENT = {'state_timeout': 5.0}
"""The browser draws in software, and takes much of the time."""


def main(directory: Path) -> int:
    """Write the picture into a directory."""
    os.environ.update(choose_domain(os.environ))
    browser.SIZE.update(SIZE)
    robot = {'robot_description_file': str(robot_path('ur10')), 'joints': JOINTS}
    with tempfile.TemporaryDirectory() as work, ExitStack() as stack:
        nodes = Nodes(Path(work))
        stack.callback(nodes.stop)
        nodes.start('dynamics', DYNAMICS, {**robot, **PATIENT})
        nodes.start('simulated_arm', SIMULATED_ARM, {
            **robot, **STEP_BY_STEP, 'initial_position': POSE})
        nodes.start('dynamics_monitor', MONITOR, {})
        viewer = nodes.start('viewer', VERBS, {}, arguments=('viewer', '--port', '0'))
        while (address := re.search(r'http://\S+', viewer.text())) is None:
            nodes.check()
            time.sleep(0.1)
        with browser.chromium(Path(work)) as program, browser.Page(program, address[0]) as page:
            photograph(page, directory / 'viewer.png')
    return 0


def photograph(page: browser.Page, path: Path) -> None:
    """Attach a load, push, move two joints, and take the picture in the middle of it."""
    page.wait_for_words('follows a reference')
    page.tab.locator('.mantine-Notification-closeButton').first.click()  # it draws without a GPU
    page.tab.get_by_label('mass [kg]').fill('5')
    page.press('Attach')
    page.wait_for_words('payload of the controller: 5 kg')
    page.tab.get_by_label('joint', exact=True).first.click()
    page.tab.get_by_role('option', name='shoulder_lift_joint').click()
    page.drag(FORCE, 0.3)
    page.drag(SECONDS, 0.6)
    page.drag(LIFT, 0.39)
    page.wait_for_words('follows a reference')
    time.sleep(5.0)  # for the plots to show it
    page.drag(ELBOW, 0.72)
    time.sleep(2.0)
    for _ in range(TRIES):
        page.press('Push')
        page.tab.mouse.wheel(0, -2000)  # to the status and the table of efforts
        time.sleep(1.5)
        page.tab.screenshot(path=path)
        pixels = imread(path)[:, SCENE, :3]
        purple = [int(PURPLE[k:k + 2], 16) / 255.0 for k in (1, 3, 5)]
        if (np.abs(pixels - purple).max(axis=2) < 0.12).sum() > ARROW_PIXELS:
            return
        time.sleep(3.0)
    raise RuntimeError(f'{path} shows no push after {TRIES} tries')


if __name__ == '__main__':
    sys.exit(main(Path(sys.argv[1])))
