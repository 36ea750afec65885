# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The controls of the viewer for one arm: sliders for a reference, a load, a push, the live plots.

Callbacks of the page run in separate threads. They only put requests into a queue, which the
thread of the viewer empties.
"""

from collections.abc import Callable, Mapping
from html import escape
import math
from typing import Any, TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics_tools.monitor.markers import HOT, WARM
from robot_dynamics_tools.pictures.stick_figure import tool_link
from robot_dynamics_tools.reporting import figures
from robot_dynamics_tools.viewer.plots import LivePlot, TERMS

if TYPE_CHECKING:
    import viser

Ask = Callable[[Callable[[], None]], None]
"""Queues a call for the thread of the viewer."""

DIRECTIONS: Mapping[str, tuple[float, float, float]] = {
    '+x': (1.0, 0.0, 0.0), '-x': (-1.0, 0.0, 0.0), '+y': (0.0, 1.0, 0.0), '-y': (0.0, -1.0, 0.0),
    '+z': (0.0, 0.0, 1.0), '-z': (0.0, 0.0, -1.0)}
SLIDER_STEP = 0.001
"""[rad] or [m]"""
UNLIMITED = {'prismatic': 1.0}
"""Range of the slider of a joint without limits [m]; of a revolute joint, half a turn."""
DEFAULT_SPEED = 30.0
"""[%]"""
LEAST_ERROR = 0.1
"""Smallest height of the plot of errors [mrad] or [mm]."""
TABLE = (
    '<table style="font-size: 11px; line-height: 1.2; text-align: right; table-layout: fixed; '
    'width: calc(100% - 20px); margin: 0 10px">'
    '<tr>{}<td>command</td><td>measured</td><td>limit</td></tr>{}</table>')
NAME = '<td style="width: 28%; text-align: left; overflow-wrap: anywhere">{}</td>'
"""A cell; the table fits a page of 420 pixels, and its height does not change."""
PLOT_WIDTH = 360
"""[px]"""


class ArmPanel:
    """The controls for one arm; `close` removes them."""

    def __init__(self, gui: 'viser.GuiApi', arm: ArmModel, ask: Ask) -> None:
        self._gui, self._arm, self._ask = gui, arm, ask
        self.on: dict[str, Callable[[], None]] = {}
        """The actions: reference, hold, attach, detach, push and reset."""
        self._table = gui.add_html('')
        self.show_efforts({}, {})
        self._folders = [self._add_reference(), self._add_load(), self._add_push()]
        self._plot_panel = gui.add_panel()
        self._plot_panel.dock_left()
        self._plot_panel.set_width(PLOT_WIDTH)
        self._plot_tab = self._plot_panel.add_tab('Plots')
        with self._plot_tab:
            gui.add_html(legend())
            self._joint = gui.add_dropdown('joint', arm.joint_names)
        self._joint.on_update(lambda _: self._ask(self._change_joint))
        self.plots = self._make_plots()
        """Effort of the shown joint by term, and its tracking error [mrad] or [mm]."""

    def close(self) -> None:
        """Remove all controls."""
        for part in (self._table, *self._folders, self._plot_panel):
            part.remove()

    def _button(self, label: str, action: str) -> None:
        self._gui.add_button(label).on_click(lambda _: self._ask(self.on[action]))

    # ------------------------------------------------------------------ the reference

    def _add_reference(self) -> Any:
        limits = self._arm.limits
        with self._gui.add_folder('Reference') as folder:
            self._speed = self._gui.add_slider(
                'speed [%]', 5.0, 100.0, 5.0, DEFAULT_SPEED,
                hint='Percentage of the velocity limits of the joints')
            self._sliders = []
            for name, kind, low, high in zip(
                    self._arm.joint_names, self._arm.joint_kinds, limits.lower, limits.upper):
                reach = UNLIMITED.get(kind, math.pi)
                if not np.isfinite(high - low) or low == high == 0.0:  # also without a limit
                    low, high = -reach, reach
                low, high, step = slider_range(float(low), float(high))
                unit = 'm' if kind == 'prismatic' else 'rad'
                slider = self._gui.add_slider(
                    f'{name} [{unit}]', low, high, step, min(max(0.0, low), high))
                slider.on_update(self._slid)
                self._sliders.append(slider)
            self._button('Hold here', 'hold')
        self._known = [slider.value for slider in self._sliders]
        self._goal = np.array(self._known)
        return folder

    def _slid(self, event: Any) -> None:
        if event.client is not None:  # not by `follow`
            self._ask(self.on['reference'])

    def take_goal(self) -> FloatArray:
        """
        Return the joint positions of the sliders (n,).

        For a slider that was not moved, this is the position of `follow` or of the last goal.
        """
        values = [slider.value for slider in self._sliders]
        self._goal = np.where(np.not_equal(values, self._known), values, self._goal)
        self._known = values
        return self._goal.copy()

    @property
    def speed(self) -> float:
        """Fraction of the velocity limits."""
        return float(self._speed.value) / 100.0

    def follow(self, q: FloatArray) -> None:
        """Move the sliders to q (n,), unless the user is moving one."""
        if self._known != [slider.value for slider in self._sliders]:
            return  # the callback of this slider follows
        self._goal = q.copy()
        for i, (slider, kind, value) in enumerate(zip(self._sliders, self._arm.joint_kinds, q)):
            if kind == 'continuous':
                value = math.remainder(value, 2.0 * math.pi)
            shown = float(np.clip(round(float(value), 3), slider.min, slider.max))
            if slider.value == self._known[i] and abs(slider.value - shown) >= SLIDER_STEP:
                self._known[i] = slider.value = shown

    # ------------------------------------------------------------------ plots

    def _make_plots(self) -> tuple[LivePlot, LivePlot]:
        slides = self._arm.joint_kinds[self.shown_joint] == 'prismatic'
        name = self._arm.joint_names[self.shown_joint]
        with self._plot_tab:
            return (
                LivePlot(self._gui, f'{name}: effort by term [{"N" if slides else "N·m"}]', TERMS),
                LivePlot(self._gui, f'{name}: tracking error [{"mm" if slides else "mrad"}]',
                         ('error',), LEAST_ERROR, 'no reference'))

    def _change_joint(self) -> None:
        for plot in self.plots:
            plot.remove()
        self.plots = self._make_plots()

    @property
    def shown_joint(self) -> int:
        """Index of the joint whose plots are shown."""
        return self._arm.joint_names.index(self._joint.value)

    def show_efforts(
        self, command: Mapping[str, float], measured: Mapping[str, float],
    ) -> None:
        """Show commanded and measured efforts by joint, and the limits."""
        rows = ''.join(
            '<tr>' + NAME.format(escape(name) + ' [N]' * (kind == 'prismatic')) + ''.join(map(
                cell, (command.get(name, math.nan), measured.get(name, math.nan), limit)))
            for name, kind, limit in zip(
                self._arm.joint_names, self._arm.joint_kinds, self._arm.limits.effort))
        content = TABLE.format(NAME.format('effort [N·m]'), rows)
        if self._table.content != content:
            self._table.content = content

    # ------------------------------------------------------------------ load and push

    def _add_load(self) -> Any:
        with self._gui.add_folder('Load') as folder:
            self._mass = self._gui.add_number('mass [kg]', 1.0, min=0.001, max=1000.0, step=0.1)
            self._load_link = self._gui.add_dropdown(
                'link', self._arm.link_names, initial_value=hand_of(self._arm))
            self._is_for_controller = self._gui.add_checkbox(
                'in the controller model', True, hint='Calls set_payload of dynamics')
            self._is_carried = self._gui.add_checkbox(
                'on the simulated arm', True, hint='Calls set_payload of simulated_arm')
            self._button('Attach', 'attach')
            self._button('Detach', 'detach')
        return folder

    @property
    def load(self) -> tuple[float, str]:
        """Mass [kg] and link of the load."""
        return float(self._mass.value), str(self._load_link.value)

    @property
    def load_is_for(self) -> tuple[bool, bool]:
        """Whether the load is for the controller, and for the simulated arm."""
        return bool(self._is_for_controller.value), bool(self._is_carried.value)

    def _add_push(self) -> Any:
        with self._gui.add_folder('Simulated arm') as folder:
            self._force = self._gui.add_slider('force [N]', 1.0, 200.0, 1.0, 30.0)
            self._direction = self._gui.add_dropdown('direction', tuple(DIRECTIONS))
            self._push_link = self._gui.add_dropdown(
                'pushed link', self._arm.link_names, initial_value=hand_of(self._arm))
            self._seconds = self._gui.add_slider('for [s]', 0.1, 5.0, 0.1, 0.5)
            self._button('Push', 'push')
            self._button('Reset', 'reset')
        return folder

    @property
    def push(self) -> tuple[FloatArray, str, float]:
        """Force (3,) [N] in the base frame, the link, and the duration [s]."""
        force = float(self._force.value) * np.array(DIRECTIONS[self._direction.value])
        return force, str(self._push_link.value), float(self._seconds.value)


def legend() -> str:
    """Return HTML that explains the colours of the marks at the arm."""
    warm, hot = (f'{100.0 * share:.0f} %' for share in (WARM, HOT))
    entries = (
        (figures.BLUE, f'effort below {warm} of its limit'), (figures.ORANGE, f'{warm} to {hot}'),
        (figures.VERMILION, f'above {hot}'), (figures.GREY, 'effort without limit'),
        (figures.YELLOW, 'load'), (figures.PURPLE, 'external effort and force'),
        (figures.SKY, 'external torque'), (figures.GREEN, 'manipulability'))
    return '<div style="font-size: 12px; line-height: 1.5; padding: 2px 10px">' + ' '.join(
        f'<span style="color: {colour}">&#9632;</span> {text}<br>'
        for colour, text in entries) + '</div>'


def cell(value: float) -> str:
    """Return HTML of a cell with a number, which may be unknown or infinite."""
    text = f'{round(value, 1) + 0.0:.1f}' if math.isfinite(value) else '–'
    return f'<td style="padding: 1px">{text}</td>'


def slider_range(low: float, high: float) -> tuple[float, float, float]:
    """Return limits of a slider within those of a joint, and its step: 1 mm or mrad, or less."""
    first = math.ceil(low / SLIDER_STEP) * SLIDER_STEP
    last = math.floor(high / SLIDER_STEP) * SLIDER_STEP
    if last - first > SLIDER_STEP:
        return round(first, 3), round(last, 3), SLIDER_STEP
    return low, high, max(high - low, SLIDER_STEP) / 10.0


def hand_of(arm: ArmModel) -> str:
    """Return the link at the end of an arm; of a gripper, the link that carries the fingers."""
    grips = {name for mimic in arm.mimic_joints for name in (mimic.name, mimic.leader)}
    model = arm.pinocchio_model
    fingers = {
        model.getJointId(name) for name in grips if model.existJointName(name)
        and model.joints[model.getJointId(name)].shortname().startswith('JointModelP')}
    return tool_link(arm, fingers)
