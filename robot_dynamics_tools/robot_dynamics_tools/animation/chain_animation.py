# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The animation of a planar chain: its motion, and the recursion that computes its efforts.

While the chain moves, each joint shows the force and the moment that it transmits. At chosen
instants the motion pauses, and the two passes of the Newton-Euler recursion (`planar.chain`) are
shown link by link: outward, the motion of each link; inward, the force and moment of each joint.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.planar.chain import NewtonEulerPass
from robot_dynamics_tools.animation import chain_stage
from robot_dynamics_tools.animation.arm_motion import ArmMotion
from robot_dynamics_tools.animation.panels import effort_bars, energy_bars
from robot_dynamics_tools.animation.video import Frame, Pixels
from robot_dynamics_tools.pictures.planar_view import PlanarView
from robot_dynamics_tools.reporting.figures import GREY, styled_figure

WIDTH, DPI = 9.2, 100
PANEL_HEIGHT = 2.0
"""[inch]"""
STEP_SECONDS = 2.2
"""Duration [s] for which a step of a pass is shown."""
TRAIL_SECONDS = 0.6
"""[s] of the motion."""
TRAIL_PARTS = 8
"""Straight pieces of the trail between two frames."""


def chain_frames(
    motion: ArmMotion, stops: Sequence[float] = (), speed: float = 1.0, title: str = '',
) -> Iterator[Frame]:
    """
    Yield the frames of a motion, shown at `speed` times its own, with the passes at `stops` [s].

    Raises ModelError for an arm that is no planar chain, MissingDependencyError without
    matplotlib.
    """
    return _Animation(motion, PlanarView(motion.arm), title).frames(stops, speed)


def frame_count(motion: ArmMotion, stops: Sequence[float]) -> int:
    """Return the number of frames that `chain_frames` yields for a planar chain."""
    links = len(PlanarView(motion.arm).chain_names)
    return len(motion.times) + 2 * links * len(_rows_at(motion, stops))


