# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/images/architecture.png: the threads of `dynamics` and the path of a joint state."""

from pathlib import Path
import sys
from typing import Any

from robot_dynamics.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    styled_figure,
    VERMILION,
)

BOXES = (
    (0, 1, BLUE, 'message_loop\ncdr_templates'), (1, 1, BLUE, 'control_path\nloop'),
    (2, 1, BLUE, 'controller\ncomputed_torque'), (3, 1, BLUE, 'supervisor\neffort_limiter'),
    (4, 1, BLUE, 'command_output'), (0, 0, GREEN, 'services\ndiagnostics'),
    (1, 0, GREEN, 'parameters'), (2, 0, GREEN, 'path_conditioning\nplanner'),
    (3, 0, VERMILION, 'urgent_service'), (4, 0, VERMILION, 'command_output'),
    (5, 0, PURPLE, 'shutdown'),
)
"""Place, colour of the thread, and modules."""
THREADS = (
    (-0.43, 1.33, BLUE, 'thread "joint_states loop"'),
    (-0.43, -0.4, GREEN, 'main thread (executor)'),
    (2.57, -0.4, VERMILION, '"~/stop service"'),
    (3.57, -0.4, VERMILION, '"command watch"'),
    (4.57, -0.4, PURPLE, '"signals"'),
)
ARROWS = (
    ((1.0, 0), (1.8, 1), (1.25, 0.5), 'options'),
    ((2.0, 0), (2.0, 1), (2.05, 0.5), 'reference'),
    ((3.0, 0), (2.2, 1), (2.75, 0.5), 'stop'),
    ((4.0, 0), (4.0, 1), (3.97, 0.5), 'fault action'),
    ((5.0, 0), (4.2, 1), (4.75, 0.5), 'stop, then ramp'),
)
"""Ends, place of the label, label."""
WIDTH, HEIGHT = 0.86, 0.46


def box(axes: Any, x: float, y: float, words: str, colour: str) -> None:
    axes.add_patch(_rectangle(x, y, colour))
    axes.text(x, y, words, ha='center', va='center', fontsize=10, color=BLACK)


def _rectangle(x: float, y: float, colour: str) -> Any:
    from matplotlib.patches import FancyBboxPatch
    return FancyBboxPatch(
        (x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT, boxstyle='round,pad=0.02',
        facecolor='white', edgecolor=colour, linewidth=1.8)


def arrow(axes: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate(
        '', end, start, arrowprops={'arrowstyle': '->', 'color': GREY, 'linewidth': 1.3})


def main() -> None:
    """Draw into the directory that is the argument."""
    with styled_figure(11.5, 3.0) as figure:
        axes = figure.add_subplot()
        for x, y, colour, words in BOXES:
            box(axes, x, y, words, colour)
        for x, y, colour, words in THREADS:
            axes.text(x, y, words, fontsize=10.5, color=colour, ha='left', va='center')
        for x in range(4):
            arrow(axes, (x + WIDTH / 2, 1.0), (x + 1 - WIDTH / 2, 1.0))
        arrow(axes, (-1.0, 1.0), (-WIDTH / 2, 1.0))
        axes.text(-1.25, 1.05, 'joint_states', fontsize=10, va='bottom')
        arrow(axes, (4 + WIDTH / 2, 1.0), (5.4, 1.0))
        axes.text(4.55, 1.05, 'effort_command', fontsize=10, va='bottom')
        gap = HEIGHT / 2 + 0.03
        for (x0, y0), (x1, y1), (x, y), label in ARROWS:
            arrow(axes, (x0, y0 + gap), (x1, y1 - gap))
            right = x < x0 - 0.01 and x1 == x0
            axes.text(x, y, label, fontsize=10, va='center',
                      ha='right' if right or x1 > x0 else 'left')
        axes.set_xlim(-1.3, 5.5)
        axes.set_ylim(-0.5, 1.45)
        axes.axis('off')
        figure.savefig(Path(sys.argv[1]) / 'architecture.png')


if __name__ == '__main__':
    main()
