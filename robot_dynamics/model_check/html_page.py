# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Self-contained HTML reports: first the verdicts, then the origin, tables, lists and figures.

Every report begins with a verdict and a next step per row (a joint, or a part of the model). The
origin names the URDF, the tool with its version, the command and the date. On a screen, a
report shows figures with zoom if there are any; in print, and without JavaScript, it shows their
static counterparts.
"""

from collections.abc import Iterable, Sequence
from datetime import datetime
from enum import Enum
from html import escape
from pathlib import Path
import re
from typing import NamedTuple

_STYLE = Path(__file__).with_name('report.css').read_text(encoding='utf-8')
_NO_SCRIPT = (
    '<noscript><style>.zoomable .interactive { display: none; } '
    '.zoomable .static { display: block !important; }</style></noscript>')


class Grade(Enum):
    """The grade of a verdict: a word, and the colour of its mark, as in the figures."""

    GOOD = ('good', '#009E73')
    CHECK = ('check', '#E69F00')
    BAD = ('bad', '#D55E00')
    UNKNOWN = ('unknown', '#666666')


class Verdict(NamedTuple):
    """The verdict on a joint, a link or a whole model: one sentence, and the next step."""

    name: str
    grade: Grade
    text: str
    next_step: str


class Origin(NamedTuple):
    """
    What a report is about, and the command that made it.

    `subject` names the URDF or its source, `command` is the command line, `version` that of the
    package.
    """

    subject: str
    command: str
    version: str

    def rows(self) -> list[tuple[str, str]]:
        """Return the origin in rows of names and values, with the version and the date of now."""
        tool = self.command.partition(' ')[0]
        return [
            ('URDF', self.subject),
            ('tool', f'{tool}, robot_dynamics {self.version}'),
            ('command', self.command),
            ('date', datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %z')),
        ]


class Page:
    """
    A report that is written from top to bottom: verdicts and origin first, then sections.

    Texts are escaped; parts between backticks become code.
    """

    def __init__(
        self, title: str, verdicts: Sequence[Verdict], rule: str, origin: Origin,
        subject: str = 'joints',
    ) -> None:
        """Begin with the verdicts on `subject`, and with the `rule` that derived them."""
        self._title, self._scripts = title, ''
        self._body = [
            f'<h1>{escape(title)}</h1>',
            f'<p class="summary">{escape(summary(verdicts, subject))}</p>',
            _verdict_table(verdicts)]
        self.text(rule)
        self.section('Origin')
        self.table(origin.rows(), has_head=False, kind='text')

    def section(self, title: str) -> None:
        """Begin a section."""
        self.add(f'<h2>{escape(title)}</h2>')

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self.add(f'<p>{_prose(text)}</p>')

    def table(
        self, rows: Sequence[Sequence[str]], has_head: bool = True, kind: str = '',
    ) -> None:
        """
        Add a table; the first row may be its head.

        `kind` is 'text' for cells of text, 'long' if the last column has long text.
        """
        head = _row(rows[0], 'th') if has_head else ''
        body = ''.join(_row(row, 'td') for row in rows[has_head:])
        self.add(f'<div class="wide"><table class="{kind}">{head}{body}</table></div>')

    def items(self, lines: Iterable[str], kind: str = '') -> None:
        """Add a list of lines; `kind` is its class."""
        self.add(f'<ul class="{kind}">' + ''.join(
            f'<li>{escape(line)}</li>' for line in lines) + '</ul>')

    def add(self, html: str, scripts: str = '') -> None:
        """Add an element, and the scripts that it needs."""
        self._body.append(html)
        self._scripts += scripts

    def html(self) -> str:
        """Return the report."""
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width">'
            f'<title>{escape(self._title)}</title><style>{_STYLE}</style>{_NO_SCRIPT}'
            f'{self._scripts}</head>\n<body>\n' + '\n'.join(self._body) + '\n</body></html>\n')


def summary(verdicts: Sequence[Verdict], subject: str) -> str:
    """Return the number of verdicts of each grade in one line; `subject` is what they are on."""
    counts = {grade: sum(verdict.grade is grade for verdict in verdicts) for grade in Grade}
    words = {Grade.CHECK: 'to check'}
    return f'Verdict on {len(verdicts)} {subject}: ' + ', '.join(
        f'{count} {words.get(grade, grade.value[0])}'
        for grade, count in counts.items() if count) + '.'


def _verdict_table(verdicts: Sequence[Verdict]) -> str:
    head = _row(('', 'grade', 'verdict', 'next step'), 'th')
    rows = ''.join(
        f'<tr><td>{escape(name)}</td><td><span class="mark" style="background: {grade.value[1]}">'
        f'</span> {grade.value[0]}</td><td>{_prose(text)}</td><td>{_prose(step)}</td></tr>'
        for name, grade, text, step in verdicts)
    return f'<div class="wide"><table class="verdicts text">{head}{rows}</table></div>'


def _prose(text: str) -> str:
    """Return escaped text; parts between backticks are code."""
    return re.sub('`([^`]+)`', r'<code>\1</code>', escape(text))


def _row(cells: Sequence[str], tag: str) -> str:
    return '<tr>' + ''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells) + '</tr>'
