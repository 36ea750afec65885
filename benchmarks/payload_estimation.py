# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`calibrate_gravity`, then `~/estimate_payload`, on `dynamics` and `simulated_arm` in lock-step.

The drives of the simulated arm have torque constants that are wrong by up to 30 %, and offsets.
Its friction differs from that of the model by up to 30 %, and its measured efforts have noise.
First the arm holds poses without and with a known weight: they determine scale and offset of the
efforts. The nodes then start again with the calibrated parameter file. Each case is a load of up
to 5 kg that only the simulated arm has, at standstill (poses approached from both directions) or
in motion; the controller compensates gravity without the load, and the arm sags.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import os
from pathlib import Path
import sys
import tempfile
import time
from typing import NamedTuple

from benchmarks.hidden_drives import (
    calibrate,
    Calibrated,
    HiddenArm,
    holds,
    LINKS,
    position_range,
    sag_of,
    Session,
    SETTLING,
)
import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics_interfaces.srv import EstimatePayload
from robot_dynamics_tools.gravity_calibration import find_holds
from robot_dynamics_tools.gravity_calibration.report import joint_verdicts

KINDS = ('standstill', 'motion')
ARMS, LOADS = 3, 9
"""Arms of each name, each with other drives and friction, and loads per arm and kind."""
LARGEST_MASS = 5.0
LARGEST_SHARE = 0.6
"""Largest share of what the drives can do that a motion needs with the load."""
POSES, SIDE, APPROACH, HOLD = 6, 0.2, 1.5, 2.5
"""Poses, distance of their approach [rad], durations [s] of the approach and of a hold."""
SECONDS, STEP = 40.0, 0.1
"""Duration of a motion, and the interval between its points [s]."""
LARGEST_SAG = 0.3
"""Largest distance [rad] of the arm from the end of its motion."""
NORMAL = 1.96


class Drives(NamedTuple):
    """
    Errors of a calibration: of scales, and of offsets relative to the effort limits.

    `is_good` marks the joints with this verdict, `ratio` are all known errors in deviations, and
    `sag` is the largest distance [rad] from a pose at rest, before and after the calibration.
    """

    arm: str
    scale: FloatArray
    offset: FloatArray
    is_good: BoolArray
    ratio: FloatArray
    sag: tuple[float, float]


class Result(NamedTuple):
    """The truth and the estimate of m, mx, my, mz, deviations and verdicts (4,)."""

    arm: str
    kind: str
    truth: FloatArray
    values: FloatArray
    deviations: FloatArray
    is_observable: BoolArray

    @property
    def errors(self) -> FloatArray:
        return self.values - self.truth


def main() -> None:
    """Print accuracy and coverage of the calibrations, then of the loads."""
    start, drives, results = time.monotonic(), list[Drives](), list[Result]()
    arms = [(name, seed) for seed in range(ARMS) for name in LINKS]
    # two at once: in lock-step, one node waits for the other
    with ProcessPoolExecutor(2, get_context('spawn'), _use_own_domain) as pool:
        for (name, seed), (one, more) in zip(arms, pool.map(_with_arm, *zip(*arms))):
            drives.append(one)
            results += more
            print(f'{time.monotonic() - start:.0f} s: {name} {seed}', file=sys.stderr)
    print(f'{len(drives)} calibrations, {len(results)} loads of 0 to {LARGEST_MASS:g} kg in '
          f'{time.monotonic() - start:.0f} s of wall time')
    print('| arm | calibrations | good joints | largest error of a good scale | of an offset | '
          'in 95 % intervals | sag before [mrad] | after |')
    print('| --- | --: | --: | --: | --: | --: | --: | --: |')
    for name in (*LINKS, ''):
        print(_drive_row(name or 'all', [one for one in drives if name in ('', one.arm)]))
    print('\n| arm | motion | loads | mean error of m [g] | m in 2 % or 20 g | '
          'm c in 1 cm × m | of the observable | observable | in 95 % intervals |')
    print('| --- | --- | --: | --: | --: | --: | --: | --: | --: |')
    for name in (*LINKS, ''):
        for kind in KINDS:
            print(_row(name or 'all', kind, [
                one for one in results if name in ('', one.arm) and one.kind == kind],
                ARMS * LOADS * (1 if name else len(LINKS))))
    print(_row('all', 'both', results, len(arms) * LOADS * len(KINDS)))


