# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Safety of the control loop with default parameters, in simulation without ROS.

Arms × kinds of motion × sizes × state rates × delays × velocity noise, each without and with one
disturbance (`safe_motion_disturbances`). Ends with status 1 if any run is bad. With options:
`scripts/run python -m benchmarks.safe_motion --help`.
"""

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
import csv
import multiprocessing
import os
from pathlib import Path
import sys
import time
from typing import Any

from benchmarks.safe_motion_cases import (
    all_cases,
    arm_named,
    ARMS,
    Case,
    DEFAULT_ARMS,
    DELAYS,
    FEED_FORWARD,
    MOTIONS,
    PERIODS,
    PUSH,
    SET_POINT,
    SIZES,
    STREAM,
    TRAJECTORY,
)
from benchmarks.safe_motion_disturbances import DISTURBANCES
from benchmarks.safe_motion_hand import HAND_GUIDING
from benchmarks.safe_motion_run import Outcome, Run, run, VERDICTS
from robot_dynamics.exceptions import MissingDependencyError
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    save_figure,
    SKY,
    styled_figure,
    title_axes,
    VERMILION,
)

QUICK = 20
"""`--quick` without a number runs one case of this many."""
NONE = 'none'
FAST_ONLY, SLOWEST = (FEED_FORWARD, HAND_GUIDING), 100
"""
Modes that need joint states at least at this rate [Hz].

