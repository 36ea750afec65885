# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Links of the repository as links of the site, and pages that show files of the repository."""

from pathlib import Path
import posixpath
import re

ROOT = Path(__file__).resolve().parents[2]
CODE = 'code'
"""The directory of the site with the files of the repository that a page links to."""
PAGES_OF_FILES = {'README.md': 'index.md', 'CONTRIBUTING.md': 'contributing.md'}

LINK = re.compile(r'(?<=\]\()([^)\s]+)(?=\))')
FENCE = re.compile(r'^(```|~~~).*?^\1[`~]*$', re.MULTILINE | re.DOTALL)


def github_slug(heading: str, separator: str = '-') -> str:
    """Return the anchor that GitHub gives a heading, so that one link serves both."""
    return re.sub(r'[^\w\- ]', '', heading.strip().lower()).replace(' ', separator)


def links(text: str) -> list[str]:
    """Return the targets of all links outside of code between fences."""
    return LINK.findall(FENCE.sub('', text))


def target_in_site(target: str, source: str) -> str:
    """
    Return a link in a file of the repository as one of the site, relative to its root.

    `source` is that file. Links to other servers, and within a page, stay unchanged. Raises
    ValueError if the file does not exist.
    """
    path, mark, anchor = target.partition('#')
    if re.match(r'[a-z]+:', target) or not path:
        return target
    path = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    if path in PAGES_OF_FILES:
        return PAGES_OF_FILES[path] + mark + anchor
    if path.startswith('docs/') and not path.endswith('.py'):  # mkdocs.yml excludes programs
        return path.removeprefix('docs/') + mark + anchor
    if path.startswith('..') or not (ROOT / path).exists():
        raise ValueError(f'{target!r} leads to no file of the repository')
    return f'{CODE}/{path}.md{mark}{anchor}'


def with_links_of_site(text: str, source: str, page: str) -> str:
    """Return the text of the file `source` as that of a page, its links relative to the page."""
    def replace(found: re.Match[str]) -> str:
        target = target_in_site(found[0], source)
        path, mark, anchor = target.partition('#')
        if not path or re.match(r'[a-z]+:', target):
            return target
        if path == page:
            return mark + anchor
        return posixpath.relpath(path, posixpath.dirname(page) or '.') + mark + anchor

    done, end = [], 0
    for fence in FENCE.finditer(text):  # code stays unchanged
        done += [LINK.sub(replace, text[end:fence.start()]), fence[0]]
        end = fence.end()
    return ''.join([*done, LINK.sub(replace, text[end:])])


def code_page(path: str) -> str:
    """Return the page that shows a file of the repository, or what is in a directory."""
    file = ROOT / path
    if file.is_dir():
        inside = sorted(
            child.relative_to(ROOT).as_posix() for child in file.rglob('*')
            if child.is_file() and '__pycache__' not in child.parts)
        return '\n\n'.join([
            f'# {path.rstrip("/")}',
            *(f'## {name}\n\n{_shown(name)}' for name in inside)])
    return f'# {path}\n\n{_shown(path)}'


def _shown(path: str) -> str:
    text = (ROOT / path).read_text(encoding='utf-8').rstrip('\n')
    return f'~~~~\n{text}\n~~~~\n'
