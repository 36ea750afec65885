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

"""Self-contained HTML pages with tables, lists and embedded images."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from typing import Any

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem;
  color: #1a1a1a; background: #fff; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .8rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
th { border-bottom: 2px solid #888; }
.loss { border-left: 4px solid #d55e00; padding-left: .8rem; }
img { max-width: 100%; height: auto; }
.wide { overflow-x: auto; }
"""


def page(title: str, body: Sequence[str]) -> str:
    """Return a page of these elements."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f'<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n'
        + '\n'.join(body) + '\n</body></html>\n')


def table(rows: Sequence[Sequence[str]], has_head: bool = True) -> str:
    """Return a table; the first row may be its head."""
    head = _row(rows[0], 'th') if has_head else ''
    body = ''.join(_row(row, 'td') for row in rows[has_head:])
    return f'<div class="wide"><table>{head}{body}</table></div>'


def _row(cells: Sequence[str], tag: str) -> str:
    return '<tr>' + ''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells) + '</tr>'


def items(lines: Iterable[str], kind: str = '') -> str:
    """Return a list of lines; `kind` is its class."""
    return f'<ul class="{kind}">' + ''.join(f'<li>{escape(line)}</li>' for line in lines) + '</ul>'


def image(png: bytes, what: str) -> str:
    """Return an image that is embedded in the page."""
    encoded = b64encode(png).decode('ascii')
    return (f'<div class="wide"><img alt="{escape(what)}" '
            f'src="data:image/png;base64,{encoded}"></div>')


def png(figure: Any) -> bytes:
    """Return a figure of matplotlib as PNG."""
    data = BytesIO()
    figure.savefig(data, format='png')
    return data.getvalue()
