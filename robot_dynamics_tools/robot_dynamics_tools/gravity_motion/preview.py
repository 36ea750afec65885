# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the operator reads before the arm moves."""

from collections.abc import Sequence

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import describe_payloads, Payload
from robot_dynamics_tools.gravity_motion.plan import MotionPlan
from robot_dynamics_tools.gravity_motion.poses import gravity_share
from robot_dynamics_tools.reporting.text_table import text_table

NOT_CHECKED = (
    'Collisions are not checked, neither of the arm with itself nor with its surroundings. '
    'Joints move\ntogether and in a straight line between the poses. Keep people out of the reach '
    'of the arm, and the\nemergency stop at hand. Ctrl-C calls ~/stop: the arm stops and holds '
    'its position.')


def preview(plan: MotionPlan, node: str, weight: Payload | None, outputs: Sequence[object]) -> str:
    """
    Return the tables of poses and gravity torques, and the facts of the motion.

    `outputs` are the directories of the recordings.
    """
    arm, poses = plan.arm, plan.poses
    blocks = [
        f'{node}: {len(poses)} poses of {arm.name}, in this order',
        _table(arm, [
            [f'{value:.3f}' if kind == 'prismatic' else f'{np.degrees(value):.1f}'
             for value, kind in zip(q, arm.joint_kinds)] for q in (plan.start, *poses)],
            ['m' if kind == 'prismatic' else 'deg' for kind in arm.joint_kinds], 'start'),
        'Gravity torque [% of the effort limit]\n' + _share_table(arm, poses, None)]
    if weight is not None:
        blocks.append(
            f'Gravity torque with {describe_payloads([weight])} [% of the effort limit]\n'
            + _share_table(arm, poses, weight))
    return '\n\n'.join([*blocks, text_table([], _facts(plan, weight, outputs)), NOT_CHECKED])


def _facts(plan: MotionPlan, weight: Payload | None, outputs: Sequence[object]) -> list[list[str]]:
    arm = plan.arm
    way = plan.poses[0] - plan.start
    farthest = int(np.argmax(np.abs(way) / plan.velocity))
    passes = 2 if weight is not None else 1
    return [
        ['Sequence', f'each pose is approached from +δ and from −δ, and held {plan.hold:g} s '
                     'each time'],
        ['δ', _extent(arm, plan.approach)],
        ['Largest displacement of a move', _extent(arm, plan.step)],
        ['Largest velocity', _extent(arm, plan.velocity, '/s')],
        ['To the first pose',
         f'up to {_quantity(abs(way[farthest]), arm.joint_kinds[farthest])} at '
         f'{arm.joint_names[farthest]}'],
        ['Expected duration', f'at least {passes * plan.seconds:.0f} s' + (
            ', and the time to attach and to remove the weight' if weight is not None else '')],
        ['Recording', ', '.join(map(str, outputs))]]


def _share_table(arm: ArmModel, poses: FloatArray, weight: Payload | None) -> str:
    share = gravity_share(arm, poses, weight)
    has_limit = np.isfinite(arm.limits.effort)
    return _table(arm, [
        [f'{100.0 * value:.0f}' if limited else 'no limit'
         for value, limited in zip(row, has_limit)] for row in share], ['%'] * arm.joint_count)


def _table(
    arm: ArmModel, rows: Sequence[Sequence[str]], units: Sequence[str], first: str = '',
) -> str:
    labels = [first] if first else []
    labels += [str(i) for i in range(1, len(rows) - len(labels) + 1)]
    return text_table(
        ['pose', *(f'{name} [{unit}]' for name, unit in zip(arm.joint_names, units))],
        [[label, *row] for label, row in zip(labels, rows)], left_columns=1)


def _extent(arm: ArmModel, values: FloatArray, of_time: str = '') -> str:
    """Return the values of the joints: one if they are equal, otherwise by joint."""
    texts = [_quantity(value, kind, of_time) for value, kind in zip(values, arm.joint_kinds)]
    if len(set(texts)) == 1:
        return texts[0]
    return ', '.join(f'{name} {text}' for name, text in zip(arm.joint_names, texts))


def _quantity(value: float, kind: str, of_time: str = '') -> str:
    if kind == 'prismatic':
        return f'{value:.3f} m{of_time}'
    return f'{np.degrees(value):.1f} deg{of_time}'
