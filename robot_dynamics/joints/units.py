# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Units of the quantities of a joint, as messages, tables and figures print them."""

from typing import NamedTuple


class JointUnits(NamedTuple):
    """Units of a joint; `error` is 1e-3 of `position`, for tracking errors."""

    position: str
    effort: str
    error: str

    def error_text(self, error: float) -> str:
        """Return a tracking error [rad] or [m] as text."""
        return f'{1e3 * error:.3g} {self.error}'


ROTARY, LINEAR = JointUnits('rad', 'N·m', 'mrad'), JointUnits('m', 'N', 'mm')


def units_of(kind: str) -> JointUnits:
    """Return the units of a joint of this kind, as `ArmModel.joint_kinds` has it."""
    return LINEAR if kind == 'prismatic' else ROTARY
