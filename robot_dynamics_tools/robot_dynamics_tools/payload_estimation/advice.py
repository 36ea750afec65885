# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The smallest motion that makes a parameter observable, from the information matrix.

The information of a candidate is added to the present information: of a hold, if necessary
approached from both directions, or of a motion with a sinusoidal acceleration of one joint.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.regressor import COUNT, LoadRegressor, NAMES
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody
from robot_dynamics.model.worst_gravity import sample_positions
from robot_dynamics_tools.estimation.effort_fit import inverse_of

TURNS = np.radians([15.0, 30.0, 45.0, 60.0, 90.0, 120.0, 150.0, 180.0])
"""Candidate displacements of a joint [rad]."""
SLIDES = np.array([0.05, 0.1, 0.2, 0.3, 0.5])
"""Candidate displacements of a prismatic joint [m]."""
POSES = 60
"""Number of candidate poses of the whole arm."""
MOST_HOLDS = 6
"""Largest number of holds in an advice."""
ACCELERATIONS = (1.0, 2.0, 5.0, 10.0, 20.0)
"""Candidate amplitudes [rad/s²] or [m/s²]."""
SECONDS, FREQUENCY = 10.0, 1.0
"""Duration [s] and frequency [Hz] of a candidate motion."""
KINDS_OF_HOLD = (('single', ''), ('paired', ', approached from both directions'))
_INERTIA = 4


@dataclass(frozen=True, eq=False)
class Knowledge:
    """
    The present state of an estimation.

    `values` (10,) and `information` (10, 10) of the parameters, `limit` (10,) of the deviations,
    `position` (n,) of the arm, `variances` (n,) of observations by their kind, `block` of motion
    [s].
    """

    values: FloatArray
    information: FloatArray
    limit: FloatArray
    position: FloatArray
    variances: Mapping[str, FloatArray]
    block: float

    def suffices(self, parameter: int, gain: FloatArray) -> bool:
        """Return whether a parameter is observable with this further information (10, 10)."""
        return bool(self.deviation(parameter, gain) <= self.limit[parameter])

    def deviation(self, parameter: int, gain: FloatArray) -> float:
        """Return the deviation of a parameter with this further information (10, 10)."""
        covariance = inverse_of(self.information + gain)
        return float(np.sqrt(covariance[parameter, parameter]))


def advise(
    arm: ArmModel, link: str, missing: Sequence[int], knowledge: Knowledge,
) -> tuple[str, ...]:
    """Return a sentence for each parameter of π that is not observable."""
    adviser = _Adviser(arm, link, knowledge)
    sentences: dict[str, list[str]] = {}
    for i in missing:
        sentence = adviser.hold(i) if i < _INERTIA else adviser.motion(i)
        sentences.setdefault(sentence, []).append(NAMES[i])
    return tuple(f'{", ".join(names)}: {text}' for text, names in sentences.items())


