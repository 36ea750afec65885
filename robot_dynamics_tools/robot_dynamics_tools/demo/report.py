# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The evaluation of a recording of the closed loop: errors, rates, figure and HTML report."""

from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import numpy as np
from robot_dynamics.arrays import FloatArray, wrap_to_pi
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.joints.units import units_of
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics.tools.command_line import write_file
from robot_dynamics_tools.demo.loop import LoopRun
from robot_dynamics_tools.demo.session import Session
from robot_dynamics_tools.excitation.demo_motion import sample_trajectory
from robot_dynamics_tools.recordings.messages import stamp_ns
from robot_dynamics_tools.recordings.reader import Recording, stack
from robot_dynamics_tools.reporting.figures import effort_panel, Panel
from robot_dynamics_tools.reporting.interactive import add_time_figures
from robot_dynamics_tools.reporting.text_table import column_rows, quantity_table, Rows

LARGEST_RMS = 0.01
"""Largest RMS error [rad] or [m] of a tracked joint, at the default gains."""
FEW_ANSWERS = 0.8
"""Fraction of answered states below which the report suggests a lower rate."""
AT_LIMIT = 0.98
"""Fraction of an effort limit from which the effort is at its limit."""
RULE = (f'Rule: good if the RMS of the tracking error is below {1e3 * LARGEST_RMS:g} mrad or mm, '
        'bad otherwise.')
FASTER = ('raise `gains.natural_frequency` in steps of 20 %, or check friction and masses in '
          '`--parameters`')
TERM_NAMES = ('gravity', 'inertial', 'coriolis', 'friction', 'effort')


