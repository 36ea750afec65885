# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The passive part: the efforts that the robot reports at rest, in a few poses."""

from collections.abc import Sequence
import time

import numpy as np
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.worst_gravity import QUICK, worst_gravity
from robot_dynamics_tools.connect.checks import BAD, Checklist, Settings, UNKNOWN
from robot_dynamics_tools.connect.states import StateLog
from robot_dynamics_tools.gravity_calibration.holds import by_pose, find_holds, Hold, per_joint
from robot_dynamics_tools.gravity_calibration.reported_gravity import (
    ABSENT,
    explanations,
    is_scale,
    NOISE,
)
from robot_dynamics_tools.recordings.sample_faults import counted
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient

DISTINCT = 0.2, 0.05
"""[rad], [m]: a pose differs by at least this at some joint."""
LOOK_PERIOD = 1.0
"""[s] between two searches for poses."""
INSTRUCTION = (
    'Move the arm by hand or with its own controller through {poses} that differ, and hold '
    'each for 2 s\nwithout touching it. Ends after {poses}, or after {seconds:g} s.')


def watch_poses(
    client: DynamicsClient, log: StateLog, arm: ArmModel, count: int, seconds: float,
) -> list[Hold]:
    """Return the holds while the operator moves the arm, until it has held `count` poses."""
    print(INSTRUCTION.format(poses=counted(count, 'pose'), seconds=seconds), flush=True)
    end = time.monotonic() + seconds
    holds, reached = list[Hold](), 0
    with Progress(count, 'poses') as progress:
        while reached < count and time.monotonic() < end:
            client.wait(lambda: False, LOOK_PERIOD)
            holds = find_holds(log.series(arm), arm.joint_kinds)
            reached = len(by_pose(holds, per_joint(DISTINCT, arm.joint_kinds)))
            progress.update(reached)
    return holds


def check_report(
    arm: ArmModel, holds: Sequence[Hold], may_tilt: bool, checks: Checklist,
) -> Settings:
    """
    Check the efforts at the holds against g(q); return the settings that they show.

    The report scale and offset of `arm` apply to the efforts. The holds of a pose count as one.
    """
    # dry friction has the sign of the last motion: holds of one pose may have one error
    poses = by_pose(holds, per_joint(DISTINCT, arm.joint_kinds))
    q, effort = (np.array([np.mean([getattr(holds[h], name) for h in pose], axis=0)
                           for pose in poses]) for name in ('position', 'effort'))
    names, where = arm.joint_names, counted(len(q), 'pose')
    if not holds:
        checks.add('report', UNKNOWN, 'no pose was held', 'effort is g(q)', 'hold each for 2 s')
        return {}
    if (np.abs(effort) < NOISE * arm.limits.effort).all():
        checks.add('report', UNKNOWN, 'nothing at all joints', 'effort is g(q)', (
            'brakes carry the arm: release them while its own controller holds it; or the report '
            'excludes gravity: measured_effort is joint_torque_without_gravity, or none'))
        return {}
    found = explanations(arm, q, arm.given_report.torque(effort), may_tilt)
    best = found[0]
    said = list(dict.fromkeys(one.words(names) for one in found))
    if len(said) > 1:
        is_right = any(not one.is_wrong.any() and not one.angle[0] for one in found)
        checks.add('report', UNKNOWN if is_right else BAD, f'{" or ".join(said)}, at {where}',
                   'effort is g(q)', 'hold more poses, or state the mount: --gravity X Y Z')
        return {}
    checks.add('mount', not best.angle[0], f'{best.words(()) if best.angle[0] else "as assumed"}, '
               f'at {where}', 'the base as in gravity', 'gravity is written to the file')
    settings: Settings = {} if not best.angle[0] else {'gravity': (
        best.gravity.round(3).tolist(),
        f'measured at {where}: tilt ± {np.degrees(2.0 * best.angle[1]):.1f}°')}
    worst = worst_gravity(arm.with_gravity(best.gravity), QUICK)
    scale, shown, strange = arm.given_report.scale.copy(), list[str](), list[str]()
    for j, name in enumerate(names):
        value, error = float(best.ratio[j]), 2.0 * best.deviation[j]
        if not best.is_observable[j]:
            most = worst.effort[j]
            pose = ', '.join(f'{x:.2f}' for x in worst.position[j])
            checks.add(f'report of {name}', UNKNOWN, 'bears too little gravity to tell',
                       '1.00 g(q)', f'hold ({pose}), where it bears {most:.2g}' if (
                           most > best.least[j]) else 'no pose shows it: a motion has to')
            continue
        text, is_wrong = f'{value:.2f} ± {error:.2f} g(q)', bool(best.is_wrong[j])
        checks.add(f'report of {name}', not is_wrong, text, '1.00 g(q)', _remedy(value))
        shown.append(f'{name} {text}')
        if is_wrong and is_scale(value):
            scale[j] = round(scale[j] / value, 3)
        elif is_wrong:
            strange.append(shown[-1])
    if (scale != arm.given_report.scale).any():
        settings['effort.report_scale'] = scale.tolist(), (
            f'measured at {where}, as before if right or not shown: {", ".join(shown)}')
    settings['measured_effort'] = ('none', (
        f'no unit of torque, or without gravity: {", ".join(strange)}')) if strange else (
        'joint_torque', f'measured at {where}: {", ".join(shown) or "no joint shows it"}')
    return settings


def _remedy(ratio: float) -> str:
    if abs(ratio) < ABSENT:
        return ('brakes carry the arm, or the report excludes gravity: set measured_effort to '
                'none or joint_torque_without_gravity')
    if not is_scale(ratio):
        return 'another unit, such as mA: set measured_effort to none, or to motor_current'
    return f'effort.report_scale times {1.0 / ratio:.3g} is written to the file'