class _Animation:
    def __init__(self, motion: ArmMotion, view: PlanarView, title: str) -> None:
        self._motion, self._view, self._title = motion, view, title
        self._passes = [
            view.passes(*state)
            for state in zip(motion.position, motion.velocity, motion.acceleration)]
        self._scales = chain_stage.scales_for(self._passes, view.reach())
        self._trail_times, self._trail = _trail(motion, view)
        self._joints = [motion.arm.joint_names.index(name) for name in view.chain_names]

    def frames(self, stops: Sequence[float], speed: float) -> Iterator[Frame]:
        motion, n = self._motion, len(self._joints)
        height = PANEL_HEIGHT * max(n + 1, 3)
        with styled_figure(WIDTH, height, None, {'text.parse_math': True}) as figure:
            figure.set_dpi(DPI)
            self._lay_out(figure, n)
            period = float(np.median(np.diff(motion.times))) / speed if (
                len(motion.times) > 1) else STEP_SECONDS
            at_stops = _rows_at(motion, stops)
            for k in range(len(motion.times)):
                self._show_motion(k)
                yield Frame(pixels(figure), period)
                if k in at_stops:
                    for _ in self._show_passes(k):
                        yield Frame(pixels(figure), STEP_SECONDS)

    def _lay_out(self, figure: Any, n: int) -> None:
        height = figure.get_figheight()
        side = 5.05 / WIDTH
        bottom = 1.2 / height
        stage = figure.add_axes((0.09, bottom, side - 0.1, 1.0 - bottom - 0.85 / height))
        stage.set_anchor('N')
        self._stage = chain_stage.ChainStage(stage, self._view.reach(), self._view.upright_at_zero)
        self._headline = figure.text(
            0.012, 1.0 - 0.09 / height, '', ha='left', va='top', fontsize=13, fontweight='bold',
            parse_math=False)
        self._clock = figure.text(
            0.985, 1.0 - 0.12 / height, '', ha='right', va='top', fontsize=11, color=GREY)
        self._caption = stage.annotate(
            '', (0.0, 0.0), (-52.0, -36.0), 'axes fraction', 'offset points', ha='left', va='top',
            fontsize=10.5, linespacing=1.4, annotation_clip=False)
        left, width = side + 0.19, 1.0 - side - 0.19 - 0.03
        row_height = (height - 0.45) / (n + 1)
        panels = [
            figure.add_axes((left, (height - 0.45 - row_height * (row + 1) + 0.36) / height,
                             width, (row_height - 0.62) / height))
            for row in range(n + 1)]
        self._panels = [energy_bars(panels[0], self._motion), *(
            effort_bars(axes, self._motion, joint)
            for axes, joint in zip(panels[1:], self._joints))]

    def _begin(
        self, k: int, headline: str, caption: str, scales: chain_stage.Scales,
    ) -> NewtonEulerPass:
        """Clear the stage for the instant k, and return what is to be drawn."""
        self._stage.clear(scales)
        self._headline.set_text(headline)
        self._caption.set_text(caption)
        angles = ', '.join(f'{_number(self._motion.position[k, joint])}' for joint in self._joints)
        self._clock.set_text(f't = {self._motion.times[k]:.2f} s,  q = ({angles}) rad')
        for panel in self._panels:
            panel.show(k)
        return self._passes[k]

    def _show_motion(self, k: int) -> None:
        motion = self._motion
        state = '' if motion.driven.all() else (
            ': its motors drive it' if motion.driven[k] else ': motors off, it swings freely')
        now = self._begin(
            k, self._title + state,
            'At each joint: the force and the moment that the previous link\n'
            '(or the base) exerts on the next link.', self._scales)
        since, until = np.searchsorted(
            self._trail_times, [motion.times[k] - TRAIL_SECONDS, motion.times[k] + 1e-9])
        self._stage.draw_trail(self._trail[since:until])
        self._stage.draw_links(now)
        for joint, force, moment in zip(now.joint_position, now.force, now.tau):
            self._stage.draw_arrow('force', joint, force)
            self._stage.draw_arc('moment', joint, moment)
        self._stage.draw_keys()

    def _show_passes(self, k: int) -> Iterator[None]:
        n = len(self._joints)
        heaviest = max(float(np.linalg.norm(self._view.weight(i))) for i in range(n))
        scales = chain_stage.scales_for([self._passes[k]], 0.7 * self._view.reach(), heaviest)
        for i in range(n):
            self._show_outward(k, i, scales)
            yield
        for i in reversed(range(n)):
            self._show_inward(k, i, scales)
            yield

    def _show_outward(self, k: int, i: int, scales: chain_stage.Scales) -> None:
        """Show how links 0 to i move, with link i as the current one."""
        last, now = i + 1 == len(self._joints), self._passes[k]
        rate, change = (f'\\omega_{i} + ', f'\\dot\\omega_{i} + ') if i else ('', '')
        handed = '' if last else (
            f';  of joint {i + 2}: {_size(now.joint_acceleration[i + 1])} m/s²')
        self._begin(
            k, f'Stop. Outward pass: motion of link {i + 1}',
            f'$\\omega_{i + 1} = {rate}\\dot q_{i + 1}$ = {_number(now.omega[i])} rad/s,   '
            f'$\\dot\\omega_{i + 1} = {change}\\ddot q_{i + 1}$ = {_number(now.omega_dot[i])} '
            'rad/s²\n'
            f'acceleration $\\dot v_{{C{i + 1}}}$ of its centre of mass: '
            f'{_size(now.com_acceleration[i])} m/s²{handed}', scales)
        stage = self._stage
        stage.draw_links(now, i)
        for link in range(i + 1):
            stage.draw_arc(
                'rate', now.joint_position[link], now.omega[link], f'$\\omega_{link + 1}$')
            stage.draw_arrow(
                'acceleration', now.com_position[link], now.com_acceleration[link],
                f'$\\dot v_{{C{link + 1}}}$')
        if not last:
            stage.draw_arrow(
                'acceleration', now.joint_position[i + 1], now.joint_acceleration[i + 1],
                f'$\\dot v_{{{i + 2}}}$', chain_stage.NEXT_ACCELERATION)
        stage.draw_keys(accelerations=True)

    def _show_inward(self, k: int, i: int, scales: chain_stage.Scales) -> None:
        """Show link i as a free body, and what the joints from the tip to it bear."""
        n, now = len(self._joints), self._passes[k]
        own, needed = i + 1, f'm_{i + 1} (\\dot v_{{C{i + 1}}} + g\\,\\hat y)'
        force, moment = needed, f'I_{own} \\dot\\omega_{own} + r_{own} \\times {needed}'
        if own < n:
            force = f'f_{own + 1} + {needed}'
            moment = f'\\tau_{own + 1} + {moment} + l_{own} \\times f_{own + 1}'
        self._begin(
            k, f'Inward pass: force and moment of joint {i + 1} on link {i + 1}',
            f'$f_{own} = {force}$,  magnitude {_size(now.force[i])} N\n'
            f'$\\tau_{own} = {moment}$ = {_number(now.tau[i])} N·m', scales)
        stage = self._stage
        stage.draw_links(now, i)
        stage.draw_arrow(
            'force', now.com_position[i], self._view.weight(i), f'$m_{i + 1}\\,g$',
            chain_stage.WEIGHT)
        for joint in range(i, n):
            at, pale = now.joint_position[joint], joint > i
            stage.draw_arrow(
                'force', at, now.force[joint], '' if pale else f'$f_{joint + 1}$', pale=pale)
            stage.draw_arc(
                'moment', at, now.tau[joint], '' if pale else f'$\\tau_{joint + 1}$', pale)
        if i + 1 < n:
            stage.draw_arrow(
                'force', now.joint_position[i + 1], -now.force[i + 1], f'$-f_{i + 2}$')
        stage.draw_keys()


def _rows_at(motion: ArmMotion, stops: Sequence[float]) -> set[int]:
    """Return the indices of the instants next to these times [s]."""
    return {int(np.abs(motion.times - stop).argmin()) for stop in stops}


def _trail(motion: ArmMotion, view: PlanarView) -> tuple[FloatArray, FloatArray]:
    """
    Return times (m,) [s] and positions of the tip (m, 2) [m], more closely than the frames.

    Between two instants the joints follow the cubic polynomial through their positions and
    velocities.
    """
    t, rest = motion.times, np.zeros(motion.arm.joint_count)
    times, positions = t, motion.position
    if len(t) > 1:
        spline = optional('scipy.interpolate', 'an animation').CubicHermiteSpline
        places = np.linspace(0.0, len(t) - 1.0, TRAIL_PARTS * (len(t) - 1) + 1)
        times = np.interp(places, np.arange(len(t)), t)
        positions = spline(t, motion.position, motion.velocity)(times)
    return times, np.array([view.passes(q, rest, rest).tip_position for q in positions])


def pixels(figure: Any) -> Pixels:
    """Return the drawn figure."""
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()


def _number(value: float) -> str:
    return f'{value:.2f}'.replace('-', '−')


def _size(vector: Any) -> str:
    return f'{float(np.linalg.norm(vector)):.1f}'
