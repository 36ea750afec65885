# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Gradual replacement of payloads, so that efforts do not step."""

from collections.abc import Sequence
from dataclasses import replace

from robot_dynamics.model.payload import merged, Payload


class PayloadTransition:
    """
    Fade the old loads out and the new ones in, linearly in mass and inertia.

    Each load keeps its pose. Efforts are linear in mass and inertia, so they change linearly from
    the old to the new ones, and every intermediate load is physically consistent. The transition
    begins at the first stamp that is passed to `payloads`.
    """

    def __init__(
        self, old: Sequence[Payload], target: Sequence[Payload], transition_time: float,
    ) -> None:
        """Take the active loads, the loads to reach and the duration of the transition [s]."""
        self.target = tuple(target)
        self._old = merged(old)  # otherwise interrupted transitions would accumulate loads
        self._duration = transition_time
        self._start_ns: int | None = None
        self.done = False

    def payloads(self, stamp_ns: int) -> list[Payload]:
        """Return the loads that are active at a stamp; sets `done` at the end."""
        if self._start_ns is None:
            self._start_ns = stamp_ns
        s = min(max(1e-9 * (stamp_ns - self._start_ns) / self._duration, 0.0), 1.0)
        self.done = s == 1.0
        if self.done:
            return list(self.target)
        return [*(scaled(load, 1.0 - s) for load in self._old),
                *(scaled(load, s) for load in self.target)]


def scaled(payload: Payload, fraction: float) -> Payload:
    """Return a payload with this fraction of the mass and inertia, at the same pose."""
    return replace(payload, mass=fraction * payload.mass, inertia=fraction * payload.inertia)
