# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The documentation site in a real browser: readable on a narrow screen."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import sys
from typing import Any

from browser import chromium, CUT_OFF, NARROW, PATIENCE
import children
import pytest
from robots import must_have_everything

if not must_have_everything():
    pytest.importorskip('mkdocs', reason='the site needs mkdocs')
    pytest.importorskip('mkdocstrings', reason='the site needs mkdocstrings')

ROOT = Path(__file__).parents[2]
PAGES = ('index', 'safety', 'concepts', 'reference/parameters', 'evidence/benchmarks')
"""With a picture, with tables of sentences, of formulas, of parameters and of outputs."""


@pytest.fixture(scope='module')
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Any]]:
    """Return a function that opens a page of the site in a narrow browser."""
    directory = tmp_path_factory.mktemp('site')
    children.run(
        [sys.executable, '-m', 'mkdocs', 'build', '--quiet', '--site-dir', str(directory)],
        timeout=300.0, check=True, cwd=ROOT,
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'})
    with chromium(tmp_path_factory.mktemp('browser')) as browser:
        tab = browser.new_page(viewport=NARROW)
        tab.set_default_timeout(PATIENCE)
        yield lambda name: (tab.goto((directory / f'{name}.html').as_uri()), tab)[1]


@pytest.mark.soak
@pytest.mark.parametrize('name', PAGES)
def test_a_page_is_readable_on_a_narrow_screen(opened, name):
    tab = opened(name)
    assert tab.evaluate('document.documentElement.scrollWidth') <= NARROW['width']
    assert tab.evaluate(CUT_OFF) == []
    for cell in tab.locator('table td:nth-child(2)').all()[:20]:
        assert cell.bounding_box()['width'] > 100.0, cell.inner_text()
    for image in tab.locator('p > img').all():  # its text is legible
        assert image.evaluate('one => one.width >= Math.min(one.naturalWidth, 700)')