def _use_own_domain() -> None:
    os.environ['ROS_DOMAIN_ID'] = str(os.getpid() % 100 + 1)


def _drive_row(name: str, found: Sequence[Drives]) -> str:
    scale = np.concatenate([one.scale[one.is_good] for one in found])
    offset = np.concatenate([one.offset[one.is_good] for one in found])
    inside = np.abs(np.concatenate([one.ratio for one in found])) <= NORMAL
    before, after = zip(*(one.sag for one in found))
    return (f'| {name} | {len(found)} | {len(scale)} of {sum(len(one.scale) for one in found)} | '
            f'{np.abs(scale).max(initial=0.0):.2%} | {np.abs(offset).max(initial=0.0):.2%} | '
            f'{inside.mean():.1%} of {len(inside)} | {1e3 * min(before):.1f} to '
            f'{1e3 * max(before):.1f} | {1e3 * min(after):.1f} to {1e3 * max(after):.1f} |')


def _row(name: str, kind: str, results: Sequence[Result], count: int) -> str:
    if not results:
        return f'| {name} | {kind} | 0 of {count} |'
    error = np.array([one.errors for one in results])
    mass = np.array([one.truth[0] for one in results])
    known = np.array([one.is_observable for one in results]).all(axis=1)
    ratio = np.array([one.errors / one.deviations for one in results])
    is_near = np.abs(error[:, 0]) <= np.maximum(0.02 * mass, 0.02)
    is_central = ((np.abs(error[:, 1:]) <= 0.01 * mass[:, None])
                  | ~np.isfinite(ratio[:, 1:])).all(axis=1)
    inside = np.abs(ratio) <= NORMAL
    has_effect = np.isfinite(np.array([one.deviations for one in results]))
    return (f'| {name} | {kind} | {len(results)} of {count} | {1e3 * error[:, 0].mean():+.0f} | '
            f'{is_near.sum()} | {is_central.sum()} | {is_central[known].sum()} of {known.sum()} | '
            f'{known.mean():.0%} | {inside[has_effect].mean():.1%} of {has_effect.sum()} |')


def _with_arm(name: str, seed: int) -> tuple[Drives, list[Result]]:
    """Return the errors of the calibration of one arm, and the estimates of its loads."""
    hidden, results = HiddenArm(name, seed), list[Result]()
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        found = calibrate(hidden, directory)
        with hidden.nodes(directory, found.file) as session:
            trajectory = holds(hidden.arm, found.poses, SIDE, APPROACH, HOLD)
            session.move_to(trajectory.points[0].position)
            after = sag_of(
                find_holds(session.follow(trajectory), hidden.arm.joint_kinds), found.poses)
            try:
                for _ in range(LOADS):
                    for kind in KINDS:
                        results.append(_estimated(session, hidden, kind))
            except RuntimeError as error:  # the arm fell; its further loads are not estimated
                print(error, file=sys.stderr)
    return _drives(hidden, found, after), results


def _drives(hidden: HiddenArm, found: Calibrated, after: float) -> Drives:
    one = found.calibration
    scale, offset = one.scale - hidden.scale, one.offset - hidden.offset
    deviations = np.sqrt(np.diag(one.covariance))
    is_known = np.isfinite([*one.scale_interval, *one.offset_interval])
    return Drives(
        hidden.name, scale / hidden.scale, offset / hidden.arm.limits.effort,
        np.array([verdict.grade is Grade.GOOD for verdict in joint_verdicts(one)]),
        (np.concatenate([scale, offset]) / deviations)[is_known], (found.sag, after))


