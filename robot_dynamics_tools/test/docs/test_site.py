# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The pages on GitHub and on the site: links, anchors, length. Sphinx checks the site itself."""

from pathlib import Path
import re
import sys

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / 'docs' / 'site'))

import words  # noqa: E402

PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').rglob('*.md'))]
NOTEBOOKS = sorted((ROOT / 'docs').rglob('*.ipynb'))
FENCE = re.compile(r'^(```|~~~).*?^\1[`~]*$', re.MULTILINE | re.DOTALL)


def text_of(page: Path) -> str:
    """Return the text of a page without blocks of code."""
    return FENCE.sub('', page.read_text(encoding='utf-8'))


def anchors(page: Path) -> list[str]:
    """Return the anchors that GitHub gives the headings."""
    return [re.sub(r'[^\w\- ]', '', heading.strip().lower()).replace(' ', '-')
            for heading in re.findall(r'^#+ (.+)$', text_of(page), re.MULTILINE)]


@pytest.mark.parametrize(
    'page', PAGES + NOTEBOOKS, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_their_anchors_to_headings(page):
    for link in re.findall(r'(?<=\]\()([^)\s]+)(?=\))', text_of(page)):
        path, _, anchor = link.partition('#')
        target = page.parent / path if path else page
        assert '://' in link or target.exists(), f'{link}: there is no such file'
        if anchor and not link.startswith('http'):
            assert anchor in anchors(target), f'{link}: {target.name} has no such heading'


def test_the_pages_are_few_and_short():
    assert len(words.pages()) <= words.MOST_PAGES
    assert words.words(words.pages()) <= words.MOST_WORDS