Steps of slower commands are ripples of the velocity of a drive; late gravity compensation is
unstable without feedback.
"""
COMMANDS = (
    'computed_torque', 'joint_impedance', 'cartesian_impedance', HAND_GUIDING, FEED_FORWARD)
SHOWN = 10
"""Bad runs that are listed."""
STYLES = dict(zip(ARMS, (
    (BLACK, '-', 'o'), (ORANGE, '-', 's'), (SKY, '-', '^'), (GREEN, '-', 'D'), (BLUE, '-', 'v'),
    (VERMILION, '--', 'o'), (PURPLE, '--', 's'), (GREY, '--', '^'), (BLACK, '--', 'D'))))
"""Colour, dash and marker of each arm."""
PANELS = {SET_POINT: 'One set-point', STREAM: 'Set-points at 50 Hz', TRAJECTORY: 'Trajectory'}
"""Titles of the panels of the figure, by motion."""
SHOWN_SIZES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
SHOWN_RATIOS = (0.01, 0.1, 0.5, 1.0)
LARGE = {
    'font.size': 16.0, 'axes.titlesize': 17.0, 'axes.labelsize': 16.0, 'legend.fontsize': 16.0,
    'xtick.labelsize': 15.0, 'ytick.labelsize': 15.0, 'figure.titlesize': 18.0}
"""Sizes of letters that are readable at half the size of the figure."""


def main(argv: Sequence[str] = ()) -> None:
    """Run the cases and print the tables; exit with status 1 if any run is bad."""
    arguments = _parser().parse_args(argv)
    arms, cases = _installed(arguments.arms), list[Case]()
    if not arguments.disturbed:
        cases += all_cases(arms)[::arguments.quick]
    if not arguments.clean:
        cases += all_cases(arms, arguments.kinds)[::arguments.quick]
    cases = [case._replace(
        has_velocity=not arguments.positions_only, command=arguments.command) for case in cases]
    if arguments.command in FAST_ONLY:
        cases = [case for case in cases if case.rate >= SLOWEST]
    start = time.perf_counter()
    runs = run_all(cases, arguments.jobs)
    _print_report(runs, time.perf_counter() - start, arguments.jobs)
    if arguments.csv is not None:
        write_csv(runs, arguments.csv)
    if arguments.figure is not None:
        draw(runs, arguments.figure)
    if any(outcome.is_bad for _, outcome in runs):
        raise SystemExit(1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m benchmarks.safe_motion', description=__doc__)
    parser.add_argument(
        '--jobs', type=int, default=os.cpu_count() or 1, metavar='N',
        help='number of processes, one per core by default')
    parser.add_argument(
        '--arms', nargs='+', choices=ARMS, default=list(DEFAULT_ARMS), metavar='ARM',
        help=f'arms to simulate, by default {", ".join(DEFAULT_ARMS)}; also '
        f'{", ".join(arm for arm in ARMS if arm not in DEFAULT_ARMS)}')
    parser.add_argument(
        '--quick', type=int, nargs='?', const=QUICK, default=1, metavar='K',
        help=f'run every K-th case, every {QUICK}th without a number')
    group = parser.add_mutually_exclusive_group()
    group.add_argument('--clean', action='store_true', help='only runs without a disturbance')
    group.add_argument('--disturbed', action='store_true', help='only runs with a disturbance')
    parser.add_argument(
        '--kinds', nargs='+', choices=DISTURBANCES, default=list(DISTURBANCES), metavar='KIND',
        help=f'disturbances, all by default: {", ".join(DISTURBANCES)}')
    parser.add_argument(
        '--positions-only', action='store_true',
        help='joint states without velocities; with noise, that of the positions')
    parser.add_argument(
        '--command', choices=COMMANDS, default='computed_torque', metavar='LAW',
        help='control law, by default computed_torque, or feed_forward for drives with their own '
        f'position loop; expected one of {", ".join(COMMANDS)}')
    parser.add_argument(
        '--figure', type=Path, metavar='FILE', help='plot of the largest velocities (PNG)')
    parser.add_argument('--csv', type=Path, metavar='FILE', help='table of all runs')
    return parser


def _installed(names: Sequence[str]) -> list[str]:
    found = []
    for name in names:
        try:
            arm_named(name)
            found.append(name)
        except MissingDependencyError as error:
            print(f'{name} is left out: {error}')
    return found


def run_all(cases: Sequence[Case], jobs: int) -> list[Run]:
    """Return the outcomes of all cases, in their order; report the progress on stderr."""
    if jobs == 1:
        return list(_with_progress(map(run, cases), len(cases)))
    with multiprocessing.Pool(jobs) as pool:
        return list(_with_progress(pool.imap(run, cases, chunksize=4), len(cases)))


def _with_progress(runs: Iterable[Run], count: int) -> Iterator[Run]:
    is_terminal = sys.stderr.isatty()
    step, shown, bad = 1 if is_terminal else 10, 0, 0
    for i, found in enumerate(runs, 1):
        bad += found[1].is_bad
        percent = 100 * i // count
        if percent >= shown + step:
            shown = percent
            print(f'{percent:3} %: {i} of {count} runs, {bad} bad', file=sys.stderr, flush=True,
                  end='\r' if is_terminal and i < count else '\n')
        yield found


# ---------------------------------------------------------------------- tables


def _print_report(runs: Sequence[Run], seconds: float, jobs: int) -> None:
    simulated = sum(outcome.simulated for _, outcome in runs)
    bad = [found for found in runs if found[1].is_bad]
    print(f'{len(runs)} runs, {simulated:.0f} s of simulated time, in {seconds:.0f} s by {jobs} '
          f'process{"es" if jobs > 1 else ""}; {len(bad)} bad')
    keys: dict[str, Callable[[Case], str]] = {
        'arm': lambda case: case.arm, 'motion': lambda case: case.motion,
        'size [rad]': lambda case: '-' if case.motion == PUSH else f'{case.size:g}',
        'disturbance': lambda case: case.disturbance or NONE,
        'rate, delay, noise': _condition}
    orders = {
        'arm': ARMS, 'motion': MOTIONS, 'size [rad]': [f'{size:g}' for size in SIZES],
        'disturbance': [NONE, *DISTURBANCES],
        'rate, delay, noise': [
            _condition(Case('', '', 0.0, rate, delay, noisy))
            for noisy in (False, True) for rate in PERIODS for delay in DELAYS]}
    heads = ['runs', 'bad', *VERDICTS, 'faults', 'max v/v_max']
    for title, key in keys.items():
        found: dict[str, list[Outcome]] = {name: [] for name in orders[title]}
        for case, outcome in runs:
            found.setdefault(key(case), []).append(outcome)
        _print_table([title, *heads], [_row(*item) for item in found.items() if item[1]])
    if runs:
        _print_table(['', *heads], [_row('all', [outcome for _, outcome in runs])])
    for case, outcome in sorted(bad, key=lambda found: -found[1].velocity_ratio)[:SHOWN]:
        verdicts = ', '.join(name for name, is_bad in zip(VERDICTS, outcome.verdicts) if is_bad)
        print(f'{case.arm}, {case.motion} {case.size:g} rad, {_condition(case)}, '
              f'{case.disturbance or "no disturbance"}: {verdicts}; |v|/v_max '
              f'{outcome.velocity_ratio:.2f}, amplitude {outcome.amplitude:.3f} rad, overshoot '
              f'{outcome.overshoot:.3f} rad, distance {outcome.distance:.3f} rad, reference '
              f'{outcome.hull_excess:.2g} rad out of its hull'
              f'{", " if outcome.faults else ""}{outcome.faults}')


def _condition(case: Case) -> str:
    return f'{case.rate} Hz, {case.delay} ms{", noise" if case.noisy else ""}'


def _row(name: str, outcomes: Sequence[Outcome]) -> list[str]:
    counts = map(sum, zip(*(outcome.verdicts for outcome in outcomes)))
    faults = sum(len(outcome.faults.split()) for outcome in outcomes)
    ratio = max(outcome.velocity_ratio for outcome in outcomes)
    bad = sum(outcome.is_bad for outcome in outcomes)
    return [name, *map(str, (len(outcomes), bad, *counts, faults)), f'{ratio:.2f}']


def _print_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table as aligned text that is also valid Markdown."""
    widths = [max(map(len, column)) for column in zip(heads, *rows)]
    rule = [f'{"-" * (width - 1)}{":" if i else "-"}' for i, width in enumerate(widths)]
    print()
    for row in (heads, rule, *rows):
        cells = (f'{cell:>{width}}' if i else f'{cell:<{width}}'
                 for i, (cell, width) in enumerate(zip(row, widths)))
        print(f'| {" | ".join(cells)} |')


