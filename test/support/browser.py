# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A real browser for the tests of the viewer: Chromium without a window, driven by Playwright.

Without either of them the tests are skipped with the reason; if CI is set, they fail.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
import io
import os
from pathlib import Path
import shutil
import time
from typing import Any

from matplotlib.image import imread
import numpy as np
from numpy.typing import NDArray
from robots import missing
from ros_harness import LONG, TIMEOUT

# Rendering in software must leave processor time to the nodes.
OPTIONS = (
    '--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
    '--disable-dev-shm-usage')
SIZE = {'width': 1000, 'height': 600}
PATIENCE = 1000.0 * LONG
"""Timeout [ms]; rendering many triangles at low priority takes seconds."""
NARROW = {'width': 400, 'height': 800}
"""A telephone."""
CUT_OFF = """() => {
    const wide = document.documentElement.clientWidth + 1;
    const scrolls = element => ['auto', 'scroll'].includes(getComputedStyle(element).overflowX);
    const found = [...document.querySelectorAll('body *')].filter(element => {
        const {left, right} = element.getBoundingClientRect();
        if (left === right || element.closest('nav, math')) return false;
        for (let one = element.parentElement; one; one = one.parentElement)
            if (scrolls(one)) return false;
        return right > wide || left < -1
            || !scrolls(element) && element.scrollWidth > element.clientWidth + 1
            && element.clientWidth > 0;
    });
    return found.map(element => element.tagName + ' ' + element.className);
}"""
"""The elements of a page, except its menu, that are wider than the page or their container."""
ARM_BOX = """() => {
    const {camera, nodeRefFromName} = window.__viserMutable;
    const image = document.querySelector('canvas').getBoundingClientRect();
    const points = [];
    nodeRefFromName['/arm'].traverse(mesh => {
        if (!mesh.isMesh) return;
        mesh.geometry.computeBoundingBox();
        mesh.updateWorldMatrix(true, false);
        const {min, max} = mesh.geometry.boundingBox;
        for (const x of [min.x, max.x])
            for (const y of [min.y, max.y])
                for (const z of [min.z, max.z])
                    points.push(
                        min.clone().set(x, y, z).applyMatrix4(mesh.matrixWorld).project(camera));
    });
    const columns = points.map(point => image.left + 0.5 * (1 + point.x) * image.width);
    const rows = points.map(point => image.top + 0.5 * (1 - point.y) * image.height);
    return [Math.min(...columns), Math.min(...rows), Math.max(...columns), Math.max(...rows)];
}"""
"""The box around the meshes of the arm on the page: left, top, right, bottom [pixel]."""


@contextmanager
def chromium(directory: Path) -> Iterator[Any]:
    """
    Run the installed browser at low priority.

    It ends with the driver of Playwright, which ends with this process, because a pipe closes.
    """
    program = next(filter(None, map(
        shutil.which, ('chromium', 'chromium-browser', 'google-chrome'))), None)
    if program is None:
        missing('no Chromium on the PATH (Debian: apt install chromium)')
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing('no Playwright (pip install playwright)')
    polite = directory / 'chromium'
    prefix = ['nice', '-n', '5']
    if shutil.which('setpriv'):
        prefix += ['setpriv', '--pdeathsig', 'KILL']
        if os.getuid() == 0:
            # Otherwise the rendering process would raise its own priority.
            prefix += ['--bounding-set=-sys_nice']
    polite.write_text(f'#!/bin/sh\nexec {" ".join(prefix)} {program} "$@"\n')
    polite.chmod(0o755)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(polite), args=list(OPTIONS), timeout=PATIENCE)
        try:
            yield browser
        finally:
            browser.close()


