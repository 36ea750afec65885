# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A planar chain on a matplotlib axes: links, and arrows for forces, moments and accelerations.

Lengths are in metres and to scale. The arrow of a force f has the length f / `force_scale`. The
arc of a moment τ covers the angle τ / `moment_scale`, in the direction of τ. Keys on the axes show
both scales.
"""

from collections.abc import Mapping, Sequence
from typing import Any, TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.planar.chain import NewtonEulerPass
from robot_dynamics_tools.reporting.figures import BLACK, BLUE, GREY, SKY, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINK, PALE_LINK, TRAIL = '#4D4D4D', '#C8C8C8', '#B0B0B0'
COLOURS = {'force': VERMILION, 'moment': BLACK, 'acceleration': BLUE, 'rate': '#882255'}
WEIGHT, NEXT_ACCELERATION = GREY, SKY
"""Colours of a weight, and of the acceleration that a link transmits to the next joint."""
_ROUNDEST = 1.6 * np.pi
"""Angle [rad] of the arc of the largest moment."""
_SMALLEST_ARC = 0.2
"""Angle [rad] below which an arc is omitted."""
_LABELS = (1.2, 1.9)
"""Range [rad] from above for the label of an arc: forces point up, weights down."""
_TINY = 0.03
"""Length below which an arrow is omitted, as a fraction of the reach."""
_LONG, _HEAD, _SHAFT = 0.2, 20.0, 2.4
"""Length from which an arrow has its full width, as a fraction of the reach; widths [point]."""
_KEY_ROW = 1.27
"""Height of the keys above the joint of the base, as a share of the reach: above the axes."""


Scales = Mapping[str, float]
"""Scale of a force [N/m], moment [N·m/rad], acceleration [m/s² per m], rate [rad/s per rad]."""


def scales_for(
    passes: Sequence[NewtonEulerPass], reach: float, weight: float = 0.0,
) -> Scales:
    """Return scales at which the largest arrows of these instants, and a weight [N], fit."""
    def largest(field: str) -> float:
        values = np.array([getattr(one, field) for one in passes])
        sizes = np.linalg.norm(values, axis=-1) if values.ndim == 3 else np.abs(values)
        return max(float(sizes.max()), 1e-9)

    return {
        'force': max(largest('force'), weight) / (0.9 * reach),
        'moment': largest('tau') / _ROUNDEST,
        'acceleration': largest('com_acceleration') / (0.7 * reach),
        'rate': largest('omega') / _ROUNDEST}


def round_number(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is at most `value` > 0."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * 1.001))


class ChainStage:
    """Draws a chain; the axes show everything that was drawn since the last `clear`."""

    def __init__(self, axes: 'Axes', reach: float, upright: bool) -> None:
        """Set up axes for a chain of this reach [m]; `upright`: it stands upright at zero."""
        self._axes, self._reach = axes, reach
        self._scales: Scales = {}
        self._drawn: list[Any] = []
        half = 1.16 * reach
        axes.set(xlim=(-half, half), ylim=(-half, half), xlabel='x [m]', ylabel='y, up [m]')
        axes.set_aspect('equal')
        axes.grid(color='#EEEEEE')
        if upright:
            axes.plot([0.0, 0.0], [0.0, 1.04 * reach], color=GREY, linewidth=0.9,
                      linestyle=(0, (4, 3)), zorder=1)
            axes.text(0.0, 1.06 * reach, 'q = 0: upright', color=GREY, ha='center', va='bottom',
                      fontsize=9)

    def clear(self, scales: Scales) -> None:
        """Remove all drawings, and draw arrows at these scales from now on."""
        for artist in self._drawn:
            artist.remove()
        self._drawn, self._scales = [], scales

    # ------------------------------------------------------------------ the arm

    def draw_links(self, at: NewtonEulerPass, current: int | None = None) -> None:
        """Draw all links, or one of them dark and the others pale."""
        points = np.vstack([at.joint_position, at.tip_position])
        for i, (start, end) in enumerate(zip(points[:-1], points[1:])):
            link, com = (LINK, BLACK) if current in (None, i) else (PALE_LINK, PALE_LINK)
            self._plot([start, end], color=link, linewidth=7.0, zorder=3)
            self._plot([at.com_position[i]], color=com, marker='+', zorder=6)
        joints = {'linestyle': 'none', 'color': LINK}
        self._plot(points[:-1], marker='o', markersize=8.0, mfc='white', zorder=5, **joints)
        self._plot(points[:1], marker='s', markersize=13.0, mfc='none', zorder=4, **joints)

    def draw_trail(self, tips: FloatArray) -> None:
        """Draw the previous positions of the tip, (k, 2) [m]."""
        self._plot(tips, color=TRAIL, linewidth=1.2, zorder=2)

    # ------------------------------------------------------------------ what acts

    def draw_arrow(
        self, kind: str, at: FloatArray, vector: FloatArray, label: str = '', colour: str = '',
        pale: bool = False,
    ) -> None:
        """Draw a `force` (2,) [N] or an `acceleration` (2,) [m/s²] of a point (2,) [m]."""
        way = vector / self._scales[kind]
        length, colour = float(np.linalg.norm(way)), colour or COLOURS[kind]
        if length < _TINY * self._reach:
            return
        self._label(at + (1.0 + 0.07 * self._reach / length) * way, label, colour)
        self._along(np.array([at, at + way]), length, colour, pale)

    def draw_arc(
        self, kind: str, middle: FloatArray, value: float, label: str = '', pale: bool = False,
        size: float = 0.13,
    ) -> None:
        """
        Draw a `moment` [N·m] or a `rate` [rad/s] about a point: clockwise from above if positive.

        `size` is the radius as a fraction of the reach.
        """
        angle, radius = value / self._scales[kind], size * self._reach
        if abs(angle) < _SMALLEST_ARC:
            return
        beside = np.copysign(np.clip(0.5 * abs(angle), *_LABELS), angle)
        self._label(middle + (radius + 0.08 * self._reach) * np.array(
            [np.sin(beside), np.cos(beside)]), label, COLOURS[kind])
        phi = np.linspace(0.0, angle, 40)
        self._along(middle + radius * np.column_stack([np.sin(phi), np.cos(phi)]),
                    radius * min(1.0, 0.5 * abs(angle)), COLOURS[kind], pale)

    # ------------------------------------------------------------------ the keys

    def draw_keys(self, accelerations: bool = False) -> None:
        """Draw example arrows of round values: forces and moments, or motion."""
        reach = self._reach
        vector, turn = (('acceleration', 'acceleration', 'm/s²'), (
            'rate', 'angular velocity', 'rad/s')) if accelerations else (
                ('force', 'force', 'N'), ('moment', 'moment', 'N·m'))
        for x, gap, room, (kind, name, unit) in ((-1.16, 0.36, 0.3 * reach, vector),
                                                 (0.0, 0.24, 2.4, turn)):
            at = np.array([x * reach, _KEY_ROW * reach])
            size = round_number(room * self._scales[kind])
            if kind == turn[0]:
                self.draw_arc(kind, at + np.array([0.1, -0.02]) * reach, size, size=0.08)
            else:
                self.draw_arrow(kind, at, np.array([size, 0.0]))
            self._drawn.append(self._axes.text(
                at[0] + gap * reach, at[1], f'{name} {size:g} {unit}', va='center', fontsize=10))

    # ------------------------------------------------------------------ strokes

    def _plot(self, points: FloatArray | list[FloatArray], **style: Any) -> None:
        """Draw lines or markers at points (k, 2)."""
        self._drawn += self._axes.plot(
            *np.transpose(points), solid_capstyle='round', markeredgewidth=1.4, **style)

    def _along(self, points: FloatArray, length: float, colour: str, pale: bool) -> None:
        """Draw an arrow of a length [m] along points (k, 2)."""
        from matplotlib.patches import FancyArrowPatch
        from matplotlib.path import Path
        width = np.clip(length / (_LONG * self._reach), 0.3, 1.0)
        self._drawn.append(self._axes.add_patch(FancyArrowPatch(
            path=Path(points), arrowstyle='-|>', mutation_scale=_HEAD * width,
            linewidth=_SHAFT * width, color=colour, alpha=0.45 if pale else 1.0, zorder=8,
            joinstyle='miter', capstyle='butt', clip_on=False)))

    def _label(self, at: FloatArray, label: str, colour: str) -> None:
        if label:
            self._drawn.append(self._axes.text(
                at[0], at[1], label, color=colour, fontsize=11, ha='center', va='center', zorder=9,
                bbox={'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.75, 'pad': 0.6}))
