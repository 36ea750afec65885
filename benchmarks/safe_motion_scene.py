# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The simulation of a run of `safe_motion`: the plant, the loop of `dynamics`, and who uses it.

A disturbance (`safe_motion_disturbances`) changes the attributes of the scene.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from benchmarks.feed_forward import drives_of
from benchmarks.safe_motion_cases import (
    BEGIN,
    Case,
    FEED_FORWARD,
    LONGEST,
    Motion,
    NOISE,
    PERIODS,
    POSITION_NOISE,
    PUSH,
    PUSH_END,
)
from benchmarks.safe_motion_hand import FADING, Hand, HAND_GUIDING
from benchmarks.safe_motion_hull import Hull, stop_path
from benchmarks.safe_motion_plant import Plant
import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.feed_forward import FeedForward
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.motion_limits import MotionLimits, WorkspaceInertia
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

ACTION_PERIOD, SLACK = 0.002, 1e-4
"""[s] between ticks of a fault action, and after a deadline; see `ros/dynamics/command_output`."""
FIRST_STAMP, MS, STEP = 1_000_000_000, 1_000_000, 1e-3
"""[ns], [ns] and [s]"""

SHORTEST, REST = 4.0, 2.0
"""[s] that a run lasts at least, and after the end of its reference."""
SETTLING, FROZEN_SETTLING = 4.0, 8.0
"""[s] that a run lasts at least after its disturbance began, or a joint was found frozen."""
RAMP_SLACK = 0.1
"""[s] by which a ramp to zero may take longer than the ramp time."""
FIRST_STATES = 2
"""States from which the loop takes the velocity, with which a reference starts."""
FROZEN = 'frozen_joint'
"""Name of the fault."""
LOOK = 100
"""[ms] between two checks whether the reference has ended."""
ENTRY = 0.2
"""[s] after the last message in which a state has answered it."""
AT_GOAL = 1e-3
"""[rad] and [rad/s] within which a reference is at its end."""
HOPELESS = 100.0
"""Share of a velocity limit at which a run is stopped."""
LONGEST_PERIOD = 0.04
"""[s]: longest period of a stream, of which the states show the times."""
LATEST_IN_PUSH = PUSH_END + 0.3
"""[s]: latest begin of a disturbance of a run with a push."""


class Trace(NamedTuple):
    """
    Result of a run: the true q and v, (m, n) each, one row per ms, and what the loop has done.

    `is_judged` (m,) is false during a push and after the end of the command.
    """

    q: FloatArray
    v: FloatArray
    is_judged: BoolArray
    follows: bool
    diverges: bool
    faults: list[str]
    hull_excess: float
    doubt: str
    interruption: str


