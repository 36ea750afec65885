# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The joint states of a robot as they arrive: rate, stamps, units, resolution, noise."""

import math
import time

import numpy as np
from robot_dynamics.control.options import DEFAULT_STATE_MAX_AGE
from robot_dynamics.control.safety.faults import STATE_TIMEOUT
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.monitoring.state_plausibility import SAME_CLOCK
from robot_dynamics_tools.analysis.arm_recording import plausible
from robot_dynamics_tools.analysis.units import check_degrees, contradicts_position
from robot_dynamics_tools.connect.checks import BAD, Checklist, GOOD, UNKNOWN
from robot_dynamics_tools.gravity_calibration.holds import BLOCK, per_joint, REST_SPEED
from robot_dynamics_tools.recordings.joint_series import JointSeries, RecordedJointStates
from robot_dynamics_tools.recordings.messages import FIELDS, recorded_state, RecordedState
from robot_dynamics_tools.ros2_dynamics.client import NoAnswerError
from sensor_msgs.msg import JointState

LISTEN, LEAST = 3.0, 10
"""[s] in which rate, stamps and noise are measured, and fewest joint states in this time."""
MOVED = 0.01
"""[rad] or [m] of motion from which velocities are compared with positions."""
USUAL, GAPS = 0.99, 3.0
"""The timeout by the gap between two joint states that this share of all does not exceed."""


class StateLog:
    """The joint states that `take` gets, with the times of their arrival [ns]."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.states: list[RecordedState] = []

    def take(self, message: JointState) -> None:
        self.states.append(recorded_state(time.time_ns(), message))

    @property
    def recorded(self) -> RecordedJointStates:
        return RecordedJointStates(self.topic, tuple(self.states), 0)

    def series(self, arm: ArmModel) -> JointSeries:
        """Return the samples of an arm; raise RecordingError."""
        series = self.recorded.series(arm.joint_names).unwrapped(arm.is_continuous)
        if series.position is None:
            raise RecordingError(f'{self.topic} has no positions, one per name and finite')
        return series


def check_states(log: StateLog, arm: ArmModel, checks: Checklist) -> tuple[float, str]:
    """Check the joint states; return the `state_timeout` [s] that they need, and their rate."""
    series = log.series(arm)
    if len(series.times) < LEAST:
        raise NoAnswerError(
            f'{len(series.times)} messages with {", ".join(arm.joint_names)} on {log.topic}, '
            f'expected at least {LEAST} in {LISTEN:g} s')
    periods = np.diff(series.times)
    longest, usual = float(periods.max()), float(np.quantile(periods, USUAL))
    timeout = max(STATE_TIMEOUT, float(np.ceil(100.0 * GAPS * usual) / 100.0))
    measured = (f'{1.0 / np.median(periods):.0f} Hz, longest gap {1e3 * longest:.1f} ms, jitter '
                f'{1e3 * periods.std():.2f} ms')
    checks.add('rate', timeout == STATE_TIMEOUT and longest < 0.5 * timeout, measured,
               '99 % of the gaps below 17 ms, none above half of state_timeout', (
                   f'state_timeout is {timeout:g} s; a low rate makes the feedback soft, a rare '
                   'gap is due to load of driver, network or this computer'))
    ages = 1e-9 * np.array([one.recorded_ns - one.stamp_ns for one in log.states])
    is_missing = series.faults.arrival_times
    is_simulated = bool(np.median(np.abs(ages)) > SAME_CLOCK)
    checks.add(
        'stamps', not is_missing and bool(
            is_simulated or np.abs(ages).max() < DEFAULT_STATE_MAX_AGE),
        'none' if is_missing else 'of another clock' if is_simulated else (
            f'{1e3 * np.median(ages):.1f} ms old, at most {1e3 * np.abs(ages).max():.1f} ms'),
        f'stamps of this clock, at most {DEFAULT_STATE_MAX_AGE:g} s old',
        'synchronise the clocks, or set state_max_age')
    faults = [text for text in series.faults.words() if not text.startswith(('no stamps', 'left'))]
    checks.add('samples', not faults, '; '.join(faults) or f'{len(series.times)} without a fault',
               'none lost, repeated or out of order', 'look at the network and the driver')
    return timeout, measured


def check_units(series: JointSeries, arm: ArmModel, known: str, checks: Checklist) -> None:
    """Check positions and velocities; `known` is what else shows radians, or ''."""
    q, v, expected = series.position, series.velocity, 'the derivative of the position'
    assert q is not None
    checks[:] = [one for one in checks if one.name not in ('units', 'velocity')]  # of less motion
    has_moved = np.ptp(q, axis=0).max() > MOVED
    beyond = ', '.join(f'{name} {x:.4g}' for name, x, kind in zip(
        arm.joint_names, np.abs(q).max(axis=0), arm.joint_kinds) if (
            kind != 'prismatic' and x > math.tau))
    try:
        if has_moved:
            check_degrees(series)
        plausible(series, arm, True)
        if beyond and not known:
            raise RecordingError(
                f'more than a turn, as in degrees: {beyond} (--unit rad if they are not)')
    except RecordingError as error:
        checks.add('units', BAD, str(error), 'rad, m', 'convert them in the driver')
        return
    is_wrong = np.zeros(arm.joint_count, dtype=bool) if v is None or not has_moved else (
        contradicts_position(series.times, q, v, series.stretches()))
    doubt = '' if known else 'no motion yet' if not has_moved else (
        'no velocity to compare with') if v is None else (
        'the velocity contradicts them' if is_wrong.any() else '')
    checks.add('units', UNKNOWN if doubt else GOOD, f'not known: {doubt}' if doubt else (
        known or 'within the limits, and the velocity is the derivative'),
        'rad, m', 'move the arm by hand, or state --unit rad')
    if v is None:
        checks.add('velocity', False, 'missing, or not one per name', expected,
                   'dynamics differentiates the positions, which is late and noisy')
    elif not has_moved:
        checks.add('velocity', UNKNOWN, 'published, not compared: no motion', expected)
    else:
        names = ', '.join(np.array(arm.joint_names)[is_wrong])
        checks.add('velocity', not names, f'not {expected} at {names}' if names else expected,
                   expected, 'correct the driver, or publish no velocities')


def moving(series: JointSeries, arm: ArmModel) -> str:
    """Return which joints move, and their speed."""
    assert series.position is not None
    blocks = np.array_split(series.position, max(int(series.times[-1] / BLOCK), 2))
    speed = np.abs(np.diff([block.mean(axis=0) for block in blocks], axis=0)).max(axis=0) / BLOCK
    limit = per_joint(REST_SPEED, arm.joint_kinds)
    return ', '.join(f'{name} moves at {v:.2g}' for name, v, most in zip(
        arm.joint_names, speed, limit) if v > most)


def check_noise(series: JointSeries, arm: ArmModel, checks: Checklist) -> None:
    """Check resolution and noise, if the arm rests."""
    q, motion = series.position, moving(series, arm)
    assert q is not None
    steps = [np.diff(np.unique(column)).min(initial=np.inf) for column in q.T]
    listed = [f'position step {min(steps):.1e}' if min(steps) < np.inf else 'position constant']
    listed += [f'{name} deviation {values.std(axis=0).max():.1e}' for name, values in zip(
        FIELDS, (q, series.velocity, series.effort)) if values is not None]
    checks.add('noise', UNKNOWN if motion else GOOD, motion or ', '.join(listed),
               'an arm at rest, small against its motion', 'stop the robot')
