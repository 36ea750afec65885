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

"""
One run of `safe_motion`: the control loop of `dynamics` without ROS, the plant, the verdicts.

Bounds with velocity noise are wider by the effect of the noise on an ideal loop: a double
integrator with the default gains. Verdicts use the true state of the plant, not the measured one.
"""

from collections import deque
from collections.abc import Callable
import time
from typing import NamedTuple

from benchmarks.safe_motion_cases import (
    arm_named,
    Case,
    LONGEST,
    Motion,
    motion_of,
    NOISE,
    PERIODS,
    POSITION_NOISE,
    PUSH,
)
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_law import make_gains
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.effort_limiter import EffortLimits
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.supervisor import CommandSupervisor, Fault, Mode, SafetyOptions
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

POSITION_MARGIN, FULL_EFFORT_TIME, DEFAULT_EFFORT_RATE = 0.01, 0.1, 1000.0
"""Defaults of `position_margin` and `effort_rate_limit` in `ros/dynamics/parameters`."""
ACTION_PERIOD = 2
"""[ms] between efforts of a fault action, as in `ros/dynamics/command_output`."""
FIRST_STAMP, MS = 1_000_000_000, 1_000_000
"""[ns]"""
STEP = 1e-3
"""[s]"""
HOLDING = 1e6
"""Inertia of a joint that sticks, by the largest inertia of the arm."""
MODE_CHANGES = 20
"""Changes between sliding and sticking in a step, at most."""

SHORTEST, REST = 4.0, 2.0
"""[s] that a run lasts at least, and after the end of its reference."""
LOOK = 100
"""[ms] between two checks whether the reference has ended."""
ENTRY = 0.2
"""[s] after the last message in which a state has answered it."""
AT_GOAL = 1e-3
"""[rad] and [rad/s] within which a reference is at its end."""
JUDGED = 1000
"""[ms] at the end of a run in which oscillation and arrival are judged."""
AMPLITUDE = 0.01
"""Largest peak-to-peak amplitude at the end [rad]."""
OVERSHOOT, OVERSHOOT_FRACTION = 0.01, 0.05
"""Largest overshoot [rad], or share of the step if that is more."""
DISTANCE = 0.02
"""Largest distance of the mean position at the end from the goal [rad]."""
SPEED = 1.01
"""Largest share of a velocity limit."""
HOPELESS = 100.0
"""Share of a velocity limit at which a run is stopped."""


class Margin(NamedTuple):
    """Additional bounds with noise: `amplitude`, `overshoot` [rad], `velocity` [rad/s]."""

    amplitude: float = 0.0
    overshoot: float = 0.0
    velocity: float = 0.0


NO_MARGIN = Margin()
NOISE_MARGINS = {
    500: Margin(0.014, 0.009, 0.23), 250: Margin(0.019, 0.013, 0.32),
    100: Margin(0.032, 0.021, 0.55), 30: Margin(0.070, 0.047, 1.39)}
"""By rate [Hz]: the ideal loop exceeds these in 0.1 % of the seconds, at a delay of 8 ms."""


class ControlLoop:
    """The control path of `dynamics` with its default parameters, without ROS."""

    def __init__(self, arm: ArmModel) -> None:
        limits, effort = arm.limits, arm.limits.effort
        rate = np.where(np.isfinite(effort), effort / FULL_EFFORT_TIME, DEFAULT_EFFORT_RATE)
        self._controller = Controller(arm, ControllerOptions(
            make_gains(arm.joint_names), effort_rate=rate, softens_gains=True,
            conditions_references=True, stops_and_holds=True, estimates_velocity=True))
        self._supervisor = CommandSupervisor(
            arm.joint_names,
            EffortLimits(limits.lower, limits.upper, limits.velocity, POSITION_MARGIN, rate),
            SafetyOptions())
        self._supervisor.activate()
        self._last_stamp: int | None = None
        self._sample: Callable[[], Reference] | None = None
        self._was_interrupted = False
        self.faults: list[str] = []
        """Names of the faults so far."""

    def send(self, trajectory: JointTrajectory, stamp_ns: int = 0) -> None:
        """Follow a trajectory from `stamp_ns` on, 0 for now; in a fault, ignore the trajectory."""
        if self._supervisor.mode is Mode.RUNNING:
            self._controller.follow(trajectory, stamp_ns)

    def answer(self, stamp_ns: int, q: FloatArray, v: FloatArray | None) -> FloatArray | None:
        """Return the effort (n,) for a measured state, or None if the loop publishes none."""
        controller, supervisor = self._controller, self._supervisor
        output = controller.answer(stamp_ns, q, v)
        dt = 1e-9 * (stamp_ns - self._last_stamp) if self._last_stamp is not None else None
        self._last_stamp, self._sample = stamp_ns, output.sample
        if output.command is None:
            raise RuntimeError('the controller has no command, expected one by default')
        fault = Fault('following_error', controller.following_error(output, q)) if (
            output.is_far) else None
        mode = supervisor.mode
        effort = supervisor.answer(
            1e-9 * stamp_ns, q, output.velocity, output.command, output.hold, dt,
            controller.braked, fault)
        self._look_for_faults()
        if mode is Mode.FAULT and supervisor.mode is Mode.RUNNING and self._was_interrupted:
            self._was_interrupted = False
            controller.stop_from_state()
        return effort

    def tick(self, stamp_ns: int) -> FloatArray | None:
        """Return the effort (n,) of a fault action that is due without a state, or None."""
        if not self._supervisor.acts_alone:
            return None
        effort = self._supervisor.tick(1e-9 * stamp_ns)
        self._look_for_faults()
        return effort

    @property
    def reference(self) -> Reference | None:
        """The reference at the last state, or None if no trajectory is followed."""
        return None if self._sample is None else self._sample()

    def _look_for_faults(self) -> None:
        supervisor = self._supervisor
        if supervisor.fault_count > len(self.faults) and supervisor.fault is not None:
            self.faults.append(supervisor.fault.name)
            self._was_interrupted = self._was_interrupted or self._controller.has_reference
            self._controller.forget_reference()
            self._sample = None


