# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What the check of the measured effort found, and what it means in words."""

from dataclasses import dataclass

from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.effort_convention import EffortConvention


@dataclass(frozen=True, eq=False)
class GravityVerdict:
    """
    What a static hold told: the share k, that which was expected, and the efforts behind it.

    `measured` (on the joint side), `command` (zeros for none) and `gravity` are (n,) [N·m] or
    [N], medians over the window; `used` (n,) tells which joints decided.
    """

    ratio: float
    expected: float
    tolerance: float
    measured: FloatArray
    command: FloatArray
    gravity: FloatArray
    used: BoolArray

    @property
    def excess(self) -> float:
        """Return by how much of gravity more is carried than expected."""
        return self.ratio - self.expected

    @property
    def agrees(self) -> bool:
        return abs(self.excess) <= self.tolerance


def verdict_in_words(
    verdict: GravityVerdict, joint_names: tuple[str, ...], semantics: EffortConvention,
) -> str:
    """Return one line with the numbers, what they mean, and which parameter says so."""
    comparison = (
        f'in a static hold the measured effort exceeds the command by {verdict.ratio:.2f} times '
        f'g(q), expected {verdict.expected:.0f} (within {verdict.tolerance:.2f}) from '
        f'measured_effort {semantics.measured_effort!r} and robot_compensates '
        f'{list(semantics.robot_compensates)}')
    if verdict.agrees:
        return comparison
    numbers = '; '.join(
        f'{name}: measured {measured:.3f}, command {command:.3f}, g(q) {gravity:.3f}'
        + ('' if used else ' (not used)')
        for name, measured, command, gravity, used in zip(
            joint_names, verdict.measured.tolist(), verdict.command.tolist(),
            verdict.gravity.tolist(), verdict.used.tolist()))
    return f'{comparison}. {numbers}. {_advice(verdict, semantics)}'


def _advice(verdict: GravityVerdict, semantics: EffortConvention) -> str:
    reasons = []
    if verdict.excess > 0.0:
        if not semantics.compensates_gravity:
            reasons.append(
                'the robot compensates gravity by itself, or another controller holds it, and '
                'gravity would be compensated twice: set robot_compensates: [gravity], or keep '
                'command: none')
        if semantics.lacks_gravity:
            reasons.append(
                'the measured effort contains gravity: set measured_effort: joint_torque')
    else:
        if not semantics.lacks_gravity:
            reasons.append(
                'gravity is not in the measured effort: set measured_effort: '
                'joint_torque_without_gravity')
            reasons.append(
                'brakes carry the arm, or the effort is not measured at all: open them, or set '
                'measured_effort: none')
        if semantics.compensates_gravity:
            reasons.append(
                'the robot does not compensate gravity: take it out of robot_compensates')
    reasons.append('load, URDF or measured_effort do not describe this robot')
    return 'Either ' + '; or '.join(reasons)
