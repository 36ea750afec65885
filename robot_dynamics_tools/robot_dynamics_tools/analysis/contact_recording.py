# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Contact levels from a recording without contact, and their parameter file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_convention import joint_from_measured
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.contact_learning import learn_contact_levels, LearnedLevels
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.yaml_output import dump_yaml

DEFAULT_BANDWIDTH = 10.0
"""[Hz] of the momentum observer."""
_DIGITS = 4


def levels_from_bags(
    bags: Sequence[Path], settings: AnalysisSettings, alarms_per_hour: float,
) -> tuple[LearnedLevels, tuple[str, ...]]:
    """
    Return the levels from recordings together, and the joints.

    Raises InvalidInputError if a joint of the arm, velocity or effort is missing, or if the
    recordings are too short; RecordingError and ModelError.
    """
    found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    offset = 0.0
    bandwidth = float(settings.parameters.get('external_effort_bandwidth', DEFAULT_BANDWIDTH))
    joints = arm_from_urdf(settings.urdf, settings.parameters.get('joints') or ()).joint_names
    for bag in bags:
        read = read_for_arm(bag, settings)
        missing = [name for name in joints if name not in read.arm.joint_names]
        if missing:
            raise InvalidInputError(f'recording {str(bag)!r} lacks the joints {missing}')
        t, v, r = external_efforts(read.arm, read.series, settings, bandwidth)
        found.append((t + offset, v, r))
        offset += 10.0 + float(t[-1] if len(t) else 0.0)
    t, v, r = (np.concatenate(each) for each in zip(*found))
    return learn_contact_levels(t, v, r, joints, alarms_per_hour), joints


def external_efforts(
    arm: ArmModel, series: JointSeries, settings: AnalysisSettings, bandwidth: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """
    Return times (m,) [s], velocities and external efforts (m, n) of recorded joint states.

    The first 5 time constants of the observer after each gap are left out.
    """
    for name in ('position', 'velocity', 'effort'):
        if getattr(series, name) is None:
            raise InvalidInputError(f'the recording has no {name}, expected joint states with '
                                    'position, velocity and effort')
    q, v, measured = (np.asarray(each) for each in (
        series.position, series.velocity, series.effort))
    convention = convention_from_parameters(settings.parameters)
    dynamics = ArmDynamics(arm)
    observer, body = ExternalEffort(dynamics, bandwidth), dynamics.unchecked.rigid_body
    rows, estimates = [], []
    for stretch in series.stretches():
        observer.restart()
        times = series.times[stretch]
        for i, t, dt in zip(stretch, times - times[0], np.diff(times, prepend=times[0])):
            effort = arm.given_report.torque(joint_from_measured(
                convention.measured_effort, measured[i], v[i], body.gravity(q[i]),
                arm.actuators))
            r = observer.update(float(dt), q[i], v[i], effort)
            if r is not None and t >= 5.0 / observer.gain:
                rows.append(int(i))
                estimates.append(r)
    return series.times[rows], v[rows], np.array(estimates).reshape(-1, arm.joint_count)


def parameter_text(found: LearnedLevels, joints: Sequence[str], alarms_per_hour: float) -> str:
    """Return the parameter file of the levels for `dynamics_node`."""
    def rounded(values: FloatArray) -> list[float]:
        return [float(f'{value:.{_DIGITS}g}') for value in values]

    return dump_yaml({'/**/dynamics': {'ros__parameters': {
        'joints': list(joints), 'contact': {
            'effort': rounded(found.levels.effort),
            'effort_per_velocity': rounded(found.levels.per_velocity)}}}}, (
        f'Contact levels for at most {alarms_per_hour:g} false alarms per hour, learned from '
        f'{found.duration:.0f} s without contact.',
        'The levels are extrapolated beyond this motion. No safety function.'), 'a parameter file')
