# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Playback of a recording to `dynamics`, and comparison of modelled and measured effort."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any

import numpy as np
from rclpy.executors import SingleThreadedExecutor
from robot_dynamics.analysis.motion_filter import filter_motion_below, FILTER_ORDER, FilteredMotion
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.recordings.interrupts import uninterrupted
from robot_dynamics.recordings.reader import JointSeries, Recording
from robot_dynamics.recordings.sample_faults import counted
from robot_dynamics.reporting.figures import effort_panel, joint_figure, Panel, save_figure
from robot_dynamics.reporting.progress import Progress
from robot_dynamics.reporting.text_table import percent, quantity_table
from robot_dynamics.ros.conversions import floats_to_ros
from robot_dynamics.tools.demo.playback import Playback, PlaybackResult
from robot_dynamics.tools.demo.processes import DemoError, DYNAMICS
from robot_dynamics.tools.demo.session import (
    DESCRIPTION,
    GRAVITY,
    JOINT_STATES,
    recording_session,
    ROBOT_DESCRIPTION,
    Session,
)
from robot_dynamics_interfaces.srv import InverseDynamicsBatch

CUTOFF = 5.0
"""[Hz]"""
BATCH = 1000
"""Samples in one request."""
SERVICE = '/dynamics/inverse_dynamics_batch'


@dataclass(frozen=True, eq=False)
class Recorded:
    """The played data: all joints of a topic, and the URDF in the recording, if any."""

    path: Path
    topic: str
    series: JointSeries
    urdf: str | None


@dataclass(frozen=True, eq=False)
class Replay:
    """
    The responses of the node. All are (m, n) [N·m or N] in the order of `arm.joint_names`.

    `motion` is the requested motion; `terms` are its efforts of inverse dynamics, by name.
    """

    arm: ArmModel
    played: PlaybackResult
    motion: FilteredMotion
    terms: Mapping[str, FloatArray]
    lost: int


@dataclass(frozen=True, eq=False)
class Comparison:
    """Modelled and measured efforts, and the residual of gravity compensation only."""

    arm: ArmModel
    motion: FilteredMotion
    terms: Mapping[str, FloatArray]

    def residual(self, term: str) -> FloatArray | None:
        """Return measured minus modelled effort (m, n), None without measured effort."""
        measured = self.motion.effort
        return None if measured is None else measured - self.terms[term]


def read_recording(path: Path, topic: str | None, seconds: float | None) -> Recorded:
    """Return the joint states of a recording; raise RecordingError."""
    print(f'Reading {path} ...', flush=True)
    with Recording(path) as recording:
        name = topic or recording.joint_state_topic()
        series = recording.joint_series(name)
        urdf = None
        if any(t.name == ROBOT_DESCRIPTION and t.message_count for t in recording.topics):
            urdf = str(next(recording.messages(ROBOT_DESCRIPTION))[1].data)
        for line in [*recording.notes, *(
                loss.words(int(series.stamps_ns[0])) for loss in recording.losses)]:
            print(f'  {line}')
    for line in series.faults.words():
        print(f'  {line}')
    if seconds is not None:
        series = series.first(seconds)
    measured = ' and '.join(
        field for field in ('position', 'velocity', 'effort')
        if getattr(series, field) is not None)
    print(f'  {name}: {len(series.stamps_ns)} states of {len(series.joint_names)} joints, '
          f'{series.times[-1]:.2f} s, with {measured or "nothing"}'
          + (f'; {series.passed_over} messages skipped' if series.passed_over else ''))
    return Recorded(path, name, series, urdf)


