# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the control loop learns from the motion: factors of its gains and of its friction."""

from collections.abc import Sequence

from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.friction_share import FrictionShare
from robot_dynamics.control.gains.oscillation_guard import OscillationGuard
from robot_dynamics.control.laws.control_law import ControlLaw, LawInput
from robot_dynamics.joints.friction import LEAST_WIDTH

LONGEST = 0.05
"""[s] between two states that count at most."""


class Adaptation:
    """The factors that oscillations and run-aways of n joints have caused in one loop."""

    def __init__(self, joint_names: Sequence[str], velocity_limit: FloatArray) -> None:
        self._names = joint_names
        self._guard = OscillationGuard(len(joint_names))
        self._friction = FrictionShare(velocity_limit)
        self.has_notice = False
        """Whether gains or a compensation were lowered since the last `take_notice`."""
        self._stamp_ns = 0

    @property
    def scale(self) -> FloatArray:
        """Factors of the bandwidth of the joints, (n,) in (0, 1]."""
        return self._guard.scale

    def apply(self, law: ControlLaw) -> None:
        """Scale the compensation of friction of a law."""
        law.scale_compensation(self._guard.scale, self._friction.share)

    def take(
        self, state: LawInput, friction: FloatArray | None, law: ControlLaw,
    ) -> bool:
        """
        Take a state along a reference; return whether `scale` has changed.

        `friction` (n,) is the compensation along the reference that the law has applied, None for
        none.
        """
        if state.v is None:
            return False
        now, passed = 1e-9 * state.stamp_ns, 1e-9 * (state.stamp_ns - self._stamp_ns)
        self._stamp_ns = state.stamp_ns
        reference = state.reference
        e, e_dot = state.feedback.position_error(reference.position, state.q), (
            reference.velocity - state.v)
        has_changed = not law.bounces and self._guard.take(
            now, e_dot, max(map(abs, reference.velocity.tolist()), default=0.0))
        if friction is not None and (
                e_dot.dot(e_dot) > self._friction.least**2 or e.dot(e) > LEAST_WIDTH**2):
            ran_away = self._friction.take(
                now, min(max(passed, 0.0), LONGEST), state.dynamics, state.q, e, state.v,
                reference.velocity, state.feedback.gains.ratio * e, friction)
            self.apply(law)
            self.has_notice = self.has_notice or ran_away
        self.has_notice = self.has_notice or has_changed
        return has_changed

    def __str__(self) -> str:
        """Return which joints have oscillated or run away, and their lowered factors."""
        found = []
        for name, scale, frequency, share in zip(
                self._names, self.scale, self._guard.frequency, self._friction.share):
            if scale < 1.0:
                found.append(
                    f'{name!r} oscillated with {frequency:.0f} Hz: its gains are at {scale:.2f} '
                    'of their bandwidth')
            if share < 1.0:
                found.append(
                    f'the friction compensation of {name!r} drove it away: it is at {share:.2f}')
        return '; '.join(found)

    def take_notice(self) -> str:
        """Return `str` if gains or a compensation were lowered since the last call, else ''."""
        has_notice, self.has_notice = self.has_notice, False
        return str(self) if has_notice else ''