class Plant:
    """
    An arm with viscous and Coulomb friction in steps of the semi-implicit Euler method.

    Friction is implicit, so that stiff friction is stable and a joint sticks if Coulomb friction
    can hold it. `ArmSimulation` is the exact solution, but three to nine times slower.
    """

    def __init__(self, arm: ArmModel, q: FloatArray) -> None:
        self._body = UncheckedRigidBody(arm)
        self._viscous, self._coulomb = arm.friction.viscous, arm.friction.coulomb
        self._is_rough = bool(self._viscous.any() or self._coulomb.any())
        self.q, self.v = q.copy(), np.zeros_like(q)

    def step(self, tau: FloatArray, h: float) -> None:
        """Continue by h [s] under the effort tau (n,)."""
        q = self.q + 0.5 * h * self.v
        if self._is_rough:
            v = self._velocity_after(q, tau, h)
        else:
            v = self.v + h * self._body.acceleration(q, self.v, tau)
        self.q, self.v = self.q + 0.5 * h * (self.v + v), v

    def _velocity_after(self, q: FloatArray, tau: FloatArray, h: float) -> FloatArray:
        """Return v with M (v - v_0) = h (tau - C v_0 - g - F_v v) - F, |F| <= h F_c."""
        M = self._body.mass_matrix(q)
        momentum = M @ self.v + h * (tau - self._body.nonlinear(q, self.v))
        A, largest = M + h * np.diag(self._viscous), h * self._coulomb
        holding = HOLDING * A.diagonal().max()
        direction = np.sign(self.v)
        sticks = (direction == 0.0) & (largest > 0.0)
        for _ in range(MODE_CHANGES):
            v = np.linalg.solve(A + holding * np.diag(sticks), momentum - largest * direction)
            breaks = sticks & (np.abs(holding * v) > largest)
            stops = ~sticks & (largest > 0.0) & (v * direction < 0.0)
            if not (breaks.any() or stops.any()):
                break
            direction = np.where(breaks, np.sign(v), np.where(stops, 0.0, direction))
            sticks = (sticks & ~breaks) | stops
        return np.where(sticks, 0.0, v)


class Trace(NamedTuple):
    """Result of a run: the true q and v, (m, n) each, one row per ms; the end of the run."""

    q: FloatArray
    v: FloatArray
    follows: bool
    diverges: bool
    faults: list[str]


def simulate(case: Case) -> Trace:
    """Simulate a case; return the motion of the arm."""
    arm, motion, period = arm_named(case.arm), motion_of(case), PERIODS[case.rate]
    rng, limit = np.random.default_rng(case.seed), arm.limits.effort
    loop, plant = ControlLoop(arm), Plant(arm, motion.start)
    messages, pending = deque(motion.messages), deque[tuple[int, FloatArray]]()
    effort: FloatArray | None = None  # brakes hold the arm until the first effort
    states, end, diverges = [(plant.q, plant.v)], LONGEST, False
    for k in range(round(LONGEST / STEP)):
        t, stamp = STEP * k, FIRST_STAMP + MS * k
        while messages and messages[0].time <= t:
            loop.send(messages.popleft().trajectory)
        answer = None
        if k % period == 0:
            answer = loop.answer(stamp, *_measured(case, plant, rng))
        elif k % ACTION_PERIOD == 0:
            answer = loop.tick(stamp)
        if answer is not None:
            pending.append((k + case.delay, np.minimum(np.maximum(answer, -limit), limit)))
        while pending and pending[0][0] <= k:
            effort = pending.popleft()[1]
        if effort is not None:
            plant.step(effort + _push_at(motion, t), STEP)
        states.append((plant.q, plant.v))
        if k % LOOK == 0:
            diverges = not (np.abs(plant.v) <= HOPELESS * arm.limits.velocity).all()
            if t >= motion.end + ENTRY and end == LONGEST and _has_ended(loop.reference, motion):
                end = max(SHORTEST, t + REST)
        if diverges or t >= end:
            break
    q, v = (np.array(values) for values in zip(*states))
    return Trace(q, v, loop.reference is not None, diverges, loop.faults)


