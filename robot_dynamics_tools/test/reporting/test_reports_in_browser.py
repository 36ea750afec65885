# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""HTML reports in a real browser: no request, no horizontal scrolling, and zoom."""

from contextlib import contextmanager
from functools import cache
import re

from browser import chromium, CUT_OFF, NARROW, PATIENCE
import pytest
from recordings import KnownMotion, write_recording
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.tools import check_model
from robot_dynamics_tools.commands import analyze, identify, torque_map
from robots import must_have_everything

if not must_have_everything():
    pytest.importorskip('bokeh', reason='the figures with zoom need the extra report')

SIZE = {'width': 1300, 'height': 900}
WIDE = """() => [...document.querySelectorAll('body, body *')].filter(
    element => element.clientWidth > 0 && element.scrollWidth > element.clientWidth + 1).map(
    element => element.tagName + ' ' + element.className)"""
"""The elements whose content is wider than they are."""
RANGES = """name => {
    const figure = Bokeh.documents[0].get_model_by_name(name)
    return [figure.x_range.start, figure.x_range.end, figure.y_range.start, figure.y_range.end]}"""
FIGURE = '.bk-Figure'
MOST_DRAGS = 100
ZOOMABLE = ('analyze', 'identify')
TOOLS = {tool.__name__.rpartition('.')[2]: tool
         for tool in (analyze, check_model, identify, torque_map)}


@pytest.fixture(scope='session')
def report_of(tmp_path_factory):
    """Return a function that returns the report of a tool for one arm."""
    directory = tmp_path_factory.mktemp('reports')
    urdf, weak = directory / 'arm.urdf', directory / 'weak.urdf'
    urdf.write_text(default_arm_urdf())
    weak.write_text(re.sub('effort="[^"]*"', 'effort="50"', default_arm_urdf()))

    @cache
    def report_of(name):
        tool, file = TOOLS[name], directory / f'{name}.html'
        if name == 'check_model':  # whose report has a finding
            words = [weak, '--report', file]
        elif name == 'torque_map':
            words = ['--urdf', urdf, '-o', file]
        else:
            file = directory / name / 'report.html'
            bag = write_recording(directory / f'{name}_bag', KnownMotion(seconds=16.0).messages())
            words = [bag, '--urdf', urdf, '--output', file.parent]
        assert tool.main(list(map(str, words))) == 0
        return file

    return report_of


@pytest.fixture(scope='module')
def browser(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp('browser')) as started:
        yield started


@contextmanager
def opened(browser, path, size=SIZE):
    """Yield a report in the browser, with the addresses it requested and its errors."""
    tab = browser.new_page(viewport=size)
    tab.set_default_timeout(PATIENCE)
    tab.requested, tab.errors = [], []
    tab.on('request', lambda made: tab.requested.append(made.url))
    tab.on('pageerror', lambda error: tab.errors.append(str(error)))
    tab.goto(path.as_uri())
    yield tab
    tab.close()


@pytest.mark.parametrize('name', [
    'check_model', *(pytest.param(name, marks=pytest.mark.soak) for name in (
        'torque_map', *ZOOMABLE))])
def test_a_report_needs_no_network_and_fits_a_wide_and_a_narrow_screen(browser, report_of, name):
    """It requests only itself, and scrolls in no element horizontally."""
    with opened(browser, report_of(name)) as tab:
        tab.wait_for_selector(FIGURE if name in ZOOMABLE else 'h1')
        assert [url for url in tab.requested if not url.startswith('data:')] == [tab.url]
        assert tab.evaluate('document.documentElement.scrollWidth') <= SIZE['width']
        assert tab.evaluate(WIDE) == []
    with opened(browser, report_of(name), NARROW) as tab:
        tab.wait_for_selector(FIGURE if name in ZOOMABLE else 'h1')
        assert tab.evaluate('document.documentElement.scrollWidth') <= NARROW['width']
        assert tab.evaluate(CUT_OFF) == []
        for table in tab.locator('table').all():  # columns of text have several words per line
            assert min(cell.bounding_box()['width'] for cell in table.locator(
                'tr > :last-child').all()) > 60.0
        assert all(image.bounding_box()['width'] > 700.0
                   for image in tab.locator('img').all() if image.is_visible())
        assert tab.errors == []


def drag(tab):
    """Drag over a fifth of the width of the first figure."""
    figure = tab.locator(FIGURE).first
    figure.scroll_into_view_if_needed()
    box = figure.bounding_box()
    y = box['y'] + 0.6 * box['height']
    tab.mouse.move(box['x'] + 0.4 * box['width'], y)
    tab.mouse.down()
    tab.mouse.move(box['x'] + 0.6 * box['width'], y, steps=20)
    tab.wait_for_timeout(200)
    tab.mouse.up()
    tab.wait_for_timeout(200)


def test_figures_zoom_together_and_are_static_on_paper(browser, report_of):
    with opened(browser, report_of('analyze')) as tab:
        tab.wait_for_selector(FIGURE)
        static, interactive = tab.locator('.zoomable .static'), tab.locator('.interactive')
        for media, is_printed in (('screen', False), ('print', True)):
            tab.emulate_media(media=media)
            assert (static.is_visible(), interactive.is_visible()) == (is_printed, not is_printed)
        tab.emulate_media(media='screen')
        name = 'joint1: Measured and model'
        tab.wait_for_function(f'Bokeh.documents[0].get_model_by_name("{name}").y_range.end > 0')
        start, end, _, _ = tab.evaluate(RANGES, name)
        assert 15.0 < end - start < 17.0  # the whole recording
        for _ in range(MOST_DRAGS):  # the page may still be busy during the first one
            drag(tab)
            left, right, _, _ = tab.evaluate(RANGES, name)
            if right < end - 1.0:
                break
        assert start < left < right < end
        assert right - left < 0.5 * (end - start)
        assert tab.evaluate(RANGES, 'joint2: Residual')[:2] == [left, right]
        assert tab.errors == []
