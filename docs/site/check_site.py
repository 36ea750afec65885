# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Check that a built site is complete and loads nothing from elsewhere: `check_site.py DIRECTORY`.

MkDocs itself checks links and anchors (`validation:` in mkdocs.yml), and mkdocstrings checks
cross-references; a warning of either fails the build. Neither checks links to files that the site
excludes, or what the theme, plugins and style sheets make a browser load. The site must work
without a network.

Exit status: 0 without faults, 1 otherwise; each fault is printed.
"""

from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
import re
import sys
from urllib.parse import unquote, urlsplit

LOADED = {'script': 'src', 'link': 'href', 'img': 'src', 'iframe': 'src', 'source': 'src'}
"""The attribute with the address of what a browser loads, by element."""


class _Page(HTMLParser):
    """The addresses that a page loads, and those to which it links."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.linked: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [value for name, value in attrs if value and name == LOADED.get(tag)]
        self.linked += [value for name, value in attrs if value and (tag, name) == ('a', 'href')]


def faults_of(directory: Path) -> list[str]:
    """
    Return a line for each fault of a site.

    Faults are addresses of other servers that a page or a style sheet loads, and addresses within
    the site, also of fonts in style sheets, at which no file exists.
    """
    pages = {page: _Page(page.read_text(encoding='utf-8'))
             for page in sorted(directory.rglob('*.html'))}
    if not pages:
        return [f'{directory} has no page']
    loaded = {page: addresses.loaded for page, addresses in pages.items()}
    for style in sorted(directory.rglob('*.css')):
        loaded[style] = re.findall(
            r'(?:url\(|@import(?!\s*url))\s*["\']?([^"\')\s;]+)',
            style.read_text(encoding='utf-8'))
    return [
        f'{file.relative_to(directory)}: loads {address}'
        for file, addresses in loaded.items() for address in addresses
        if urlsplit(address).netloc] + [
        f'{file.relative_to(directory)}: links to {address}, which does not exist'
        for file, addresses in loaded.items()
        for address in dict.fromkeys(addresses + (pages[file].linked if file in pages else []))
        if not _exists(address, file, directory)]


def _exists(address: str, page: Path, directory: Path) -> bool:
    """Return whether an address of a page exists; those of other servers count as existing."""
    scheme, server, path, *_ = urlsplit(address)
    start = directory if path.startswith('/') else page.parent
    return bool(scheme or server or not path) or (start / unquote(path).lstrip('/')).exists()


def main(arguments: Sequence[str]) -> int:
    """Print all faults; return the exit status."""
    faults = faults_of(Path(arguments[0]))
    for fault in faults:
        print(f'check_site: {fault}', file=sys.stderr)
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