def _measured(
    case: Case, plant: Plant, rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray | None]:
    """Return the measured position and velocity, (n,), with the noise of the case."""
    n = len(plant.q)
    if case.has_velocity:
        return plant.q, plant.v + (rng.normal(0.0, NOISE, n) if case.noisy else 0.0)
    return plant.q + (rng.normal(0.0, POSITION_NOISE, n) if case.noisy else 0.0), None


def _push_at(motion: Motion, t: float) -> FloatArray | float:
    """Return the effort (n,) of the environment at t [s]."""
    push = motion.push
    return push.effort if push is not None and push.begin <= t < push.end else 0.0


def _has_ended(reference: Reference | None, motion: Motion) -> bool:
    return reference is None or bool(
        np.abs(reference.position - motion.goal).max() < AT_GOAL
        and np.abs(reference.velocity).max() < AT_GOAL)


class Outcome(NamedTuple):
    """
    The verdicts on a run, the numbers that they depend on, and its cost.

    `amplitude`, `overshoot` and `distance` [rad]; `velocity_ratio` is the largest |v|/v_max;
    `simulated` and `seconds` [s] of simulated and of wall time. `misses` means that the arm did
    not arrive, or no longer follows the motion. Runs with pushes have no verdict on `misses` and
    on overshoot.
    """

    oscillates: bool
    overshoots: bool
    too_fast: bool
    past_limit: bool
    misses: bool
    amplitude: float
    overshoot: float
    velocity_ratio: float
    distance: float
    faults: str
    simulated: float
    seconds: float

    @property
    def verdicts(self) -> tuple[bool, ...]:
        """Whether the run is bad, for each of `VERDICTS`."""
        return (self.oscillates, self.overshoots, self.too_fast, self.past_limit, self.misses)

    @property
    def is_bad(self) -> bool:
        return any(self.verdicts)


VERDICTS = ('oscillates', 'overshoots', 'too fast', 'past limit', 'no arrival')
Run = tuple[Case, Outcome]


def run(case: Case) -> Run:
    """Simulate and judge a case; add the case to the message of an error of the library."""
    start = time.perf_counter()
    try:
        trace = simulate(case)
    except RobotDynamicsError as error:
        raise RuntimeError(f'{case}: {error}') from error
    return case, judge(case, trace, time.perf_counter() - start)


def judge(case: Case, trace: Trace, seconds: float) -> Outcome:
    """Return the verdicts on the trace of a run."""
    limits, motion = arm_named(case.arm).limits, motion_of(case)
    margin = NOISE_MARGINS[case.rate] if case.noisy else NO_MARGIN
    q, v, last = trace.q, trace.v, trace.q[-JUDGED:]
    way, is_push = motion.goal - motion.start, case.motion == PUSH
    amplitude = float(np.ptp(last, axis=0).max())
    distance = float(np.abs(last.mean(axis=0) - motion.goal).max())
    excess = ((q - motion.goal) * np.sign(way)).max(axis=0)
    allowed = margin.overshoot + np.maximum(OVERSHOOT_FRACTION * np.abs(way), OVERSHOOT)
    judged = v if motion.push is None else v[round(motion.push.end / STEP) + 1:]
    speed = np.abs(judged).max(axis=0)
    return Outcome(
        oscillates=trace.diverges or amplitude > AMPLITUDE + margin.amplitude,
        overshoots=not is_push and bool((excess > allowed).any()),
        too_fast=bool((speed > SPEED * limits.velocity + margin.velocity).any()),
        past_limit=bool(((q > limits.upper) | (q < limits.lower)).any()),
        misses=not is_push and (
            trace.diverges or not trace.follows or distance > DISTANCE),
        amplitude=amplitude, overshoot=float(excess.max()),
        velocity_ratio=float((speed / limits.velocity).max()), distance=distance,
        faults=' '.join(trace.faults), simulated=STEP * (len(q) - 1), seconds=seconds)