@dataclass(frozen=True, eq=False)
class LoopReport:
    """
    Result of the motion, at the stamps of its measured states.

    `times` (m,) [s] from its start; `reference` and `measured` (m, n) [rad or m], and `error`,
    their difference: the shortest angular distance for continuous joints. `term_times` and
    `terms` are the command by term [N·m or N]. `answered` is the fraction of the states with a
    command; `efforts_per_second` and `wall_seconds` are measured on the wall clock.
    """

    arm: ArmModel
    times: FloatArray
    reference: FloatArray
    measured: FloatArray
    error: FloatArray
    term_times: FloatArray
    terms: dict[str, FloatArray]
    answered: float
    efforts_per_second: float
    wall_seconds: float

    @property
    def rms(self) -> FloatArray:
        """RMS of the error, (n,)."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)))

    @property
    def largest(self) -> FloatArray:
        """Largest absolute error, (n,)."""
        return np.asarray(np.abs(self.error).max(axis=0))

    @property
    def missed(self) -> list[str]:
        """The joints that did not track."""
        return [name for name, rms in zip(self.arm.joint_names, self.rms) if not rms < LARGEST_RMS]


def loop_report(recording_path: Path, arm: ArmModel, run: LoopRun) -> LoopReport:
    """Read a recording of `run`; raise RecordingError if it has no state of the motion."""
    with Recording(recording_path) as recording:
        states = recording.joint_series(Session.JOINT_STATES, arm.joint_names)
        commands = recording.joint_series(Session.EFFORT_COMMAND, arm.joint_names)
        term_stamps, terms = stack(recording.messages(Session.TERMS), TERM_NAMES)
        arrivals = [time_ns for time_ns, message in recording.messages(Session.EFFORT_COMMAND)
                    if run.start_ns <= stamp_ns(message.header) <= run.end_ns]
    during = (states.stamps_ns >= run.start_ns) & (states.stamps_ns <= run.end_ns)
    stamps = states.stamps_ns[during]
    if states.position is None or len(stamps) < 2 or len(arrivals) < 2 or run.start_ns == 0:
        raise RecordingError('no state of the motion was recorded, or no effort for one')
    wall_seconds = 1e-9 * (arrivals[-1] - arrivals[0])
    times = np.asarray(1e-9 * (stamps - run.start_ns), dtype=np.float64)
    measured = states.position[during]
    reference = sample_trajectory(run.motion.trajectory, times).position
    error = reference - measured
    error[:, arm.is_continuous] = wrap_to_pi(error[:, arm.is_continuous])
    commanded = np.isin(stamps, commands.stamps_ns)
    term_during = (term_stamps >= run.start_ns) & (term_stamps <= run.end_ns)
    return LoopReport(
        arm, times, reference, measured, error,
        np.asarray(1e-9 * (term_stamps[term_during] - run.start_ns), dtype=np.float64),
        {name: values[term_during] for name, values in terms.items()},
        float(commanded.mean()), (len(arrivals) - 1) / wall_seconds, wall_seconds)


def print_report(report: LoopReport, run: LoopRun) -> None:
    """Print errors per joint, and rates."""
    print(f'\n{quantity_table(error_rows(report))}\n')
    print('\n'.join(rate_lines(report, run)))


def error_rows(report: LoopReport) -> Rows:
    """Return the errors of each joint, after a row of titles."""
    texts = [units_of(kind).error_text for kind in report.arm.joint_kinds]
    return column_rows('joint', report.arm.joint_names, *(
        (title, [text(value) for text, value in zip(texts, values)]) for title, values in (
            ('RMS error', report.rms), ('largest error', report.largest),
            ('limit of RMS', repeat(LARGEST_RMS)))))


def rate_lines(report: LoopReport, run: LoopRun) -> list[str]:
    """Return lines about the rates, the losses and the planned effort."""
    lines = [
        f'Control          {100.0 * report.answered:.2f} % of the states were answered: '
        f'{run.rate:g} per second of motion, {report.efforts_per_second:.1f} per second',
        f'Time             {report.times[-1] - report.times[0]:.2f} s of motion in '
        f'{report.wall_seconds:.2f} s; {run.lost} of {run.received + run.lost} messages dropped '
        'by the recorder']
    if run.lost:
        lines.append('                 The recording is incomplete: try a lower --rate, or a '
                     'lower real_time_factor of simulated_arm in --parameters.')
    if report.answered < FEW_ANSWERS:
        lines.append('                 This machine is too slow for the rate: errors may be '
                     'larger; try a lower --rate.')
    return [*lines, f'Largest effort   {100.0 * run.motion.effort_ratio:.0f} % of its limit at '
            f'{run.motion.worst_joint} (planned)']


def loop_panels(report: LoopReport) -> tuple[Panel, ...]:
    """Return the panels of positions, errors, and the effort by term."""
    lines = {name: values for name, values in report.terms.items()
             if name != 'friction' or values.any()}
    return (
        Panel('Position', 'position', report.times,
              {'reference': report.reference, 'measured': report.measured}, ('rad', 'm')),
        Panel('Tracking error', 'error', report.times, {'error': report.error}, ('mrad', 'mm'),
              1e3),
        effort_panel('Effort by term', report.term_times, lines))


def write_loop_page(
    report: LoopReport, run: LoopRun, picture: Path, path: Path, origin: Origin,
) -> None:
    """Write the report of a closed loop, and its figure as `picture`; raise ToolError."""
    name = report.arm.name
    page = Page(f'{name}: closed loop', loop_verdicts(report), RULE, origin)
    page.section('Tracking error')
    page.table(error_rows(report))
    page.section('Rates')
    page.items(' '.join(line.split()) for line in rate_lines(report, run))
    page.section('Position, tracking error and effort over time')
    write_file(picture, add_time_figures(
        page, report.arm,
        f'{name}: reference and measured position, and the commanded effort by term',
        loop_panels(report), 'Position, tracking error and effort by term'))
    write_file(path, page.html())


def loop_verdicts(report: LoopReport) -> list[Verdict]:
    """Return the verdict on the tracking of each joint."""
    arm, efforts = report.arm, np.abs(report.terms['effort']).max(axis=0, initial=0.0)
    return [
        tracking_verdict(name, kind, rms, effort / limit, report.answered)
        for name, kind, rms, effort, limit in zip(
            arm.joint_names, arm.joint_kinds, report.rms.tolist(), efforts.tolist(),
            arm.limits.effort.tolist())]


def tracking_verdict(
    name: str, kind: str, rms: float, effort_ratio: float, answered: float,
) -> Verdict:
    """Return the verdict on one joint from its RMS error [rad] or [m] and its effort / limit."""
    text = units_of(kind).error_text
    size = f'RMS error {text(rms)}, limit {text(LARGEST_RMS)}'
    if rms < LARGEST_RMS:
        return Verdict(name, Grade.GOOD, f'the joint tracks: {size}', 'no change needed')
    if effort_ratio > AT_LIMIT:
        return Verdict(name, Grade.BAD, f'the effort reaches its limit: {size}',
                       'use a slower trajectory (`--duration`) or a smaller payload')
    if answered < FEW_ANSWERS:
        return Verdict(
            name, Grade.BAD, f'{100.0 * answered:.0f} % of the states were answered: {size}',
            'use a lower `--rate`')
    return Verdict(name, Grade.BAD, f'the joint does not track: {size}', FASTER)