def play_recording(
    recorded: Recorded, urdf: str, rate: float | None, directory: Path,
) -> Replay:
    """
    Play the recorded states to the node, request inverse dynamics from it, and record all topics.

    Raises RobotDynamicsError if arm and recording do not match, DemoError if the node fails.
    """
    arm = _recorded_arm(urdf, recorded.series)
    series = recorded.series.of_joints(arm.joint_names)
    driven = series.driven()
    held = len(series.stamps_ns) - len(driven.stamps_ns)
    if held:
        print(f'  {counted(held, "state")} without any effort (brakes): played, not compared')
    motion = filter_motion_below(driven.unwrapped(arm.is_continuous), CUTOFF)
    print(f'Starting dynamics_node ({arm.name}, {arm.joint_count} joints) ...', flush=True)
    now = {'ns': int(series.stamps_ns[0])}
    with recording_session(directory, urdf, time_ns=lambda: now['ns']) as session:
        session.nodes.start('dynamics', DYNAMICS, {
            'robot_description_file': str((directory / DESCRIPTION).resolve()),
            'joints': list(arm.joint_names),
            'command': 'gravity_compensation',  # a recorded arm cannot be held
            'state_max_age': 0.0,  # a recording may have any age
            'effort_check': False})  # no command of this node held the recorded arm
        playback = Playback(session.node, session.recorder, JOINT_STATES, GRAVITY, series)
        session.wait_for(lambda: playback.found, f'a subscriber of {JOINT_STATES}')
        print('Playing the recorded states, each after the response to the state before ...',
              flush=True)
        with Progress(len(series.stamps_ns), 'states') as progress:
            def on_progress(done: int) -> None:
                now['ns'] = int(series.stamps_ns[done - 1])
                progress.update(done)

            try:
                played = playback.play(rate, on_progress, session.nodes.check)
            except RecordingError as error:
                raise DemoError(f'{error}.\n{session.nodes.logs()}') from None
        print(f'Calling {SERVICE} for the measured motion ...', flush=True)
        terms = _ask_terms(session, arm, motion)
        lost = sum(count.lost for count in session.recorder.counts.values())
    return Replay(arm, played, motion, terms, lost)


def compare(replay: Replay) -> Comparison:
    """Return the comparison of measured and modelled effort."""
    return Comparison(replay.arm, replay.motion, replay.terms)


def print_comparison(comparison: Comparison, recorded: Recorded, replay: Replay) -> None:
    """Print measured effort and residual per joint."""
    motion, played = comparison.motion, replay.played
    print(f'\n{played.played} states played in {played.seconds:.1f} s, all answered '
          f'({played.resent} retransmitted); {replay.lost} messages dropped by the recorder')
    print(f'Acceleration: derivative of the velocity. Filter of velocity and measured effort: '
          f'Butterworth,\norder {FILTER_ORDER}, {motion.cutoff_hz:g} Hz, forward and backward, '
          f'at a sampling rate of {motion.sample_rate_hz:.1f} Hz\n')
    if motion.effort is None:
        print(f'{recorded.topic} has no measured effort: the table has only modelled '
              'efforts.\n')
    print(quantity_table(comparison_rows(comparison)))
    if motion.effort is not None:
        print('\nresidual: measured effort minus the inverse dynamics of the model for the '
              'measured motion;\nrelative: RMS of the residual divided by the RMS of the measured '
              'effort; gravity only: the same\nwith g(q) as the model.')
    print()


def comparison_panels(comparison: Comparison) -> list[Panel]:
    """Return the panels of measured and modelled effort, and of the terms."""
    motion, terms = comparison.motion, comparison.terms
    panels: list[Panel] = []
    residual = comparison.residual('effort')
    if motion.effort is not None and residual is not None:
        panels.append(effort_panel('Measured effort and model', motion.times, {
            'measured': motion.effort, 'model': terms['effort'], 'residual': residual}))
    by_term = {name: terms[name] for name in ('gravity', 'inertial', 'coriolis', 'effort')}
    if np.any(terms['friction']):
        by_term['friction'] = terms['friction']
    return [*panels, effort_panel('Model by term', motion.times, by_term)]


def save_comparison(comparison: Comparison, path: Path) -> None:
    """Write the figure of `comparison_panels`; raise OSError."""
    arm = comparison.arm
    compared = 'measured and modelled' if comparison.motion.effort is not None else 'modelled'
    save_figure(joint_figure(
        f'{arm.name}: {compared} effort of the recorded motion', arm.joint_names,
        arm.joint_kinds, comparison_panels(comparison)), path)


