# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The joint states of a robot as they arrive: rate, stamps, units, resolution, noise."""

from collections.abc import Iterator
from contextlib import contextmanager
import time

import numpy as np
from rclpy.qos import qos_profile_sensor_data
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics_tools.analysis.arm_recording import check_degrees, plausible
from robot_dynamics_tools.analysis.velocity_check import contradicts_position
from robot_dynamics_tools.connect.checklist import BAD, Checklist, GOOD, UNKNOWN
from robot_dynamics_tools.gravity_calibration.holds import BLOCK, per_joint, REST_SPEED
from robot_dynamics_tools.recordings.joint_series import JointSeries, RecordedJointStates
from robot_dynamics_tools.recordings.messages import FIELDS, RecordedState
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from sensor_msgs.msg import JointState

STATE_TIMEOUT = 0.05
"""[s], the default of the parameter `state_timeout`."""
GAPS = 3.0
"""The timeout by the longest gap between two joint states."""
STATE_MAX_AGE = 0.2
"""[s], the default of the parameter `state_max_age`."""


class StateLog:
    """The joint states of a topic since the start of `receiving`."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._times: list[int] = []
        self._states: list[RecordedState] = []

    @contextmanager
    def receiving(self, client: DynamicsClient) -> Iterator[None]:
        """Receive in `with`."""
        with client.subscribed((JointState, self.topic, self._take, qos_profile_sensor_data)):
            yield

    def _take(self, message: JointState) -> None:
        values = {name: np.array(getattr(message, name)) for name in FIELDS}
        self._states.append(RecordedState(
            len(self._times), tuple(message.name), stamp_from_ros(message.header.stamp),
            {name: column for name, column in values.items()
             if len(column) == len(message.name) > 0}))
        self._times.append(time.time_ns())

    def __len__(self) -> int:
        return len(self._times)

    @property
    def states(self) -> RecordedJointStates:
        return RecordedJointStates(
            self.topic, np.array(self._times, dtype=np.int64), tuple(self._states), 0)

    def series(self, arm: ArmModel) -> JointSeries:
        """Return the samples of an arm; raise RecordingError."""
        return self.states.series(arm.joint_names).unwrapped(arm.is_continuous)

    @property
    def ages(self) -> FloatArray:
        """Time of arrival minus stamp (m,) [s]."""
        return 1e-9 * np.array([
            now - state.stamp_ns for now, state in zip(self._times, self._states)], dtype=float)


def check_states(log: StateLog, arm: ArmModel, checks: Checklist) -> float:
    """Check the joint states; return the `state_timeout` [s] that they need."""
    series = log.series(arm)
    periods = np.diff(series.times)
    longest = float(periods.max(initial=0.0))
    timeout = max(STATE_TIMEOUT, float(np.ceil(100.0 * GAPS * longest) / 100.0))
    checks.add(
        'rate', timeout == STATE_TIMEOUT, f'{1.0 / np.median(periods):.0f} Hz, longest gap '
        f'{1e3 * longest:.1f} ms, jitter {1e3 * periods.std():.2f} ms', 'gaps below 17 ms',
        f'state_timeout is {timeout:g} s; feedback at this rate is soft')
    ages = log.ages
    is_simulated = bool(np.median(np.abs(ages)) > 3600.0)
    checks.add(
        'stamps', not series.faults.arrival_times and (
            is_simulated or bool(np.abs(ages).max() < STATE_MAX_AGE)),
        'none' if series.faults.arrival_times else 'of another clock' if is_simulated else (
            f'{1e3 * np.median(ages):.1f} ms old, at most {1e3 * np.abs(ages).max():.1f} ms'),
        f'stamps of this clock, at most {STATE_MAX_AGE:g} s old',
        'synchronise the clocks, or set state_max_age')
    faults = [text for text in series.faults.words() if not text.startswith(('no stamps', 'left'))]
    checks.add('samples', not faults, '; '.join(faults) or f'{len(series.times)} without a fault',
               'none lost, repeated or out of order', 'look at the network and the driver')
    return timeout


def check_units(series: JointSeries, arm: ArmModel, checks: Checklist) -> None:
    """Check positions and velocities by their size, and against each other."""
    for check in (lambda: check_degrees(series), lambda: plausible(series, arm, True)):
        try:
            check()
        except RecordingError as error:
            checks.add('units', BAD, str(error), 'rad, m', 'convert them in the driver')
            return
    checks.add('units', GOOD, 'within the limits of the joints', 'rad, m')
    assert series.position is not None
    if series.velocity is None:
        checks.add('velocity', False, 'missing', 'one per joint',
                   'dynamics differentiates the positions')
        return
    is_wrong = contradicts_position(
        series.times, series.position, series.velocity, series.stretches())
    names = ', '.join(np.array(arm.joint_names)[is_wrong])
    moved = np.ptp(series.position, axis=0).max() > 0.01
    checks.add('velocity', not is_wrong.any() if moved else GOOD, (
        f'not the derivative of the position at {names}' if names and moved else
        'the derivative of the position' if moved else 'published, not compared: no motion'),
        'the derivative of the position', 'correct the driver, or publish no velocities')


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
    if motion:
        checks.add('noise', UNKNOWN, motion, 'an arm at rest', 'stop the robot')
        return
    steps = [np.diff(np.unique(column)) for column in q.T]
    listed = [f'position step {min((s.min() for s in steps if len(s)), default=0.0):.1e}, '
              f'deviation {q.std(axis=0).max():.1e}']
    for name, values in (('velocity', series.velocity), ('effort', series.effort)):
        if values is not None:
            listed.append(f'{name} deviation {values.std(axis=0).max():.1e}')
    checks.add('noise', GOOD, ', '.join(listed), 'small against the motion, SI units')
