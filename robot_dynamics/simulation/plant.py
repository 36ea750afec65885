# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot with the interface of its controller: brakes, efforts, and noisy sensors."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.effort_convention import EffortConvention, measured_from_joint
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.simulation.arm_simulation import ArmState
from robot_dynamics.simulation.command_timeout import CommandTimeout
from robot_dynamics.simulation.drive_loop import DRIVE_PERIOD, DriveLoop


class InnerController:
    """
    The inner controller of a robot, which knows the arm but not its load.

    All arrays are (n,) in the order of `arm.joint_names`.
    """

    def __init__(self, arm: ArmModel, convention: EffortConvention) -> None:
        self.convention = convention
        self.drive, self._report = arm.drive, arm.report
        self.idle_effort = arm.given_drive.offset
        """The commanded effort (n,) at which the drives deliver no torque."""
        gravity = convention.robot_gravity
        self._dynamics = UncheckedArmDynamics(
            arm if gravity is None else arm.with_gravity(gravity))

    def set_gravity(self, gravity: FloatArray) -> None:
        """Use another gravity (3,) [m/s²], unless the robot assumes another one."""
        if self.convention.robot_gravity is None:
            self._dynamics = UncheckedArmDynamics(self._dynamics.arm.with_gravity(gravity))

    def with_own_compensation(
        self, effort: FloatArray, q: FloatArray, v: FloatArray,
    ) -> FloatArray:
        """Return the torque at the joints for a commanded effort at the state (q, v)."""
        if self.convention.compensates_gravity:
            effort = effort + self._dynamics.rigid_body.gravity(q)
        if self.convention.compensates_friction:
            # smooth around rest, where the sign of a measured velocity would chatter
            effort = effort + self._dynamics.friction.smooth_effort(v, effort)
        return effort if self.drive is None else self.drive.torque(effort)

    def measured(
        self, effort: FloatArray, q: FloatArray, v: FloatArray, braked: bool,
    ) -> FloatArray:
        """
        Return the effort that the robot reports while the torque `effort` acts at its joints.

        The result is empty if the robot measures no effort, and zero while the brakes hold the
        arm.
        """
        lacks_gravity = self.convention.lacks_gravity and not braked
        if self._report is not None and not braked:
            effort = self._report.effort(effort)
        gravity = self._dynamics.rigid_body.gravity(q) if lacks_gravity else np.zeros_like(q)
        return measured_from_joint(
            self.convention.measured_effort, effort, v, gravity, self._dynamics.arm.actuators)


class Measured(NamedTuple):
    """Position, velocity and effort (n,), which may be empty; the motors without noise."""

    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    motors: ArmState


class Simulation(Protocol):
    """A simulated arm with brakes: an `ArmSimulation`, or that of another engine."""

    braked: bool
    effort: FloatArray

    @property
    def arm(self) -> Any:
        """Return the arm, with its `joint_names`, `effort_limit` and `gravity`."""

    @property
    def state(self) -> ArmState:
        """Return positions and velocities of the joints."""

    @property
    def motor_state(self) -> ArmState:
        """Return positions and velocities of the motors, divided by the gear ratios."""

    def reset(self) -> None:
        """Return to the start, with engaged brakes."""

    def release(self) -> None:
        """Release the brakes."""

    def brake(self) -> None:
        """Engage the brakes."""

    def set_gravity(self, gravity: FloatArray) -> None:
        """Use another gravity (3,) [m/s²]."""

    def step(
        self, tau: FloatArray, duration: float, wrenches: Sequence[ExternalWrench] = (),
    ) -> ArmState:
        """Return the state after `duration` [s] under the constant effort tau."""

    def wait(self, duration: float, wrenches: Sequence[ExternalWrench] = ()) -> None:
        """Let time pass with engaged brakes."""


