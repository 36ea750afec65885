# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Static figures of matplotlib in an HTML report."""

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from robot_dynamics.model_check.html_page import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_figure(page: Page, figure: 'Figure', what: str) -> None:
    """Add a figure to a page."""
    page.add(image(png(figure), what))


def image(png: bytes, what: str) -> str:
    """Return an image that is embedded in the page."""
    encoded = b64encode(png).decode('ascii')
    return (f'<div class="static wide"><img alt="{escape(what)}" '
            f'src="data:image/png;base64,{encoded}"></div>')


def png(figure: 'Figure') -> bytes:
    """Return a figure of matplotlib as PNG."""
    data = BytesIO()
    figure.savefig(data, format='png')
    return data.getvalue()
