# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The effort of drives that take a position and report none, from command and position.

Such a drive exerts τ = k_p (q_c(t − d) − q) − k_d q̇, with the commanded position q_c and the delay
d from the command to the effort. The first term is used as the effort. The second one is, for an
identification, viscous friction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.joints.parameter_field import per_joint_values
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics_tools.analysis.motion_filter import filter_motion_below
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.messages import stamp_ns
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.tables import TableRecording
from robot_dynamics_tools.recordings.topics import JOINT_STATE

STIFFNESS = 'drive.stiffness'
JOINT_TRAJECTORY, NUMBERS = (
    'trajectory_msgs/msg/JointTrajectory', 'std_msgs/msg/Float64MultiArray')
DELAYS = np.arange(0.0, 0.1, 0.004)
"""Candidates of the delay [s]."""
CUTOFF, LEAST_SPEED = 2.0, 0.05
"""[Hz] of the filter for the delay, and [rad/s] or [m/s] of a motion that shows it.

Above it, the velocity of a position of few bits is noise, which lengthens the delay."""
WIDTHS = 0.01, 0.03, 0.1
"""[rad/s] or [m/s] over which dry friction may change its sign."""


def drive_effort(
    series: JointSeries, sent: JointSeries, arm: ArmModel, stiffness: Any,
) -> tuple[JointSeries, float]:
    """
    Return the series with the effort of position drives, and the delay d [s] of the command.

    `stiffness` k_p is the parameter drive.stiffness [N·m/rad] or [N/m], empty for 1: the effort
    is then the distance. `sent` has the commanded positions. Samples before the first command are
    left out. The delay is that for which the rigid bodies, friction and rotors of each joint, none
    of them negative, explain the effort best; it is 0 for an arm at rest. Raises InvalidInputError
    for a stiffness that is not above 0, RecordingError without positions.
    """
    k_p = per_joint_values(STIFFNESS, stiffness, arm.joint_names, np.ones(arm.joint_count))
    if not (k_p > 0.0).all():
        raise InvalidInputError(f'{STIFFNESS} is {stiffness!r}, expected values above 0')
    stamps_ns, q_c = sent.stamps_ns, sent.position
    series = series.at(np.flatnonzero(series.stamps_ns >= stamps_ns[0]))
    q = series.position
    if q is None or q_c is None or not len(q):
        raise RecordingError('no joint state has a position after the first commanded position')

    def delayed(d: float) -> FloatArray:
        rows = np.searchsorted(stamps_ns, series.stamps_ns - round(1e9 * d), side='right') - 1
        return np.asarray(q_c[np.maximum(rows, 0)])

    delay = _delay(series, arm, [
        (d, replace(series, effort=k_p * (delayed(d) - q)))
        for d in DELAYS.tolist()])
    return replace(series, effort=k_p * (delayed(delay) - q)), delay


def commands(
    recording: Recording | TableRecording, topic: str, joint_names: Sequence[str],
    names: Mapping[str, str] = MappingProxyType({}),
) -> JointSeries:
    """
    Return the commanded positions of joints on a topic; `names` are {recorded: new name}.

    Raises RecordingError without any.
    """
    kind = JOINT_STATE if isinstance(recording, TableRecording) else (
        recording.topic(topic).message_type)
    if isinstance(recording, TableRecording) or kind == JOINT_STATE:
        return recording.joint_states(topic).renamed(names).series(joint_names)
    times, rows = [], []
    for time_ns, message in recording.messages(topic):
        if kind == JOINT_TRAJECTORY and message.points:
            given = [names.get(name, name) for name in message.joint_names]
            values, time_ns = message.points[0].positions, stamp_ns(message.header) or time_ns
        elif kind == NUMBERS:
            given, values = list(joint_names), message.data
        else:
            continue
        if len(values) == len(given) and set(joint_names) <= set(given):
            times.append(time_ns)
            rows.append([values[given.index(name)] for name in joint_names])
    if not rows:
        raise RecordingError(
            f'{topic} ({kind}) has no position of each of the joints {list(joint_names)}, '
            f'expected {JOINT_STATE}, {JOINT_TRAJECTORY} or {NUMBERS} in this order')
    order = np.argsort(times, kind='stable')
    return JointSeries(
        tuple(joint_names), np.array(times, dtype=np.int64)[order],
        np.array(rows, dtype=np.float64)[order], None, None, 0)


def _delay(
    series: JointSeries, arm: ArmModel, candidates: Sequence[tuple[float, JointSeries]],
) -> float:
    """Return the delay whose effort the motion explains best, by its residual at all joints."""
    try:
        motions = [(d, filter_motion_below(each, CUTOFF)) for d, each in candidates]
    except (InvalidInputError, RecordingError):  # too short
        return 0.0
    motion = motions[0][1]
    q, v, a = motion.state(motion.usable)
    if np.abs(v).max(initial=0.0) < LEAST_SPEED:
        return 0.0
    model = RigidBody(arm).inverse_dynamics_batch(q, v, a)
    one, solve = np.ones(len(q)), optional('scipy.optimize', 'the delay of a command').nnls
    loss = np.zeros(len(motions))
    for j in range(arm.joint_count):
        # A delay that is too long acts like less damping and less inertia. Rotors and friction are
        # therefore not negative.
        Q, R = np.linalg.qr(np.column_stack([
            one, -one, v[:, j], *(np.tanh(v[:, j] / width) for width in WIDTHS), a[:, j],
            model[:, j]]))
        for i, (_, each) in enumerate(motions):
            tau = each.measured_effort[motion.usable, j]
            along = Q.T @ tau
            rest = float(tau @ tau - along @ along) + solve(R, along)[1]**2
            loss[i] += np.log(max(rest, 1e-300))
    # delays between two commands are equal
    return float(np.mean(DELAYS[loss <= loss.min() + 1e-9]))
