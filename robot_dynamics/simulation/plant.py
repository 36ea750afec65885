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

"""A simulated robot as its controller meets it: brakes, efforts that act, and noisy sensors."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.effort_convention import EffortConvention, measured_from_joint
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.simulation.arm_simulation import ArmSimulation, ArmState
from robot_dynamics.simulation.command_timeout import CommandTimeout


class InnerController:
    """
    The inner controller of a robot that knows its arm, but no load on it.

    All arrays are (n,) in the order of `arm.joint_names`.
    """

    def __init__(self, arm: ArmModel, semantics: EffortConvention) -> None:
        self.semantics = semantics
        self._dynamics = UncheckedArmDynamics(arm)

    def with_own_compensation(
        self, effort: FloatArray, q: FloatArray, v: FloatArray,
    ) -> FloatArray:
        """Return the effort at the joints of one that was commanded, at the state (q, v)."""
        if self.semantics.compensates_gravity:
            effort = effort + self._dynamics.rigid_body.gravity(q)
        if self.semantics.compensates_friction:
            # smooth around rest, as the sign of a measured velocity would chatter there
            effort = effort + self._dynamics.friction_effort(v, effort, smooth=True)
        return effort

    def measured(
        self, effort: FloatArray, q: FloatArray, v: FloatArray, braked: bool,
    ) -> FloatArray:
        """
        Return what the robot reports while `effort` acts at its joints; empty for none.

        While brakes carry the arm it reports zeros, whatever it measures.
        """
        lacks_gravity = self.semantics.lacks_gravity and not braked
        gravity = self._dynamics.rigid_body.gravity(q) if lacks_gravity else np.zeros_like(q)
        return measured_from_joint(
            self.semantics.measured_effort, effort, v, gravity, self._dynamics.arm.actuators)


class Measured(NamedTuple):
    """Position, velocity and effort (n,), the latter empty for none; the motors as they are."""

    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    motors: ArmState


class Plant:
    """
    The simulated robot with what acts on it. Not for two threads at a time.

    All arrays are (n,) in the order of the joints of its arm.
    """

    def __init__(
        self, simulation: ArmSimulation, robot: InnerController, brakes: bool,
        noise: np.random.Generator,
    ) -> None:
        """Start on the brakes, or without any; with no timeout yet."""
        self.simulation = simulation
        self.commands = CommandTimeout()
        self.timed_out = False
        """Whether efforts have failed to come for too long, until the next one."""
        self._robot = robot
        self.effort: FloatArray = np.zeros(simulation.arm.joint_count)
        self.wrenches: dict[str, ExternalWrench] = {}
        self.position_noise = 0.0
        self.velocity_noise = 0.0
        self.effort_noise = 0.0
        self.encoders_at_motor = False
        self.has_brakes = brakes
        self.effort_limit: FloatArray | None = None
        """Limits (n,) to which the drives clip efforts, infinite for none; None: no clipping."""
        self.clipped_count = 0
        """Commanded efforts that were clipped at one joint or more, since the start."""
        self._noise = noise
        if not brakes:
            simulation.release()

    def reset(self) -> None:
        """Back to the initial pose, without an effort or a wrench, as before the first effort."""
        self.simulation.reset()
        self.effort = np.zeros_like(self.effort)
        self.wrenches.clear()
        self.commands.reset()
        self.timed_out = False
        if not self.has_brakes:
            self.simulation.release()

    def take_effort(self, effort: FloatArray) -> int | None:
        """
        Apply this effort (n,), clipped to `effort_limit`, and release the brakes.

        Return the joint that exceeds its limit most, None if no joint exceeds it.
        """
        joint, self.effort = self._clip(effort)
        self.commands.receive()
        self.timed_out = False
        self.simulation.release()
        return joint

    def _clip(self, effort: FloatArray) -> tuple[int | None, FloatArray]:
        limit = self.effort_limit
        if limit is None:
            return None, effort
        excess = np.abs(effort) - limit
        joint = int(np.argmax(excess))
        if not excess[joint] > 0.0:
            return None, effort
        self.clipped_count += 1
        return joint, np.clip(effort, -limit, limit)

    def watch_commands(self, passed: float, period: float) -> bool:
        """
        Return whether just now efforts have failed to come for too long, and then hold the arm.

        Without brakes no effort acts on it any more. To be called once for each step that took
        `passed` and should take `period` [s].
        """
        if not self.commands.end_step(passed, period):
            return False
        self.timed_out = True
        self.effort = np.zeros_like(self.effort)
        if self.has_brakes:
            self.simulation.brake()
        return True

    def step(self, period: float) -> None:
        """Move on by `period` [s]."""
        effort = self._robot.with_own_compensation(self.effort, *self.simulation.state)
        self.simulation.step(effort, period, list(self.wrenches.values()))

    def measure(self) -> Measured:
        """Return what the sensors say now."""
        simulation = self.simulation
        q, v = simulation.motor_state if self.encoders_at_motor else simulation.state
        n = len(q)
        effort = self._robot.measured(simulation.effort, q, v, simulation.braked)
        if self.position_noise > 0.0:
            q = q + self.position_noise * self._noise.standard_normal(n)
        if self.velocity_noise > 0.0:
            v = v + self.velocity_noise * self._noise.standard_normal(n)
        if self.effort_noise > 0.0:
            effort = effort + self.effort_noise * self._noise.standard_normal(len(effort))
        return Measured(q, v, effort, simulation.motor_state)
