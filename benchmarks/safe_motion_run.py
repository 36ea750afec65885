# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One run of `safe_motion`, and the verdicts on it.

Bounds with velocity noise are wider by the effect of the noise on an ideal loop: a double
integrator with the default gains. Verdicts use the true state of the plant, not the measured one.

A run is bad for one of these reasons:

- oscillates: in the last second the peak-to-peak amplitude of a joint exceeds AMPLITUDE, except
  of one without a signal, whose drift nothing shows if it has no gravity and no friction. With
  gearboxes and without noise, from 100 Hz on, a joint is faster than REST_SPEED, or its effort
  changes by more than REST_CHANGE F_c (`safe_motion_gearbox`);
- overshoots: without a disturbance, a joint passes its goal by more than OVERSHOOT or by the share
  OVERSHOOT_FRACTION of its way. With a disturbance, a joint leaves the hull of all references so
  far by as much; runs with a push, an unknown load or wrong velocities have no such verdict;
- too fast: a velocity exceeds SPEED times its limit, or WRONG_SPEED times after velocities were
  wrong. The time of a push, and that of the ramp to zero, in which the arm falls, do not count.
  A joint with a gearbox may be faster by what no feedback prevents (`GearedPlant.free_speed`);
- past limit: a position limit is passed, by more than the static sag under an unknown load. Not of
  a joint without a signal that a person guides: nothing shows that it comes to its limit;
- no arrival: the mean position of the last second is more than DISTANCE away from the last goal,
  plus the static sag of the feedback for an unknown load. Gearboxes, whose rotors the loop does
  not know, have no such verdict. After a push this distance is the width
  in which dry friction that is not known exactly may hold a joint (`UNKNOWN_WIDTH`). A push or an
  unknown load that causes a fault ends the motion;
- hand guiding: a person moves the arm (`safe_motion_hand`) and may pass a goal; the arm need not
  arrive. Without friction nothing holds it against an unknown load, which may swing it like a
  pendulum and take it past a limit;
- leaves hull: the reference leaves the hull of the start, the path of the earliest stop and the
  goals (including the extrapolation of a moving set-point and the stop after it), see `Hull`;
- false alarm: a joint with a signal is a frozen one. True velocities that are not used are none:
  they cost only bandwidth;
- ramp: at the end of the command, the ramp begins at more than RAMP_SPEED, or stop and ramp take
  longer than END_TIME.
