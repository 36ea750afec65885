# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The elements of an HTML report that tests look at."""

from html.parser import HTMLParser


class ReportPage(HTMLParser):
    """Collects the references of a page, its tags, and its texts, without scripts and styles."""

    def __init__(self, text):
        super().__init__()
        self.links, self.cells, self.tags = [], [], set()
        self._is_code = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self._is_code = tag in ('script', 'style')
        self.links += [value for name, value in attrs if name in ('src', 'href')]

    def handle_endtag(self, tag):
        self._is_code = False

    def handle_data(self, data):
        if not self._is_code:
            self.cells.append(data)

    @property
    def text(self):
        """The text of the page, without line breaks."""
        return ' '.join(' '.join(self.cells).split())

    @property
    def is_complete(self):
        """Whether the page refers to nothing outside of itself."""
        return not {'link', 'iframe'} & self.tags and all(
            link.startswith('data:image/png;base64,iVBOR') for link in self.links)
