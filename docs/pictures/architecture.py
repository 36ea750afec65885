# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/images/architecture.png: packages, processes, and the path of a joint state."""

from pathlib import Path
import sys
from typing import Any

from robot_dynamics_tools.reporting.figures import BLACK, BLUE, GREEN, GREY, PURPLE, styled_figure

PACKAGES = (
    (0.5, 3.0, GREEN, 'robot_dynamics_tools'), (2.5, 3.0, BLUE, 'robot_dynamics'),
    (4.5, 3.0, GREY, 'robot_dynamics_interfaces'))
PROCESSES = (
    (0.5, 1.7, PURPLE, 'simulated_arm,\nmujoco_arm or robot'),
    (4.5, 2.0, GREEN, 'ros2 dynamics, viewer,\nrecordings'),
    (4.5, 1.3, GREEN, 'dynamics_monitor'))
BOXES = (
    (0, 0.3, BLUE, 'joint_state_loop\ncdr_templates'), (1, 0.3, BLUE, 'gate'),
    (2, 0.3, BLUE, 'planner\nfollower'), (3, 0.3, BLUE, 'controller\ncomputed_torque'),
    (4, 0.3, BLUE, 'effort_limiter\nsupervisor'), (5, 0.3, BLUE, 'command_output'))
"""Place, colour and modules of each step of a state."""
STEPS = ('reader', 'gate', 'reference', 'law', 'limits, faults', 'publisher')
ROWS = ((3.0, 'imports'), (1.7, 'processes'), (0.3, 'a state'))
ARROWS = (
    ((1.25, 3.0), (1.75, 3.0), ''), ((3.25, 3.0), (3.75, 3.0), ''),
    ((1.1, 1.82), (1.9, 1.82), 'joint_states'), ((1.9, 1.58), (1.1, 1.58), 'effort_command'),
    ((3.1, 2.12), (3.9, 2.12), 'topics'), ((3.9, 1.88), (3.1, 1.88), 'services'),
    ((3.1, 1.3), (3.9, 1.3), 'parameters'),
    *(((x + 0.43, 0.3), (x + 0.57, 0.3), '') for x in range(5)))
"""Start, end and label."""
WIDE, MIDDLE, NARROW, HEIGHT, TALL = 1.5, 1.2, 0.86, 0.5, 1.2


def box(
    axes: Any, x: float, y: float, colour: str, words: str, width: float, height: float = HEIGHT,
) -> None:
    from matplotlib.patches import FancyBboxPatch
    axes.add_patch(FancyBboxPatch(
        (x - width / 2, y - height / 2), width, height, boxstyle='round,pad=0.02',
        facecolor='white', edgecolor=colour, linewidth=1.8))
    axes.text(x, y, words, ha='center', va='center', fontsize=10, color=BLACK)


def main() -> None:
    """Draw into the directory that is the argument."""
    with styled_figure(11.5, 4.6) as figure:
        axes = figure.add_subplot()
        for width, boxes in ((WIDE, PACKAGES), (MIDDLE, PROCESSES)):
            for x, y, colour, words in boxes:
                box(axes, x, y, colour, words, width)
        box(axes, 2.5, 1.65, BLUE, 'dynamics', MIDDLE, TALL)
        for (x, y, colour, words), step in zip(BOXES, STEPS):
            box(axes, x, y, colour, words, NARROW)
            axes.text(x, y + 0.33, step, ha='center', va='bottom', fontsize=10, color=GREY)
        for y, words in ROWS:
            axes.text(-1.35, y, words, fontsize=11, va='center', color=GREY)
        for start, end, label in ARROWS:
            axes.annotate(
                '', end, start, arrowprops={'arrowstyle': '->', 'color': GREY, 'linewidth': 1.3})
            axes.text((start[0] + end[0]) / 2, start[1] + (0.1 if end > start else -0.1), label,
                      ha='center', va='bottom' if end > start else 'top', fontsize=9)
        axes.set_xlim(-1.4, 5.5)
        axes.set_ylim(-0.05, 3.35)
        axes.axis('off')
        figure.savefig(Path(sys.argv[1]) / 'architecture.png')


if __name__ == '__main__':
    main()