class Page:
    """The page of a viewer; `close` it, or use it in a `with` statement."""

    def __init__(
        self, browser: Any, address: str, scale: float = 1.0, size: Mapping[str, int] = SIZE,
    ) -> None:
        """
        Open the page, and wait for the controls of an arm and the first image.

        `scale` is the number of rendered pixels per pixel of the layout, in each direction.
        """
        self.tab = browser.new_page(viewport=size, device_scale_factor=scale)
        self.tab.set_default_timeout(PATIENCE)
        self.errors: list[str] = []
        self.elsewhere: list[str] = []
        self.tab.on('pageerror', lambda error: self.errors.append(str(error)))
        self.tab.on('console', lambda message: message.type == 'error' and self.errors.append(
            message.text))
        own = (address, address.replace('http', 'ws'), 'data:', 'blob:')
        self.tab.on('request', lambda request: request.url.startswith(own) or (
            self.elsewhere.append(request.url)))
        self.tab.goto(address)
        self.tab.wait_for_selector('canvas')
        self.tab.get_by_text('Reference', exact=True).first.wait_for()

    def __enter__(self) -> 'Page':
        return self

    def __exit__(self, *_: object) -> None:
        self.tab.close()

    def press(self, button: str) -> None:
        """Click the button with this text."""
        self.tab.get_by_role('button', name=button, exact=True).click()

    def place_of(self, button: str) -> Mapping[str, float]:
        """Return the box of the button with this text [pixel], which is scrolled into view."""
        place = self.tab.get_by_role('button', name=button, exact=True)
        place.scroll_into_view_if_needed()
        box: Mapping[str, float] = place.bounding_box()
        return box

    def wait_for_words(self, words: str) -> None:
        """Wait until the page contains this text."""
        self.tab.get_by_text(words).first.wait_for()

    def words(self) -> str:
        """Return the text of the page."""
        return str(self.tab.inner_text('body'))

    def drag(self, slider: int, fraction: float) -> None:
        """Drag the n-th slider (0: speed) to a fraction of its range."""
        thumb = self.tab.get_by_role('slider').nth(slider)
        thumb.scroll_into_view_if_needed()
        track = thumb.locator('xpath=..').bounding_box()
        start = thumb.bounding_box()
        y = start['y'] + 0.5 * start['height']
        self.tab.mouse.move(start['x'] + 0.5 * start['width'], y)
        self.tab.mouse.down()
        self.tab.mouse.move(track['x'] + fraction * track['width'], y, steps=5)
        self.tab.mouse.up()

    def value(self, slider: int) -> float:
        """Return the value that the n-th slider shows."""
        return float(self.tab.get_by_role('slider').nth(slider).get_attribute('aria-valuenow'))

    def picture(self) -> NDArray[np.float64]:
        """Return the middle of the page, where the arm is, as (height, width, 3) in [0, 1]."""
        clip = {'x': 370, 'y': 190, 'width': 300, 'height': 400}
        picture = self.tab.screenshot(clip=clip)
        return np.asarray(imread(io.BytesIO(picture), format='png')[..., :3], dtype=np.float64)

    def has_arm_in_view(self) -> bool:
        """Return whether the box of the arm is between the panels and fills a good part of it."""
        left, top, right, bottom = self.tab.evaluate(ARM_BOX)
        image = self.tab.locator('canvas').first.bounding_box()
        is_inside = (
            image['x'] <= left and right <= image['x'] + image['width'] and top >= 0.0
            and bottom <= image['height'])
        return bool(is_inside and max(
            (right - left) / image['width'], (bottom - top) / image['height']) > 0.4)

    def differs_from(self, before: NDArray[np.float64], fraction: float) -> bool:
        """Return whether at least this fraction of the image soon changes, with some delay."""
        return self._soon(lambda picture: difference(before, picture) > fraction)

    def _soon(self, is_met: Callable[[NDArray[np.float64]], bool]) -> bool:
        end = time.monotonic() + TIMEOUT
        while not (met := is_met(self.picture())) and time.monotonic() < end:
            pass
        return met


def difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the fraction of the pixels that differ clearly between two images."""
    return float((np.abs(one - other).max(axis=2) > 0.15).mean())