def _estimated(session: Session, hidden: HiddenArm, kind: str) -> Result:
    load = _load(hidden)
    dynamics = ArmDynamics(hidden.arm.with_drive(hidden.drive).with_payloads([load]))
    trajectory = (_holds if kind == KINDS[0] else _motion)(hidden, dynamics)
    session.set_parameter(
        'dynamics', 'friction_compensation', 'none' if kind == KINDS[0] else 'reference')
    session.set_payload('simulated_arm', make_payload(load.link, 0.0))
    session.move_to(trajectory.points[0].position)
    session.set_payload('simulated_arm', load)
    session.wait(SETTLING)
    session.call(EstimatePayload, 'dynamics_monitor/estimate_payload', EstimatePayload.Request(
        start=True, link=load.link))
    session.follow(trajectory)
    distance = float(np.abs(session.position() - trajectory.points[-1].position).max())
    if distance > LARGEST_SAG:
        raise RuntimeError(f'{hidden.name}: {distance:.2f} rad from the last point, expected at '
                           f'most {LARGEST_SAG:g} rad')
    answer = session.call(
        EstimatePayload, 'dynamics_monitor/estimate_payload', EstimatePayload.Request(stop=True))
    least = 0.9 * trajectory.duration
    if answer.duration < least:
        raise RuntimeError(
            f'{hidden.name}: {answer.duration:.1f} s estimated, expected {least:.1f} s')
    result = Result(
        hidden.name, kind, load.body.toDynamicParameters()[:4], np.array(answer.values[:4]),
        np.array(answer.deviations[:4]),
        np.array([one in ('observable', 'no effect') for one in answer.verdicts[:4]]))
    print(f'{hidden.name} {kind}: {load.mass:.3f} kg, errors {result.errors.round(4).tolist()}, '
          f'in deviations {(result.errors / result.deviations).round(2).tolist()}',
          file=sys.stderr)
    return result


def _load(hidden: HiddenArm) -> Payload:
    """Return a box of up to LARGEST_MASS; in the plane of the motion of the default arm."""
    rng = hidden.rng
    mass, half, com = rng.uniform(0.0, LARGEST_MASS), rng.uniform(0.03, 0.1, 3), (
        rng.uniform(-0.1, 0.1, 3))
    if hidden.name == 'default':
        com[1] = 0.0
    inertia = mass / 3.0 * np.diag(half @ half - half**2)
    return make_payload(LINKS[hidden.name], mass, com, inertia)


def _holds(hidden: HiddenArm, dynamics: ArmDynamics) -> JointTrajectory:
    """Return holds of poses that the drives can reach and hold."""
    poses = list[FloatArray]()
    while len(poses) < POSES:
        tried = np.array([*poses, _pose(hidden, dynamics)])
        trajectory = holds(hidden.arm, tried, SIDE, APPROACH, HOLD)
        if _can_follow(dynamics, trajectory):
            poses = list(tried)
    return holds(hidden.arm, np.array(poses), SIDE, APPROACH, HOLD)


def _motion(hidden: HiddenArm, dynamics: ArmDynamics) -> JointTrajectory:
    """Return sines from a pose towards the middle of the range, that begin and end at rest."""
    arm, rng = hidden.arm, hidden.rng
    low, high = position_range(arm)
    t = np.arange(round(SECONDS / STEP) + 1) * STEP
    largest = 0.3
    while True:
        pose = _pose(hidden, dynamics)
        turns = rng.integers(8, 17, (2, arm.joint_count))  # per SECONDS
        rate = 2.0 * np.pi * turns[:, None, :] / SECONDS
        phase = rate * t[:, None]
        inwards = np.where(pose < 0.5 * (low + high), 1.0, -1.0)
        size = largest * rng.uniform(0.5, 1.0, (2, 1, arm.joint_count)) * inwards
        trajectory = make_trajectory(
            arm.joint_names, (t + 0.5).tolist(), pose + (size * (1.0 - np.cos(phase))).sum(axis=0),
            (size * rate * np.sin(phase)).sum(axis=0), (), arm.joint_names)
        if _can_follow(dynamics, trajectory):
            return trajectory
        largest = max(0.98 * largest, 0.1)


def _pose(hidden: HiddenArm, dynamics: ArmDynamics) -> FloatArray:
    """Return a pose (n,) that the drives can hold."""
    low, high = position_range(hidden.arm)
    most = LARGEST_SHARE * dynamics.arm.limits.effort
    while True:
        pose = hidden.rng.uniform(low, high)
        if (np.abs(dynamics.rigid_body.gravity(pose)) <= most).all():
            return np.asarray(pose)


def _can_follow(dynamics: ArmDynamics, trajectory: JointTrajectory) -> bool:
    """Return whether the drives can do a motion, with a reserve for the control law."""
    return efforts_along(dynamics, trajectory).worst_ratio <= LARGEST_SHARE
