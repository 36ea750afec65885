# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Bars next to a moving arm: its energies, which add up, and the effort of each joint by term."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.units import units_of
from robot_dynamics_tools.animation.arm_motion import ArmMotion
from robot_dynamics_tools.reporting import figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TERMS = ('inertial', 'coriolis', 'gravity', 'friction', 'residual', 'effort')
TERM_WORDS = {
    'inertial': 'inertial, M q̈', 'coriolis': 'Coriolis, C q̇', 'gravity': 'gravity, g',
    'friction': 'friction', 'residual': 'not modelled', 'effort': 'sum: the motor, τ'}
_ROOM = 1.12
ENERGY = '#AAAAAA'
"""Colour of energies: no arrow and no term of an effort has it."""


class _Bars:
    """Horizontal bars with a number next to each."""

    def __init__(
        self, axes: 'Axes', names: Sequence[str], colours: Sequence[str], low: float, high: float,
        unit: str,
    ) -> None:
        largest = max(abs(low), abs(high))
        self._digits = max(0, 1 - int(np.floor(np.log10(0.5 * largest))))
        places = np.arange(len(names))[::-1]
        self._bars = axes.barh(places, np.zeros(len(names)), 0.72, color=colours)
        span = high - low
        axes.set(xlim=(low, high + 0.2 * span), ylim=(-0.6, len(names) - 0.4))
        axes.set_yticks(places, names)
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

    def show(self, starts: FloatArray, sizes: FloatArray) -> None:
        for bar, text, start, size in zip(self._bars, self._texts, starts, sizes):
            bar.set_x(start)
            bar.set_width(size)
            value = round(float(size), self._digits) + 0.0  # no −0
            text.set_text(f'{value:.{self._digits}f}'.replace('-', '−'))


class EnergyPanel:
    """
    Kinetic and potential energy and heat, each from the end of the one above; work below them.

    Energy and heat together equal the initial energy plus the work of the motors.
    """

    def __init__(self, axes: 'Axes', motion: ArmMotion) -> None:
        self._motion = motion
        ends = np.concatenate([
            motion.energy + motion.heat, motion.energy[0] + motion.work, motion.energy])
        low = min(float(ends.min()), float(motion.heat.min()), 0.0)
        supply = 'work of the motors' if motion.energy[0] < 1e-6 else 'start + work'
        self._bars = _Bars(
            axes, ('kinetic', 'potential', 'total', 'heat of friction', supply),
            5 * (ENERGY,), _ROOM * low, _ROOM * float(ends.max()), 'J')
        figures.title_axes(axes, 'Energy')

    def show(self, k: int) -> None:
        """Show the instant k."""
        m = self._motion
        K, P, heat = m.kinetic[k], m.potential[k], m.heat[k]
        self._bars.show(
            np.array([0.0, K, 0.0, K + P, 0.0]),
            np.array([K, P, K + P, heat, m.energy[0] + m.work[k]]))


class EffortPanel:
    """The effort at one joint by term."""

    def __init__(self, axes: 'Axes', motion: ArmMotion, joint: int) -> None:
        self._joint = joint
        self._names = [
            name for name in TERMS if name in motion.terms
            and (name != 'friction' or motion.terms['friction'].any())]
        self._values = np.column_stack([motion.terms[name][:, joint] for name in self._names])
        largest = _ROOM * max(float(np.abs(self._values).max()), 1e-3)
        self._bars = _Bars(
            axes, ['sum: measured, τ' if name == 'effort' and 'residual' in self._names else
                   TERM_WORDS[name] for name in self._names],
            [figures.LINES[name].colour for name in self._names],
            -largest, largest, units_of(motion.arm.joint_kinds[joint]).effort)
        figures.title_axes(axes, f'Effort at {motion.arm.joint_names[joint]}')

    def show(self, k: int) -> None:
        """Show the instant k."""
        self._bars.show(np.zeros(len(self._names)), self._values[k])