def comparison_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return efforts and residuals of each joint, after a row of titles."""
    def away_from_ends(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else values[comparison.motion.usable]

    arm, model = comparison.arm, comparison.terms['effort']
    measured = away_from_ends(comparison.motion.effort)
    residual = away_from_ends(comparison.residual('effort'))
    without = away_from_ends(comparison.residual('gravity'))
    rows: list[tuple[str, ...]] = [('joint', 'RMS of model', 'largest')]
    if measured is not None:
        rows = [(
            'joint', 'RMS of measured', 'RMS of residual', 'relative', 'largest residual',
            'gravity only')]
    for j, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_kinds)):
        unit = 'N' if kind == 'prismatic' else 'N·m'
        if measured is None or residual is None or without is None:
            rows.append((name, f'{_rms(model[:, j]):.3f} {unit}',
                         f'{np.abs(model[:, j]).max():.3f} {unit}'))
            continue
        whole = _rms(measured[:, j])
        rows.append((
            name, f'{whole:.3f} {unit}', f'{_rms(residual[:, j]):.3f} {unit}',
            _percent(_rms(residual[:, j]), whole), f'{np.abs(residual[:, j]).max():.3f} {unit}',
            _percent(_rms(without[:, j]), whole)))
    return rows


def _percent(part: float, whole: float) -> str:
    return percent(part / whole if whole > 0.0 else np.nan)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _recorded_arm(urdf: str, series: JointSeries) -> ArmModel:
    """Return the arm with those of its joints that were recorded; the others are locked."""
    arm = arm_from_urdf(urdf)
    joints = [name for name in arm.joint_names if name in series.joint_names]
    if not joints:
        raise InvalidInputError(
            f'the recording has the joints {list(series.joint_names)}, but the arm '
            f'{arm.name!r} has {list(arm.joint_names)}: give its description with --robot')
    if len(joints) == arm.joint_count:
        return arm
    locked = [name for name in arm.joint_names if name not in joints]
    print(f'  not recorded, therefore locked: {locked}')
    return arm_from_urdf(urdf, joints)


def _ask_terms(session: Session, arm: ArmModel, motion: FilteredMotion) -> dict[str, FloatArray]:
    """
    Return the effort of the motion and its terms, each (m, n).

    The service returns only total efforts. Without acceleration there is no inertial term; of the
    other terms, C(q, v) v + g(q) is even in v, and friction is odd.
    """
    q, v, a = motion.position, motion.velocity, motion.acceleration
    zero = np.zeros_like(q)
    ask = _BatchClient(session, arm)
    effort, forth, back, gravity = (
        ask(q, *rates) for rates in ((v, a), (v, zero), (-v, zero), (zero, zero)))
    ask.close()
    return {
        'effort': effort, 'inertial': effort - forth, 'coriolis': 0.5 * (forth + back) - gravity,
        'friction': 0.5 * (forth - back), 'gravity': gravity}


class _BatchClient:
    """Requests the inverse dynamics of many samples from the node, in batches."""

    def __init__(self, session: Session, arm: ArmModel) -> None:
        self._session, self._arm = session, arm
        self._client = session.node.create_client(InverseDynamicsBatch, SERVICE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(session.node)
        session.wait_for(self._client.service_is_ready, f'the service {SERVICE}')

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        return np.concatenate([
            self._part(q[i:i + BATCH], v[i:i + BATCH], a[i:i + BATCH])
            for i in range(0, len(q), BATCH)])

    def _part(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        future = self._client.call_async(InverseDynamicsBatch.Request(
            joint_names=list(self._arm.joint_names), position=floats_to_ros(q),
            velocity=floats_to_ros(v), acceleration=floats_to_ros(a)))
        deadline = time.monotonic() + 10.0
        while not future.done():
            with uninterrupted():
                self._executor.spin_once(timeout_sec=0.1)
            self._session.record(0.0)
            if time.monotonic() > deadline:
                raise DemoError(
                    f'no response of {SERVICE} within 10 s.\n{self._session.nodes.logs()}')
        answer: Any = future.result()
        if not answer.success:
            raise DemoError(f'{SERVICE} rejected the request: {answer.message}')
        return np.array(answer.effort).reshape(q.shape)

    def close(self) -> None:
        self._executor.shutdown()
        self._session.node.destroy_client(self._client)
