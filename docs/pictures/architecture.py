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

"""Draw docs/images/architecture.png: the threads of `dynamics` and the way of a joint state."""

from pathlib import Path
import sys
from typing import Any

from robot_dynamics.reporting.figures import BLACK, BLUE, GREEN, GREY, styled_figure, VERMILION

BOXES = (
    (0, 1, BLUE, 'message_loop\ncdr_templates'), (1, 1, BLUE, 'control_path\nstate_plausibility'),
    (2, 1, BLUE, 'controller\ncomputed_torque'), (3, 1, BLUE, 'supervisor\neffort_limiter'),
    (4, 1, BLUE, 'command_output'), (0, 0, GREEN, 'services\ndiagnostics'),
    (1, 0, GREEN, 'parameters'), (2, 0, GREEN, 'path_conditioning'),
    (3, 0, VERMILION, 'planned stop'), (4, 0, VERMILION, 'timeout\nfault action'),
)
"""Place, colour of the thread, and modules or tasks."""
NAMES = (
    (-1.75, 1.0, BLUE, 'thread\njoint_states loop'),
    (-1.75, 0.0, GREEN, 'main thread\n(executor)'),
    (2.6, -0.42, VERMILION, 'thread of ~/stop'),
    (3.6, -0.42, VERMILION, 'command watch'),
)
ARROWS = (
    ((1, 0), (2, 1), 'options'), ((2, 0), (2, 1), 'reference'), ((3, 0), (2, 1), 'stop'),
    ((4, 0), (4, 1), 'effort without a state'),
)
WIDTH, HEIGHT = 0.84, 0.5


def box(axes: Any, x: float, y: float, words: str, colour: str) -> None:
    axes.add_patch(_rectangle(x, y, colour))
    axes.text(x, y, words, ha='center', va='center', fontsize=7.5, color=BLACK)


def _rectangle(x: float, y: float, colour: str) -> Any:
    from matplotlib.patches import FancyBboxPatch
    return FancyBboxPatch(
        (x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT, boxstyle='round,pad=0.02',
        facecolor='white', edgecolor=colour, linewidth=1.2)


def arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], words: str) -> None:
    axes.annotate(
        '', end, start, arrowprops={'arrowstyle': '->', 'color': GREY, 'linewidth': 1.0})
    if words:
        place = 0.7 * start[0] + 0.3 * end[0], 0.7 * start[1] + 0.3 * end[1]
        is_left = end[0] > start[0]
        axes.text(
            place[0] + (-0.04 if is_left else 0.04), place[1], words, fontsize=7, color=GREY,
            va='bottom' if is_left else 'center', ha='right' if is_left else 'left')


def main() -> None:
    """Draw into the directory that is the argument."""
    with styled_figure(9.0, 2.5) as figure:
        axes = figure.add_subplot()
        for x, y, colour, words in BOXES:
            box(axes, x, y, words, colour)
        for x, y, colour, words in NAMES:
            axes.text(x, y, words, fontsize=8, color=colour, va='center')
        for x in range(4):
            arrow(axes, (x + WIDTH / 2, 1.0), (x + 1 - WIDTH / 2, 1.0), '')
        arrow(axes, (-0.9, 1.0), (-WIDTH / 2, 1.0), '')
        axes.text(-1.05, 1.12, 'joint_states', fontsize=7, color=GREY)
        arrow(axes, (4 + WIDTH / 2, 1.0), (4.9, 1.0), '')
        axes.text(4.48, 1.12, 'effort_command', fontsize=7, color=GREY)
        gap = HEIGHT / 2 + 0.04
        for (x0, y0), (x1, y1), label in ARROWS:
            arrow(axes, (x0, y0 + gap), (x1, y1 - gap), label)
        axes.set_xlim(-1.8, 5.3)
        axes.set_ylim(-0.55, 1.35)
        axes.axis('off')
        figure.savefig(Path(sys.argv[1]) / 'architecture.png', dpi=150)


if __name__ == '__main__':
    main()