def write_csv(runs: Sequence[Run], path: Path) -> None:
    """Write one row per run: the case, the verdicts and the numbers that they depend on."""
    with path.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file)
        writer.writerow((*Case._fields, *Outcome._fields))
        writer.writerows((*case, *outcome) for case, outcome in runs)


# ---------------------------------------------------------------------- figure


def draw(runs: Sequence[Run], path: Path) -> None:
    """Plot the largest |v|/v_max against the size, per arm and motion; crosses are bad runs."""
    arms = [arm for arm in ARMS if any(case.arm == arm for case, _ in runs)]
    with styled_figure(13.0, 6.4, style=LARGE) as figure:
        figure.suptitle(
            'Largest velocity of a motion: the worst case of all rates, delays and noise levels')
        all_axes = figure.subplots(1, len(PANELS), sharey=True, squeeze=False)[0]
        for axes, (motion, title) in zip(all_axes, PANELS.items()):
            title_axes(axes, title)
            for arm in arms:
                _draw_arm(axes, arm, [found for found in runs if (
                    found[0].arm == arm and found[0].motion == motion)])
            axes.axhline(1.0, color=GREY, linewidth=4.0, alpha=0.5)
            axes.set(xscale='log', yscale='log', xlabel='step size [rad]', ylim=(0.008, 1.7))
            axes.set_xticks(SHOWN_SIZES, [f'{size:g}' for size in SHOWN_SIZES])
            axes.set_yticks(SHOWN_RATIOS, [f'{100.0 * ratio:g} %' for ratio in SHOWN_RATIOS])
            axes.minorticks_off()
        all_axes[0].set_ylabel('velocity / velocity limit')
        all_axes[0].text(SIZES[0], 1.12, 'velocity limit', va='bottom', color=GREY)
        handles, labels = all_axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=len(arms), frameon=False)
        save_figure(figure, path)


def _draw_arm(axes: Any, arm: str, runs: Sequence[Run]) -> None:
    colour, dash, marker = STYLES[arm]
    worst: dict[float, list[Outcome]] = {}
    for case, outcome in runs:
        worst.setdefault(case.size, []).append(outcome)
    sizes = sorted(worst)
    ratios = [max(outcome.velocity_ratio for outcome in worst[size]) for size in sizes]
    axes.plot(sizes, ratios, dash, color=colour, marker=marker, markersize=7,
              linewidth=2.2, label=arm)
    bad = [(size, ratio) for size, ratio in zip(sizes, ratios)
           if any(outcome.is_bad for outcome in worst[size])]
    if bad:
        axes.plot(*zip(*bad), 'x', color=colour, markersize=16, markeredgewidth=3)


if __name__ == '__main__':
    main(sys.argv[1:])