class Scene:
    """One run: the arm, its loop, the messages to it, and the conditions that may change."""

    def __init__(
        self, case: Case, arm: ArmModel, motion: Motion, disturb: Callable[['Scene'], None] | None,
        at_once: bool = False,
    ) -> None:
        """Call `disturb` once, at a random time of the motion, or before the first state."""
        self.case, self.arm, self.motion = case, arm, motion
        has_drives = case.command == FEED_FORWARD
        self.drives = drives_of(arm, motion.start, np.inf) if has_drives else None
        self.loop = ControlLoop.of_arm(
            arm, command='computed_torque' if has_drives else case.command,
            drive_stiffness=None if self.drives is None else self.drives.stiffness)
        self._feed_forward = FeedForward(self.loop)
        self.plant = Plant(arm, motion.start)
        self.rng = np.random.default_rng((case.seed, 1))
        """For the disturbance."""
        self._noise = np.random.default_rng(case.seed)
        self._disturb, self._at_once = disturb, at_once
        share = self.rng.uniform()
        self._begin_share = share**2 * (3.0 - 2.0 * share)
        self._begin_time = BEGIN + share * (max(LATEST_IN_PUSH, motion.end) - BEGIN)
        self.time = 0.0
        self.messages = deque(motion.messages)
        self._actions: list[tuple[float, Callable[[], None]]] = []
        self.period = self.longest_period = PERIODS[case.rate]
        self.next_state = 0
        """[ms]"""
        self.measured: Callable[[FloatArray, FloatArray | None], tuple[
            FloatArray, FloatArray | None]] = lambda q, v: (q, v)
        """Returns the measured state."""
        self.push = motion.push
        self.hand = Hand(arm) if case.command == HAND_GUIDING else None
        self.effort: FloatArray | None = None
        """The effort that acts; None: brakes hold the arm."""
        self.goal: FloatArray | None = motion.goal
        """Goal (n,) of the motion, None if it need not arrive."""
        self.quiet_after = motion.end
        """[s] after which no message changes the motion."""
        self.begun = 0.0
        """Time of the disturbance [s]."""
        self.has_unknown_load = False
        self.start_speed = np.zeros_like(motion.start)
        """Velocity (n,) of the arm when the loop starts."""
        self.velocities_are_true = True
        self.has_signal: BoolArray = np.ones(len(motion.start), dtype=bool)
        """Whether the sample of each joint (n,) changes with its motion."""
        self.rejection = ''
        """Reason why the last trajectory that the loop does not follow was rejected."""
        self.ramp_speed, self.end_time = 0.0, 0.0
        """Largest velocity when the ramp to zero began, and its end [s] after the request."""
        self.hull, self._excess = Hull(motion.start), 0.0
        self._limits: tuple[WorkspaceInertia, MotionLimits] | None = None
        self._active: ActiveTrajectory | None = None
        self._unknown = 0
        """Number of states until the velocity is known from which a reference starts."""
        self._faults, self._doubt = list[str](), ''
        self._is_pushed = False
        self._tick_due, self._mode = 0.0, self.loop.supervisor.mode

    # ------------------------------------------------------------------ for disturbances

    def later(self, delay: float, action: Callable[[], None]) -> None:
        """Call an action in `delay` [s]."""
        self._actions.append((self.time + delay, action))
        self._actions.sort(key=lambda each: each[0])

    def set_period(self, period: int) -> None:
        """Receive the next states with this period [ms]."""
        self.next_state += period - self.period
        self.period, self.longest_period = period, max(period, self.longest_period)

    @property
    def limits(self) -> MotionLimits:
        """The limits of the references."""
        controller = self.loop.controller
        workspace = controller.load.workspace
        if self._limits is None or workspace is not self._limits[0]:
            self._limits = workspace, workspace.motion_limits(
                controller.options.effort_limit_fraction * self.arm.limits.effort,
                np.asarray(controller.options.effort_rate))
        return self._limits[1]

    @property
    def state(self) -> Reference:
        """The state of the reference, or the last measured one without a reference."""
        _, q, v = self.loop.controller.state or (0, self.plant.q, self.plant.v)
        return self.loop.reference or Reference(q, v, np.zeros_like(q))

    def send(self, trajectory: JointTrajectory) -> bool:
        """Send a trajectory to the loop; return whether the loop follows it."""
        if self.hand is not None:
            self.hand.follow(trajectory, self.time, self.plant.q)
            return True
        before = self.state
        try:
            self.loop.follow(trajectory)
        except TrajectoryError as error:
            self.rejection = str(error)
            return False
        hull, limits, points = self.hull, self.limits, trajectory.points
        active = self.loop.controller.trajectory
        if active is not None and active is self._active:
            return True  # the same set-point again: the arm continues on its path
        self._active, self._unknown = active, 0
        hull.begin(before, limits)
        hull.include(*(point.position for point in points))
        q, v = points[-1].position, points[-1].velocity
        if v is not None:
            bounds = self.arm.limits
            T = self.loop.controller.options.stream_timeout
            # The acceleration of the target is at most that of the limits.
            hull.include(q - LONGEST_PERIOD * v)  # the target, before its first set-point
            for a in (-limits.acceleration, 0.0 * v, limits.acceleration):
                target = Reference(q + (v + 0.5 * a * T) * T, v + a * T, a)
                for path in stop_path(target, limits):
                    hull.include(np.clip(path, bounds.lower, bounds.upper))
        return True

    def run(self) -> Trace:
        """Simulate the run; return the motion of the arm."""
        limit, delay = self.arm.limits.effort, self.case.delay
        plant, pending = self.plant, deque[tuple[int, FloatArray]]()
        last, states, judged, diverges = LONGEST, [(plant.q, plant.v)], [True], False
        for k in range(round(LONGEST / STEP)):
            self.time = STEP * k
            if self._disturb is not None and self._is_due():
                self.begun, disturb, self._disturb = self.time, self._disturb, None
                disturb(self)
            while self._actions and self._actions[0][0] <= self.time:
                self._actions.pop(0)[1]()
            while self.messages and self.messages[0].time <= self.time:
                self.send(self.messages.popleft().trajectory)
            effort = None
            if k >= self.next_state:
                effort, self.next_state = self._answer(k), k + self.period
            elif self.time >= self._tick_due:
                effort = self._tick()
            if effort is not None:
                if self.drives is None:
                    effort = np.minimum(np.maximum(effort, -limit), limit)
                pending.append((k + delay, effort))
            while pending and pending[0][0] <= k:
                self.effort = pending.popleft()[1]
            if self._has_released() and not pending and self.effort is not None and (
                    self.drives is None):  # drives hold the last command
                self.effort, plant.v = None, np.zeros_like(plant.v)
                if self._mode is Mode.FAULT:  # the arm has fallen during the ramp
                    ramp = self.loop.supervisor.options.ramp_time + RAMP_SLACK
                    fallen = min(round(ramp / STEP), len(judged))
                    judged[-fallen:] = [False] * fallen
            push = self.push if self.push is not None and (
                self.push.begin <= self.time < self.push.end) else None
            if self.effort is not None:
                effort = self.effort if self.effort.ndim == 1 or self.drives is None else (
                    self.drives.effort(self.effort, plant.q, plant.v))
                others = np.zeros_like(effort) if push is None else push.effort
                if self.hand is not None:
                    others = others + self.hand.effort(self.time, plant)
                plant.step(effort + others, STEP)
            states.append((plant.q, plant.v))
            self._is_pushed = push is not None
            judged.append(push is None and not self._has_released() and (
                self._mode not in (Mode.STOPPING, Mode.INACTIVE)))
            if k % LOOK == 0:
                diverges = not (np.abs(plant.v) <= HOPELESS * self.arm.limits.velocity).all()
                if self._disturb is not None or not self._has_ended():
                    last = LONGEST  # also if the next set-point has begun another motion
                elif last == LONGEST:
                    rest = REST if self.hand is None else REST + FADING
                    last = max(SHORTEST, self.time + rest, self.begun + SETTLING)
            if diverges or self.time >= max(last, self.quiet_after):
                break
        q, v = (np.array(values) for values in zip(*states))
        return Trace(
            q, v, np.array(judged), self.loop.reference is not None, diverges, self._faults,
            self._excess, self._doubt, self.loop.goals.interruption)

    def _is_due(self) -> bool:
        """Return whether the disturbance begins."""
        reference, way = self.loop.reference, self.motion.goal - self.motion.start
        if self._at_once:
            return True
        if self.case.motion == PUSH or self.hand is not None:
            return self.time >= self._begin_time
        if reference is None:
            return False
        moves = np.abs(way) > AT_GOAL
        covered = np.abs(reference.position - self.motion.start)[moves] / np.abs(way[moves])
        return bool(covered.max(initial=1.0 - moves.any()) >= self._begin_share) and (
            self.time > BEGIN)

    def _has_released(self) -> bool:
        """Return whether the loop no longer publishes efforts, so that brakes hold the arm."""
        supervisor = self.loop.supervisor
        return supervisor.limiter.last is None and self._mode in (Mode.FAULT, Mode.INACTIVE)

    def _answer(self, k: int) -> FloatArray | None:
        """Return the effort for a state."""
        case, n = self.case, len(self.plant.q)
        noise = case.noisy * self._noise.normal(
            0.0, NOISE if case.has_velocity else POSITION_NOISE, n)
        q, v = self.measured(self.plant.q, self.plant.v + noise) if case.has_velocity else (
            self.measured(self.plant.q + noise, None))
        before, interruption = self.loop.reference, self.loop.goals.interruption
        limits = self.limits
        try:
            answer = self.loop.answer(FIRST_STAMP + MS * k, q, v)
        except ImplausibleStateError:
            return None
        self._follow_loop()
        reference = self.loop.reference
        if reference is not None:
            if answer.verdict.restart or before is None:
                self._unknown = FIRST_STATES
            if self._unknown > 0:
                self._unknown -= 1
                self._active = None
                self.hull.begin(reference, limits)
            elif self.loop.goals.interruption not in ('', interruption):  # a stop has begun
                assert before is not None
                self._active = None
                self.hull.begin(before, limits)
            self._excess = max(self._excess, self.hull.excess(reference.position))
        if not self._doubt:
            self._doubt = ' '.join(
                name for name, is_doubtful in zip(
                    self.arm.joint_names, self.loop.gate.doubtful) if is_doubtful)
        if self.drives is None:
            return answer.effort
        command = self._feed_forward.command(answer)
        return None if command is None else np.array(command)

    def _tick(self) -> FloatArray | None:
        """Do what the watchdog does; return the effort that is due."""
        effort = self.loop.tick(FIRST_STAMP * 1e-9 + self.time)
        supervisor = self.loop.supervisor
        self._follow_loop()
        self._tick_due = self.time + (
            ACTION_PERIOD if supervisor.acts_alone else supervisor.options.state_timeout)
        if supervisor.mode in (Mode.RUNNING, Mode.BRAKING):
            self._tick_due = max(supervisor.deadline - FIRST_STAMP * 1e-9, self.time) + SLACK
        return effort if self.drives is None else None

    def _follow_loop(self) -> None:
        """Note faults and changes of the mode."""
        supervisor = self.loop.supervisor
        if supervisor.fault_count > len(self._faults) and supervisor.fault is not None:
            self._faults.append(supervisor.fault.name)
            if supervisor.fault.name == FROZEN:
                self.quiet_after = max(self.quiet_after, self.time + FROZEN_SETTLING)
        mode, self._mode = self._mode, supervisor.mode
        if mode is not self._mode and self._mode in (Mode.STOPPING, Mode.INACTIVE):
            if mode is not Mode.STOPPING and not self._is_pushed:
                self.ramp_speed = float(np.abs(self.plant.v).max())
            self.end_time = self.time - self.begun
        if supervisor.acts_alone:
            self._tick_due = min(self._tick_due, self.time + ACTION_PERIOD)

    def _has_ended(self) -> bool:
        """Return whether the reference is at its end."""
        if self.time < self.quiet_after + ENTRY or self._actions or (
                self.hand is not None and not self.hand.has_ended(self.time, self.plant.v)):
            return False
        reference = self.loop.reference
        if reference is None:
            return True
        return bool(np.abs(reference.velocity).max() < AT_GOAL) and (
            self.goal is None or bool(self.loop.goals.interruption)
            or bool(np.abs(reference.position - self.goal).max() < AT_GOAL))