class _Adviser:
    def __init__(self, arm: ArmModel, link: str, knowledge: Knowledge) -> None:
        self._arm, self._knowledge = arm, knowledge
        self._regressor, self._body = LoadRegressor(arm, link), UncheckedRigidBody(arm)
        moves = [one for one in sorted(self._single_joint(), key=lambda one: abs(one[1]))
                 if self._is_held(one[2][None])[0]]
        self._moves = [(joint, change) for joint, change, _ in moves]
        self._positions = np.array([knowledge.position, *(position for *_, position in moves)])
        poses = sample_positions(arm, POSES)
        is_held = self._is_held(poses)
        self._poses = poses[is_held] if is_held.any() else poses
        both = np.concatenate([self._positions, self._poses])
        zero = np.zeros_like(both)
        self._static = self._regressor(both, zero, zero)

    def hold(self, parameter: int) -> str:
        """Return the smallest motion of one joint, or else the fewest poses, to hold."""
        suffices, count = self._knowledge.suffices, len(self._positions)
        for kind, addition in KINDS_OF_HOLD:
            present, *gains = self._static_gain(kind)[:count]
            if suffices(parameter, present):
                return 'hold the present pose once more' + addition
            for (joint, change), position, gain in zip(self._moves, self._positions[1:], gains):
                if suffices(parameter, gain):
                    return self._turn_text(joint, change, position[joint]) + addition
        for kind, addition in KINDS_OF_HOLD:
            chosen = self._poses_to_hold(parameter, self._static_gain(kind)[count:])
            if len(chosen) < MOST_HOLDS:
                return self._poses_text(chosen) + addition
        return self._poses_text(chosen) + addition + ', several times'

    def _turn_text(self, joint: int, change: float, target: float) -> str:
        name, unit = self._arm.joint_names[joint], self._unit(joint)
        size = np.degrees(change) if unit == '°' else change
        return f'move {name!r} by {size:+.3g} {unit} (to {target:.3g}) and hold the pose'

    def _poses_text(self, poses: Sequence[int]) -> str:
        texts = ', '.join(
            '(' + ', '.join(f'{value:.2f}' for value in self._poses[i].tolist()) + ')'
            for i in dict.fromkeys(poses))
        return f'hold the poses {texts} of {list(self._arm.joint_names)}'

    def motion(self, parameter: int) -> str:
        """Return the joints to accelerate, and the smallest amplitude, within the limits."""
        largest = ''
        for amplitude in ACCELERATIONS:
            gains = self._dynamic_gains(amplitude)
            for joint, gain in gains.items():
                if self._knowledge.suffices(parameter, gain):
                    return self._motion_text([joint], amplitude)
            best = sorted(gains, key=lambda j: self._knowledge.deviation(parameter, gains[j]))
            for count in range(2, len(best) + 1):
                total = np.sum([gains[j] for j in best[:count]], axis=0)
                if self._knowledge.suffices(parameter, total):
                    return self._motion_text(best[:count], amplitude)
            if best:
                largest = self._motion_text(best, amplitude) + ', and longer; '
        return largest + 'follow a trajectory of `excite`'

    def _motion_text(self, joints: Sequence[int], amplitude: float) -> str:
        names = ', '.join(repr(self._arm.joint_names[j]) for j in sorted(joints))
        return (f'accelerate {names} with an amplitude of {amplitude:g} rad/s² (m/s²) at '
                f'{FREQUENCY:g} Hz for {SECONDS:g} s' + (' each' if len(joints) > 1 else ''))

    def _poses_to_hold(self, parameter: int, gains: FloatArray) -> list[int]:
        """Return the poses that reduce the deviation most, MOST_HOLDS if they do not suffice."""
        gain = np.zeros((COUNT, COUNT))
        chosen: list[int] = []
        while len(chosen) < MOST_HOLDS and not self._knowledge.suffices(parameter, gain):
            deviations = [self._knowledge.deviation(parameter, gain + one) for one in gains]
            chosen.append(int(np.argmin(deviations)))
            gain = gain + gains[chosen[-1]]
        return chosen

    def _single_joint(self) -> Iterator[tuple[int, float, FloatArray]]:
        """Yield joint, displacement and position of poses within the limits."""
        limits, start = self._arm.limits, self._knowledge.position
        for joint in range(self._arm.joint_count):
            for size in SLIDES if self._unit(joint) == 'm' else TURNS:
                for change in (size, -size):
                    position = start.copy()
                    position[joint] += change
                    if limits.lower[joint] <= position[joint] <= limits.upper[joint]:
                        yield joint, float(change), position

    def _unit(self, joint: int) -> str:
        return 'm' if self._arm.joint_kinds[joint] == 'prismatic' else '°'

    def _static_gain(self, kind: str) -> FloatArray:
        """Return the information (m, 10, 10) of holds."""
        Y = self._static
        return np.asarray(np.einsum(
            'mji,mjk,j->mik', Y, Y, 1.0 / self._knowledge.variances[kind], optimize=True))

    def _dynamic_gains(self, amplitude: float) -> dict[int, FloatArray]:
        """Return the information (10, 10) of the motion of each joint that its limits permit."""
        motions = {joint: self._sine(joint, amplitude) for joint in range(self._arm.joint_count)}
        return {joint: self._dynamic_gain(*motion) for joint, motion in motions.items()
                if self._is_possible(*motion)}

    def _is_possible(self, q: FloatArray, v: FloatArray, a: FloatArray) -> bool:
        limits, start = self._arm.limits, self._knowledge.position
        moves = q != start  # the present position may be at a limit
        return bool(
            ((limits.lower <= q) & (q <= limits.upper) | ~moves).all()
            and (np.abs(v) <= limits.velocity).all()
            and self._is_within_effort(q, v, a).all())

    def _is_held(self, q: FloatArray) -> BoolArray:
        """Return whether the arm can hold positions (m, n) with the estimated load, (m,)."""
        zero = np.zeros_like(q)
        return self._is_within_effort(q, zero, zero)

    def _is_within_effort(self, q: FloatArray, v: FloatArray, a: FloatArray) -> BoolArray:
        limit = self._arm.limits.effort
        effort = self._body.inverse_dynamics_batch(q, v, a) + (
            self._regressor(q, v, a) @ self._knowledge.values)
        return np.asarray((np.abs(effort) <= np.where(limit > 0.0, limit, np.inf)).all(axis=1))

    def _sine(self, joint: int, amplitude: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a sinusoidal motion (m, n) of one joint around the present position."""
        omega, phase = 2.0 * np.pi * FREQUENCY, np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
        q, v, a = np.zeros((3, len(phase), self._arm.joint_count))
        q[:] = self._knowledge.position
        q[:, joint] -= amplitude / omega**2 * np.cos(phase)
        v[:, joint] = amplitude / omega * np.sin(phase)
        a[:, joint] = amplitude * np.cos(phase)
        return q, v, a

    def _dynamic_gain(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        Y = self._regressor(q, v, a)
        blocks = SECONDS / self._knowledge.block / len(q)
        return np.asarray(blocks * np.einsum(
            'mji,mjk,j->ik', Y, Y, 1.0 / self._knowledge.variances['motion']))
