# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The pages on the site and on GitHub: links, anchors, and the conversions by the site."""

import ast
from pathlib import Path
import re
import sys

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / 'docs' / 'site'))

import python_pages  # noqa: E402
import site_links  # noqa: E402
import words  # noqa: E402

PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').rglob('*.md'))]
NOTEBOOKS = sorted((ROOT / 'docs').rglob('*.ipynb'))


def anchors(page: Path) -> list[str]:
    text = site_links.FENCE.sub('', page.read_text(encoding='utf-8'))
    return [site_links.github_slug(heading)
            for heading in re.findall(r'^#+ (.+)$', text, re.MULTILINE)]


@pytest.mark.parametrize(
    'page', PAGES + NOTEBOOKS, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_their_anchors_to_headings(page):
    for link in site_links.links(page.read_text(encoding='utf-8')):
        path, _, anchor = link.partition('#')
        target = page.parent / path if path else page
        assert '://' in link or target.exists(), f'{link}: there is no such file'
        if anchor and not link.startswith('http'):
            assert anchor in anchors(target), f'{link}: {target.name} has no such heading'


def test_every_page_is_in_the_navigation_or_one_link_away():
    navigation = (ROOT / 'mkdocs.yml').read_text(encoding='utf-8').split('\nnav:\n')[1]
    entries = navigation.strip().splitlines()
    assert len(entries) <= 30, 'entries, headings included'
    assert 'safety.md' in entries[1]
    shown = {ROOT / 'docs' / page for page in re.findall(r': ([\w/]+\.md)$', navigation, re.M)}
    shown = {page for page in shown if page.exists()} | {ROOT / 'README.md'}
    linked = {(page.parent / link.partition('#')[0]).resolve() for page in shown
              for link in site_links.links(page.read_text(encoding='utf-8'))}
    assert not {*words.pages(), *words.appendix()} - shown - linked


def test_the_pages_without_the_appendix_are_short():
    assert words.words(words.pages()) <= words.MOST_WORDS


# --- links ---------------------------------------------------------------------------------------

@pytest.mark.parametrize(('link', 'source', 'page', 'shown'), [
    ('docs/safety.md', 'README.md', 'index.md', 'safety.md'),
    ('../safety.md', 'docs/reference/topics.md', 'reference/topics.md', '../safety.md'),
    ('#what', 'docs/safety.md', 'safety.md', '#what'),
    ('../README.md#status', 'docs/safety.md', 'safety.md', 'index.md#status'),
    ('../setup.py', 'docs/safety.md', 'safety.md', 'code/setup.py.md'),
    ('examples/one_process.py', 'docs/safety.md', 'safety.md',
     'code/docs/examples/one_process.py.md'),
    ('https://a.example/b', 'README.md', 'index.md', 'https://a.example/b'),
])
def test_links_lead_to_pages_of_the_site(link, source, page, shown):
    text = f'see [this]({link}), not\n```\n[that]({link})\n```\n'
    assert site_links.with_links_of_site(text, source, page) == text.replace(link, shown, 1)


@pytest.mark.parametrize(('link', 'source'), [
    ('absent.yaml', 'README.md'), ('../../absent', 'docs/safety.md')])
def test_links_to_nothing_are_refused(link, source):
    with pytest.raises(ValueError, match='absent'):
        site_links.target_in_site(link, source)


# --- the reference of Python ---------------------------------------------------------------------

def test_each_package_has_a_page_with_its_names_and_modules():
    pages = python_pages.python_pages()
    packages = python_pages.packages()
    assert {'robot_dynamics', 'robot_dynamics.urdf', 'robot_dynamics.model'} <= set(packages)
    assert not {'robot_dynamics.ros', 'robot_dynamics_tools.viewer'} & set(packages)
    assert len(pages) == len(packages) + 1
    for package in packages:
        name = python_pages._file(package).removesuffix('.md')
        row = rf'^\| \[`{package}`\]\(python/{name}\.md\) \| .+ \|$'
        assert re.search(row, pages['reference/python.md'], re.MULTILINE), package
        for module in python_pages.modules(package):
            assert f'::: {module}\n' in pages[f'reference/python/{name}.md']
    link = '[`load_arm`][robot_dynamics.model.arm.load_arm]'
    assert link in pages['reference/python/model.md']


def test_what_examples_import_is_in_the_reference():
    found = {
        (module, name.split()[0]) for page in PAGES + NOTEBOOKS
        for module, names in re.findall(
            r'from (robot_dynamics[\w.]*) import (\w[\w, ]*)', page.read_text(encoding='utf-8'))
        for name in names.rstrip(' ,').split(',')}
    assert {('robot_dynamics.model', 'load_arm'), ('robot_dynamics', 'load_arm')} <= found
    packages = python_pages.packages()
    modules = {module for package in packages for module in python_pages.modules(package)}
    offered = {f'{package}.{name}'
               for package in packages for name in python_pages.public_names(package)}
    for module, name in found:
        if not module.startswith('robot_dynamics.ros.') and module not in modules:
            assert f'{module}.{name}' in {*packages, *modules, *offered}


def test_xml_in_docstrings_is_marked_as_code():
    """In Markdown an unmarked <inertial> is an element of the page, which is not visible."""
    for package in python_pages.packages():
        for file in python_pages.folder_of(package).glob('*.py'):
            for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
                if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                    text = re.sub(r'`[^`]*`', '', str(node.value.value))
                    assert not re.search(r'</?[A-Za-z]', text), f'{file.name}: {text}'
