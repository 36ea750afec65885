# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The external effort on an arm, estimated from its measured motion and effort.

`momentum_observer` contains the filter. This module computes its inputs from the model:
p = M(q) q̇ and τ + Cᵀ q̇ − g − τ_f at each measured state. Between two states, Cᵀ q̇ − g − τ_f is
interpolated linearly. τ is constant, equal to the effort measured at the later state, because
drives hold their effort between two commands.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.effort_convention import EffortConvention, joint_from_measured
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.monitoring.momentum_observer import MomentumObserver


def joint_effort(
    arm: ArmModel, convention: EffortConvention, measured: FloatArray, v: FloatArray,
    robot_gravity: FloatArray,
) -> FloatArray:
    """Return the joint effort (n,) for an effort (n,) that the robot or the drives report."""
    effort = joint_from_measured(
        convention.measured_effort, measured, v, robot_gravity, arm.actuators)
    return effort if arm.report is None else arm.report.torque(effort)


class _Known(NamedTuple):
    """A state (q, v) with its p and Cᵀ q̇ − g, each (n,)."""

    q: FloatArray
    v: FloatArray
    momentum: FloatArray
    drift: FloatArray


class ExternalEffort:
    """
    Estimates Jᵀ f, the joint efforts (n,) of all external wrenches f together.

    The sign is that of an actuator effort: an external effort is positive if it accelerates the
    joint in its positive direction. The estimate includes loads and friction that the model lacks.
    """

    def __init__(self, dynamics: ArmDynamics, bandwidth: float) -> None:
        """Filter with a bandwidth of K / 2π [Hz] > 0; raise InvalidInputError."""
        self._observer = MomentumObserver(dynamics.arm.joint_count, bandwidth)
        self._dynamics = dynamics.unchecked
        self._before: _Known | None = None
        self._acceleration = MomentumObserver(dynamics.arm.joint_count, bandwidth)

    def set_bandwidth(self, bandwidth: float) -> None:
        """Continue with another bandwidth [Hz]."""
        self._observer.set_bandwidth(bandwidth)
        self._acceleration.set_bandwidth(bandwidth)

    @property
    def gain(self) -> float:
        """The gain K [1/s] of the observer, the inverse of its time constant."""
        return self._observer.gain

    @property
    def estimate(self) -> FloatArray:
        """The newest estimate (n,) [N·m] or [N]."""
        return self._observer.estimate

    @property
    def noise_bandwidth(self) -> float:
        """The equivalent noise bandwidth of the observer [Hz]."""
        return 0.25 * self.gain

    @property
    def state(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """
        Position, velocity and acceleration (n,) of the newest state, None before it.

        The acceleration is the difference of the velocities through the filter of the observer; it
        is 0 if the arm has no uncertainty, which alone needs it.
        """
        before = self._before
        return None if before is None else (before.q, before.v, self._acceleration.estimate)

    def restart(self) -> None:
        """Reset the estimate to 0; the next state is a first one."""
        self._observer.restart()
        self._acceleration.restart()
        self._before = None

    def set_dynamics(self, dynamics: ArmDynamics) -> None:
        """
        Continue with another model of the same joints, for example with an attached load.

        The momentum of the previous state is recomputed with the new model, so that the change of
        the model does not cause a step of the estimate.
        """
        self._dynamics = dynamics.unchecked
        if self._before is not None:
            self._before = self._at(self._before.q, self._before.v)

    def update(
        self, dt: float, q: FloatArray, v: FloatArray, effort: FloatArray,
    ) -> FloatArray | None:
        """
        Return the estimate (n,) at a state dt [s] after the previous one; None at the first state.

        `effort` (n,) [N·m] or [N] is measured, on the joint side of the gearbox.
        """
        before, now = self._before, self._at(q, v)
        self._before = now
        if before is None:
            return None
        if self._dynamics.arm.uncertainty is not None:
            self._acceleration.update(v - before.v, np.zeros_like(v), dt)
        passed = self._dynamics.load_behind(np.array((before.v, v)), effort).mean(axis=0)
        return self._observer.update(
            now.momentum - before.momentum,
            dt * (passed + 0.5 * (before.drift + now.drift)), dt)

    def _at(self, q: FloatArray, v: FloatArray) -> _Known:
        body = self._dynamics.rigid_body
        C = body.coriolis_matrix(q, v)
        return _Known(q, v, body.mass_matrix(q) @ v, v @ C - body.gravity(q))
