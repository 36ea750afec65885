# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Check a built site: `check_site.py DIRECTORY`.

Every link to a page, a picture or an anchor leads somewhere, every anchor is there once, and
nothing is loaded from another server. Exit status: 0 all is well, 1 what is not is printed.
"""

from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
import re
import sys
from urllib.parse import unquote, urlsplit

LOADED = {'script': 'src', 'link': 'href', 'img': 'src', 'iframe': 'src', 'source': 'src'}
"""What a browser loads by itself, by element."""


class _Page(HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or '' for name, value in attrs}
        if 'id' in values:
            self.anchors.append(values['id'])
        if tag == 'a' and 'href' in values:
            self.links.append(values['href'])
        if LOADED.get(tag, '') in values:
            self.loaded.append(values[LOADED[tag]])


def faults_of(directory: Path) -> list[str]:
    """Return a line for each dead link, repeated anchor, and what comes from elsewhere."""
    pages = {
        file.resolve(): _Page(file.read_text(encoding='utf-8'))
        for file in sorted(directory.rglob('*.html'))}
    if not pages:
        return [f'{directory} has no page']
    faults = []
    for file, page in pages.items():
        if file.name == '404.html':  # made for the root of a server
            continue
        name = file.relative_to(directory.resolve())
        repeated = {anchor for anchor in page.anchors if page.anchors.count(anchor) > 1}
        faults += [f'{name}: the anchor #{anchor} is there twice' for anchor in sorted(repeated)]
        faults += [f'{name}: loads {target}' for target in page.loaded if urlsplit(target).netloc]
        for target in {*page.links, *page.loaded}:
            if not _is_there(target, file, pages):
                faults.append(f'{name}: {target} leads nowhere')
    for style in directory.rglob('*.css'):
        for target in re.findall(r'url\(["\']?(?:https?:)?//[^)]*|@import[^;]*//[^;]*',
                                 style.read_text(encoding='utf-8')):
            faults.append(f'{style.relative_to(directory)}: loads {target}')
    return sorted(faults)


def _is_there(target: str, file: Path, pages: dict[Path, _Page]) -> bool:
    parts = urlsplit(target)
    if parts.scheme or parts.netloc:
        return parts.scheme in ('http', 'https', 'mailto', 'data')
    goal = (file.parent / unquote(parts.path)).resolve() if parts.path else file
    if goal.is_dir():
        goal = goal / 'index.html'
    if not goal.is_file():
        return False
    return (not parts.fragment or goal not in pages
            or unquote(parts.fragment) in pages[goal].anchors)


def main(arguments: Sequence[str]) -> int:
    """Print all faults; return the exit status."""
    faults = faults_of(Path(arguments[0]))
    for fault in faults:
        print(f'check_site: {fault}', file=sys.stderr)
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