"""

import time
from typing import NamedTuple

from benchmarks.safe_motion_cases import Case, PERIODS, PUSH
from benchmarks.safe_motion_disturbances import scene_of, static_sag
from benchmarks.safe_motion_gearbox import GearedPlant, SLOWEST
from benchmarks.safe_motion_hand import HAND_GUIDING
from benchmarks.safe_motion_scene import FROZEN, Scene, STEP, Trace
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.joints.friction import UNKNOWN_WIDTH

JUDGED = 1000
"""[ms] at the end of a run in which oscillation and arrival are judged."""
AMPLITUDE = 0.01
"""Largest peak-to-peak amplitude at the end [rad]."""
OVERSHOOT, OVERSHOOT_FRACTION = 0.01, 0.05
"""Largest overshoot [rad], or share of the step if that is more."""
DISTANCE = 0.02
"""Largest distance of the mean position at the end from the goal [rad]."""
SPEED, WRONG_SPEED = 1.01, 1.2
"""Largest shares of a velocity limit."""
HULL_TOLERANCE = 1e-6
"""[rad]"""
RAMP_SPEED, END_TIME = 0.05, 5.0
"""[rad/s] when a ramp begins, and [s] until it has ended."""
PUSH_SETTLING = 0.3
"""[s] after a push in a motion, or with wrong velocities, in which an arm may be fast."""
PUSHED = {'following_error', 'overspeed'}
"""Faults that a push or an unknown load may cause."""


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


class Outcome(NamedTuple):
    """
    The verdicts on a run, the numbers that they depend on, and its cost.

    `amplitude`, `overshoot` and `distance` [rad]; `velocity_ratio` is the largest |v|/v_max;
    `simulated` and `seconds` [s] of simulated and of wall time. `misses` means that the arm did
    not arrive, or no longer follows the motion. Runs with pushes have no verdict on `misses` and
    on overshoot. `hull_excess` [rad] is that of the reference; `doubt` names the joints whose
    velocity was not used first, `notes` why a motion ended early or was rejected.
    """

    oscillates: bool
    overshoots: bool
    too_fast: bool
    past_limit: bool
    misses: bool
    leaves_hull: bool
    false_alarm: bool
    bad_ramp: bool
    amplitude: float
    overshoot: float
    velocity_ratio: float
    distance: float
    hull_excess: float
    faults: str
    doubt: str
    notes: str
    simulated: float
    seconds: float

    @property
    def verdicts(self) -> tuple[bool, ...]:
        """Whether the run is bad, for each of `VERDICTS`."""
        return tuple(map(bool, self[:len(VERDICTS)]))

    @property
    def is_bad(self) -> bool:
        return any(self.verdicts)


VERDICTS = (
    'oscillates', 'overshoots', 'too fast', 'past limit', 'no arrival', 'leaves hull',
    'false alarm', 'ramp')
Run = tuple[Case, Outcome]


def run(case: Case) -> Run:
    """Simulate and judge a case; add the case to the message of an error of the library."""
    start = time.perf_counter()
    try:
        scene = scene_of(case)
        trace = scene.run()
    except RobotDynamicsError as error:
        raise RuntimeError(f'{case}: {error}') from error
    return case, judge(scene, trace, time.perf_counter() - start)


def judge(scene: Scene, trace: Trace, seconds: float) -> Outcome:
    """Return the verdicts on the trace of a run."""
    case, limits, motion = scene.case, scene.arm.limits, scene.motion
    rates = {period: rate for rate, period in PERIODS.items()}
    margin = NOISE_MARGINS[rates[scene.longest_period]] if case.noisy else NO_MARGIN
    judged, q, last = trace.is_judged, trace.q, trace.q[-JUDGED:]
    is_measured, is_guided = scene.has_signal, case.command == HAND_GUIDING
    amplitudes, is_geared = np.ptp(last, axis=0), isinstance(scene.plant, GearedPlant)
    if is_guided:  # a released arm may move on, but not to and fro
        amplitudes = np.abs(np.diff(last, axis=0)).sum(axis=0) - amplitudes
        if scene.has_unknown_load and not is_geared:
            amplitudes = np.zeros_like(amplitudes)
    amplitude = float(amplitudes[is_measured].max(initial=0.0))
    excess, way = _overshoot(scene, trace)
    free_way = STEP * (PERIODS[case.rate] + case.delay) * scene.start_speed
    allowed = margin.overshoot + free_way + np.maximum(OVERSHOOT_FRACTION * way, OVERSHOOT)
    after = judged.copy()
    if motion.push is not None:
        settling = 0.0 if scene.velocities_are_true else PUSH_SETTLING
        after[:round((motion.push.end + settling) / STEP) + 1] = False
    if scene.push is not None:
        after[round(scene.push.begin / STEP):round(
            (scene.push.end + PUSH_SETTLING) / STEP) + 1] = False
    speed = np.abs(trace.v[after]).max(axis=0, initial=0.0)
    fastest = limits.velocity * (SPEED if scene.velocities_are_true else WRONG_SPEED)
    if isinstance(scene.plant, GearedPlant):
        reaction = STEP * (scene.longest_period + case.delay)
        for j, k in enumerate(np.abs(np.where(after[:, np.newaxis], trace.v, 0.0)).argmax(axis=0)):
            fastest[j] += scene.plant.free_speed(
                trace.q[k], scene.arm.friction.coulomb, reaction)[j]
    is_pushed = scene.push is not None or scene.has_unknown_load
    goal, sag = scene.goal, static_sag(scene)
    distance = 0.0 if goal is None else float((np.abs(last.mean(axis=0) - goal) - sag).max())
    must_arrive = goal is not None and case.motion != PUSH and not is_geared and not (
        is_guided or is_pushed and PUSHED.intersection(trace.faults))
    farthest = DISTANCE if scene.push is None else max(DISTANCE, UNKNOWN_WIDTH)
    is_true, is_past = scene.velocities_are_true, (
        (q > limits.upper + sag) | (q < limits.lower - sag)) & (is_measured | (not is_guided))
    vibrates = isinstance(scene.plant, GearedPlant) and not case.noisy and (
        case.rate >= SLOWEST and not scene.plant.is_calm)
    return Outcome(
        oscillates=trace.diverges or vibrates or amplitude > AMPLITUDE + margin.amplitude,
        overshoots=bool(
            is_true and not is_pushed and not is_guided and (excess > allowed).any()),
        too_fast=bool((speed > fastest + margin.velocity).any()),
        past_limit=bool(is_past[judged].any() and not (is_guided and scene.has_unknown_load)),
        misses=must_arrive and (trace.diverges or not trace.follows or distance > farthest),
        leaves_hull=trace.hull_excess > HULL_TOLERANCE,
        false_alarm=is_true and FROZEN in trace.faults,
        bad_ramp=scene.end_time > END_TIME or scene.ramp_speed > RAMP_SPEED + margin.velocity,
        amplitude=amplitude, overshoot=float(excess.max()),
        velocity_ratio=float((speed / limits.velocity).max()), distance=distance,
        hull_excess=trace.hull_excess, faults=' '.join(trace.faults), doubt=trace.doubt,
        notes='; '.join(filter(None, (trace.interruption, scene.rejection))),
        simulated=STEP * (len(q) - 1), seconds=seconds)


def _overshoot(scene: Scene, trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Return the distance beyond the goal or the hull, and the length of the way, each (n,)."""
    q, motion, hull = trace.q[trace.is_judged], scene.motion, scene.hull
    if not scene.case.disturbance:
        way = motion.goal - motion.start
        return ((q - motion.goal) * np.sign(way)).max(axis=0), np.abs(way)
    excess = np.maximum(q - hull.highest, hull.lowest - q).max(axis=0)
    return excess, hull.highest - hull.lowest