class SimulatedRobot:
    """
    The simulated robot with the efforts and wrenches on it. Not for two threads at a time.

    All arrays are (n,) in the order of the joints of its arm.
    """

    def __init__(
        self, simulation: Simulation, robot: InnerController, brakes: bool,
        noise: np.random.Generator,
    ) -> None:
        """Start with engaged brakes, or without brakes; initially without a timeout."""
        self.simulation = simulation
        self.commands = CommandTimeout()
        self.timed_out = False
        """Whether the command timeout has occurred and no effort has arrived since."""
        self._robot = robot
        self.effort = robot.idle_effort
        self.wrenches: dict[str, ExternalWrench] = {}
        self.position_noise = 0.0
        self.velocity_noise = 0.0
        self.effort_noise = 0.0
        self.encoders_at_motor = False
        self.drive_loop: DriveLoop | None = None
        """The position loops of the drives, which take a DriveCommand (3, n), not an effort."""
        self.has_brakes = brakes
        self.effort_limit: FloatArray | None = None
        """Limits (n,) to which the drives clip efforts, may be infinite; None: no clipping."""
        self.reset_count = 0
        """Number of calls of `reset`."""
        self.clipped_count = 0
        """Number of commanded efforts that were clipped at any joint, since the start."""
        self._noise = noise
        if not brakes:
            simulation.release()

    def set_gravity(self, gravity: FloatArray) -> None:
        """Change gravity (3,) in the base frame [m/s²] at once, if it differs."""
        if not np.array_equal(gravity, self.simulation.arm.gravity):
            self.simulation.set_gravity(gravity)
            self._robot.set_gravity(gravity)

    def reset(self) -> None:
        """Return to the initial pose without effort and wrench, as before the first effort."""
        self.reset_count += 1
        self.simulation.reset()
        self.effort = self._robot.idle_effort
        self.wrenches.clear()
        self.commands.reset()
        self.timed_out = False
        if not self.has_brakes:
            self.simulation.release()

    def take_effort(self, effort: FloatArray) -> int | None:
        """
        Apply this effort (n,), clipped to `effort_limit`, and release the brakes.

        Return the joint that exceeds its limit most, None if no joint exceeds it. With a
        `drive_loop`, take its command (3, n): position, velocity and effort.
        """
        joint = None
        if self.drive_loop is None and self.effort_limit is not None:
            excess = np.abs(effort) - self.effort_limit
            if (excess > 0.0).any():
                self.clipped_count, joint = self.clipped_count + 1, int(np.argmax(excess))
                effort = np.clip(effort, -self.effort_limit, self.effort_limit)
        self.effort = effort
        self.commands.receive()
        self.timed_out = False
        self.simulation.release()
        return joint

    def watch_commands(self, passed: float, period: float) -> bool:
        """
        Return whether the command timeout occurs now; if so, hold the arm with the brakes.

        Without brakes, no effort acts on the arm any more. Call this method once per step;
        `passed` [s] is the duration of the step, `period` [s] its nominal duration.
        """
        if not self.commands.end_step(passed, period):
            return False
        self.timed_out = True
        self.effort = self._robot.idle_effort
        if self.has_brakes:
            self.simulation.brake()
        return True

    def step(self, period: float) -> None:
        """Advance the simulation by `period` [s]."""
        wrenches = list(self.wrenches.values())
        if self.simulation.braked:
            self.simulation.wait(period, wrenches)
            return
        drives, steps = self.drive_loop if self.effort.ndim == 2 else None, 1
        if drives is not None:
            steps = max(1, round(period / DRIVE_PERIOD))
        for _ in range(steps):
            q, v = self.simulation.state
            effort = self.effort if drives is None else drives.effort(self.effort, q, v)
            self.simulation.step(
                self._robot.with_own_compensation(effort, q, v), period / steps, wrenches)

    def measure(self) -> Measured:
        """Return the present values of the sensors."""
        simulation = self.simulation
        q, v = simulation.motor_state if self.encoders_at_motor else simulation.state
        effort = self._robot.measured(simulation.effort, q, v, simulation.braked)
        exact = (q, self.position_noise), (v, self.velocity_noise), (effort, self.effort_noise)
        q, v, effort = (
            x + deviation * self._noise.standard_normal(len(x)) if deviation > 0.0 else x
            for x, deviation in exact)
        return Measured(q, v, effort, simulation.motor_state)
