# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Figures in an HTML report: images of matplotlib, and figures over time with zoom by Bokeh.

Bokeh is used because its script adds 1.3 MB to a report (3.9); the script of Plotly has 4.8 MB
(7.1), and a report with it would exceed 5 MB. Both need no network. Without Bokeh, which is the
extra `report`, a report has only the static figures.
"""

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from io import BytesIO
from typing import Any, TYPE_CHECKING

import numpy as np
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import MissingDependencyError
from robot_dynamics.model_check.html_page import Page
from robot_dynamics_tools.reporting import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from robot_dynamics.model.arm import ArmModel

MAX_POINTS = 6000
"""Largest number of points per line; more points make the page slow."""
ROW_HEIGHT, LEGEND_HEIGHT, LEFT = 200, 30, 75
"""[pixel]"""
FONT = '12px'
WITHOUT_BOKEH = 'The figures zoom if the library Bokeh is installed: python -m pip install bokeh'
USE = ('Drag over a time span to zoom all figures to it. The tools on the right move, zoom and '
       'reset the figures, and save one as a picture; a click on a legend entry hides its line. '
       'In print, the figures are static.')


def add_time_figures(
    page: Page, arm: 'ArmModel', title: str, panels: Sequence[figures.Panel], what: str,
    boundary: figures.TimeBoundary | None = None,
) -> bytes:
    """
    Add figures with a row per joint and a column per panel, and a common time axis.

    Return the static counterpart as PNG, which print shows; `what` describes it. Without Bokeh the
    page has only that image, and a command that installs Bokeh.
    """
    static = png(figures.joint_figure(title, arm, panels, boundary))
    static_image = image(static, what)
    try:
        span = _bokeh('models').Range1d(
            min(float(panel.times[0]) for panel in panels),
            max(float(panel.times[-1]) for panel in panels), bounds='auto', min_interval=1e-3)
    except MissingDependencyError:  # whose message has a path of this machine
        page.add(f'{static_image}<p>{WITHOUT_BOKEH}</p>')
        return static
    rows = [
        [_figure(panel, row, name, kind == 'prismatic', span, boundary) for panel in panels]
        for row, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_kinds))]
    for figure in rows[-1]:
        figure.xaxis.axis_label = 'time [s]'
    layout = _bokeh('layouts').gridplot(
        rows, toolbar_location='right', merge_tools=True, sizing_mode='stretch_width',
        toolbar_options={'logo': None})
    script, element = _bokeh('embed').components(layout)
    head = _bokeh('resources').Resources(mode='inline', components=['bokeh']).render()
    page.add(
        f'<div class="zoomable"><div class="interactive"><p>{USE}</p>'
        f'<div class="wide"><div>{element}{script}</div></div></div>{static_image}</div>', head)
    return static


def _bokeh(part: str) -> Any:
    return optional(f'bokeh.{part}', 'zoom in the figures of a report')


def _figure(
    panel: figures.Panel, row: int, joint: str, prismatic: bool, span: Any,
    boundary: figures.TimeBoundary | None,
) -> Any:
    """Return the figure of one panel at one joint."""
    models = _bokeh('models')
    unit = panel.units[prismatic]
    figure = _bokeh('plotting').figure(
        name=f'{joint}: {panel.title}', x_range=span,
        title=f'{joint}: {panel.title}' if row == 0 else joint,
        height=ROW_HEIGHT + (LEGEND_HEIGHT if row == 0 else 0),
        tools='xbox_zoom,xpan,xwheel_zoom,reset,save', active_drag='xbox_zoom', active_scroll=None,
        y_axis_label=f'{panel.quantity} [{unit}]', window_axis='x', min_border_left=LEFT)
    figure.axis.axis_label_text_font_style = 'normal'
    figure.axis.major_label_text_font_size = FONT
    step = max(1, -(-len(panel.times) // MAX_POINTS))
    columns = {'time': panel.times[::step], **{
        name: panel.scale * values[::step, row] for name, values in panel.lines.items()}}
    source = models.ColumnDataSource({
        name: np.asarray(values, dtype=np.float32) for name, values in columns.items()})
    drawn = [
        (figures.LABELS.get(name, name), [_draw(figure, source, name, figures.LINES[name])])
        for name in panel.lines]
    figure.add_tools(models.HoverTool(tooltips=[
        ('', '$name'), ('time', '$x{0.000} s'), (panel.quantity, f'$y{{0.000}} {unit}')]))
    if row == 0:
        figure.add_layout(models.Legend(
            items=drawn, orientation='horizontal', click_policy='hide', border_line_color=None,
            location='left',
            padding=0, margin=2, label_text_font_size=FONT, spacing=8), 'above')
    if boundary is not None:
        _mark(figure, boundary, row == 0)
    return figure


def _draw(figure: Any, source: Any, name: str, style: figures.LineStyle) -> Any:
    dash = 'solid' if isinstance(style.dash, str) else [
        max(1, round(style.width * length)) for length in style.dash[1]]
    return figure.line(
        'time', name, source=source, name=figures.LABELS.get(name, name), color=style.colour,
        line_dash=dash, line_width=style.width)


def _mark(figure: Any, boundary: figures.TimeBoundary, has_labels: bool) -> None:
    """Draw the boundary, with the names of both sides."""
    models = _bokeh('models')
    figure.add_layout(models.Span(
        location=boundary.time, dimension='height', line_color=figures.GREY, line_dash='dashed'))
    if not has_labels:
        return
    for text, align in ((f'{boundary.before} ◂ ', 'right'), (f' ▸ {boundary.after}', 'left')):
        figure.add_layout(models.Label(
            x=boundary.time, y=2, y_units='screen', text=text, text_align=align,
            text_font_size='11px', background_fill_color='white', background_fill_alpha=0.7))


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
