# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Bars next to a moving arm: its energies, which add up, and the effort of each joint by term."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.units import units_of
from robot_dynamics_tools.animation.arm_motion import ArmMotion
from robot_dynamics_tools.reporting import figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TERM_WORDS = {
    'inertial': 'inertial, M q̈', 'coriolis': 'Coriolis, C q̇', 'gravity': 'gravity, g',
    'friction': 'friction', 'residual': 'not modelled', 'effort': 'sum: the motor, τ'}
_ROOM = 1.12
ENERGY = '#AAAAAA'
"""Colour of energies: no arrow and no term of an effort has it."""


class Bars:
    """Horizontal bars with a number next to each, for the instants of a motion."""

    def __init__(
        self, axes: 'Axes', title: str, unit: str, colours: Sequence[str],
        sizes: Mapping[str, FloatArray], ends: tuple[float, float], starts: FloatArray,
    ) -> None:
        """
        Draw empty bars on an axis from one of the `ends` to the other.

        `sizes` has m values per name, in `unit`; bars begin at `starts`, (m or 1, names).
        """
        self._sizes = np.column_stack(list(sizes.values()))
        self._starts = np.broadcast_to(starts, self._sizes.shape)
        low, high = (_ROOM * end for end in ends)
        span, largest = high - low, max(abs(low), abs(high))
        self._digits = max(0, 1 - int(np.floor(np.log10(0.5 * largest))))
        places = np.arange(len(sizes))[::-1]
        self._bars = axes.barh(places, np.zeros(len(sizes)), 0.72, color=colours)
        axes.set(xlim=(low, high + 0.2 * span), ylim=(-0.6, len(sizes) - 0.4))
        axes.set_yticks(places, list(sizes))
        axes.tick_params(axis='y', length=0, labelsize=10)
        axes.tick_params(axis='x', labelsize=9, pad=1)
        axes.text(1.0, -0.06, f'[{unit}]', transform=axes.transAxes, ha='right', va='top',
                  fontsize=9)
        axes.grid(axis='y', visible=False)
        axes.axvline(0.0, color=figures.BLACK, linewidth=0.8)
        axes.set_xticks([tick for tick in axes.get_xticks() if low <= tick <= high])
        self._texts = [axes.text(
            high + 0.19 * span, place, '', ha='right', va='center', fontsize=9)
            for place in places]
        figures.title_axes(axes, title)

    def show(self, k: int) -> None:
        """Show the instant k."""
        for bar, text, start, size in zip(
                self._bars, self._texts, self._starts[k], self._sizes[k]):
            bar.set_x(start)
            bar.set_width(size)
            value = round(float(size), self._digits) + 0.0  # no −0
            text.set_text(f'{value:.{self._digits}f}'.replace('-', '−'))


def energy_bars(axes: 'Axes', motion: ArmMotion) -> Bars:
    """
    Return kinetic and potential energy and heat, each from the end of the one above; below, work.

    Energy and heat together equal the initial energy plus the work of the motors.
    """
    supply = 'work of the motors' if motion.energy[0] < 1e-6 else 'start + work'
    sizes = {
        'kinetic': motion.kinetic, 'potential': motion.potential, 'total': motion.energy,
        'heat of friction': motion.heat, supply: motion.energy[0] + motion.work}
    zero = np.zeros(len(motion.times))
    starts = np.column_stack([zero, motion.kinetic, zero, motion.energy, zero])
    ends = np.concatenate([motion.energy + motion.heat, sizes[supply], motion.energy])
    low = min(float(ends.min()), float(motion.heat.min()), 0.0)
    return Bars(axes, 'Energy', 'J', 5 * (ENERGY,), sizes, (low, float(ends.max())), starts)


def effort_bars(axes: 'Axes', motion: ArmMotion, joint: int) -> Bars:
    """Return the effort at one joint by term."""
    names = [name for name in TERM_WORDS if name in motion.terms
             and (name != 'friction' or motion.terms['friction'].any())]
    words = {**TERM_WORDS, **({'effort': 'sum: measured, τ'} if 'residual' in names else {})}
    sizes = {words[name]: motion.terms[name][:, joint] for name in names}
    largest = max(*(float(np.abs(values).max()) for values in sizes.values()), 1e-3)
    return Bars(
        axes, f'Effort at {motion.arm.joint_names[joint]}',
        units_of(motion.arm.joint_kinds[joint]).effort,
        [figures.LINES[name].colour for name in names], sizes, (-largest, largest), np.zeros(1))
