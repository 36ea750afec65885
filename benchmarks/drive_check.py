# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The drive check in simulation without ROS: wrong drives are named, right ones are not.

    scripts/run python -m benchmarks.drive_check [--seeds N] [--drives NAME ...] [--law NAME]
    scripts/run python -m benchmarks.drive_check --starts N
    scripts/run python -m benchmarks.drive_check --good SECONDS [--seed N]

Prints the tables of docs/evidence/drive_check.md. Arms with dry friction (1 to 3 % of the effort
limit) and rotors that the loop does not know; states at 125 to 1000 Hz, 0 to 4 ms of delay, noise.
The wrong drive is that of the joint that gravity loads most.
"""

import argparse
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import NamedTuple

from benchmarks.safe_motion_cases import arm_named
from benchmarks.safe_motion_plant import Plant
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.exceptions import MissingDependencyError, RobotDynamicsError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import make_payload
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARMS = 'ur5', 'panda', 'z1', 'kinova', 'xarm7'
LOADS = {'ur5': 1.5, 'panda': 1.0, 'z1': 0.9, 'kinova': 0.5, 'xarm7': 1.0, 'default': 3.0}
"""The largest unknown load [kg]."""
EPOCH = 1_790_000_000 * 10**9
LOOK = 0.1
"""[s] between two looks at the verdicts."""
SECONDS = 2.6
GOALS = 0.5, 1.3
"""[s]"""
Torques = Callable[[FloatArray, FloatArray, int], FloatArray]
"""Returns the torque (n,) at the joints for a command (n,), g(q) (n,) and the wrong joint."""


class Wrong(NamedTuple):
    """A wrong drive: its torque, its report of command and torque, and its right verdict."""

    torque: Torques
    report: Callable[[FloatArray, FloatArray, int], FloatArray]
    words: tuple[str, ...]


def _at(change: Callable[[float, float], float]) -> Torques:
    def torque(u: FloatArray, g: FloatArray, j: int) -> FloatArray:
        u = u.copy()
        u[j] = change(u[j], g[j])
        return u
    return torque


def _true(u: FloatArray, tau: FloatArray, j: int) -> FloatArray:
    return tau


def _scaled_report(k: float) -> Callable[[FloatArray, FloatArray, int], FloatArray]:
    return lambda u, tau, j: np.where(np.arange(len(u)) == j, k * tau, tau)


def _scaled_command(k: float) -> Torques:
    return _at(lambda u, g: k * u)


def wrong_drives(limit: FloatArray) -> dict[str, Wrong]:
    """Return the wrong drives by their names; `limit` (n,) are effort limits."""
    right: Torques = lambda u, g, j: u  # noqa: E731
    found = {'reversed': Wrong(_at(lambda u, g: -u), _true, ('reversed',))}
    for k in (0.25, 2.0, 4.0):
        scaled = _scaled_command(k)
        found[f'command × {k:g}'] = Wrong(scaled, lambda u, tau, j: u, (f'command scale {k}',))
        found[f'report × {k:g}'] = Wrong(right, _scaled_report(k), (f'report scale {k}',))
        found[f'both × {k:g}'] = Wrong(scaled, _scaled_report(k), (f'command scale {k}',))
    found |= {
        'adds gravity': Wrong(lambda u, g, j: u + g, lambda u, tau, j: u, ('adds gravity',)),
        'adds gravity, reports it': Wrong(lambda u, g, j: u + g, _true, ('adds gravity',)),
        'clipped at 10 %': Wrong(lambda u, g, j: np.where(
            np.arange(len(u)) == j, np.clip(u, -0.1 * limit, 0.1 * limit), u), _true,
            ('clipped at',)),
        'safety controller': Wrong(
            lambda u, g, j: np.clip(u, -0.01 * limit, 0.01 * limit), _true, ('no effect',)),
        'no effect': Wrong(lambda u, g, j: 0.0 * u, _true, ('no effect',)),
        'dead joint': Wrong(_at(lambda u, g: 0.0), _true, ('no effect',)),
        'delay 40 ms': Wrong(right, _true, ('delayed by',)),
        'coarse 8 %': Wrong(
            lambda u, g, j: 0.08 * limit * np.round(u / (0.08 * limit)), _true, ('coarse',)),
        'motor torque': Wrong(right, lambda u, tau, j: tau / 100.0, ('report scale 0.01',))}
    return found


class Outcome(NamedTuple):
    """Verdict at the wrong joint, when [s] and where [rad] it was seen; others; speed after it."""

    verdict: str
    others: list[str]
    seconds: float
    moved: float
    speed: float


class Run:
    """One arm in a closed loop with its drives."""

    def __init__(
        self, name: str, seed: int, rate: float, load: float = 0.0, law: str = 'computed_torque',
    ) -> None:
        arm, self.rng = arm_named(name), np.random.default_rng(seed)
        self.limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 30.0)
        n, rng = arm.joint_count, self.rng
        plain = arm.with_friction(make_friction(
            arm.joint_names, viscous=arm.friction.viscous.tolist()))
        true = arm.with_friction(make_friction(
            arm.joint_names, viscous=arm.friction.viscous.tolist(),
            coulomb=(rng.uniform(0.01, 0.03, n) * self.limit).tolist()))
        true = true.with_reflected_inertia(rng.uniform(0.2, 1.0, n) * self.limit / 500.0)
        if load > 0.0:
            true = true.with_payloads([make_payload(arm.link_names[-1], load, (0.0, 0.0, 0.05))])
        self.arm, self.q0, self.joint = plain, *_start(plain, rng, self.limit)
        self.plant, self.loop = Plant(true, self.q0), ControlLoop.of_arm(plain, command=law)
        self.period, self.delay = round(1000.0 / rate), int(rng.choice([0, 1, 2, 4]))
        self.push = np.zeros(n)
        self.k, self._waiting = 0, deque[tuple[int, FloatArray]]()
        self._command: FloatArray | None = None
        self._reported = np.zeros(n)

    @property
    def moved(self) -> float:
        """The largest way of a joint from its start [rad]."""
        return float(np.abs(self.plant.q - self.q0).max())

    def step(self, drive: Wrong | None) -> None:
        """Continue by 1 ms."""
        loop, plant, rng = self.loop, self.plant, self.rng
        effort = None
        if self.k % self.period == 0:
            samples = loop.drives.samples
            if samples.wants_report:
                samples.wants_report = False
                samples.report(self._reported)
            q = 3e-5 * np.round(plant.q / 3e-5)
            v = plant.v + 0.002 * rng.standard_normal(len(q))
            with suppress(RobotDynamicsError):
                effort = loop.answer(EPOCH + self.k * 10**6, q, v).effort
        elif loop.supervisor.acts_alone and self.k % 2:
            effort = loop.tick(1e-9 * EPOCH + 1e-3 * self.k)
        if effort is not None:
            self._waiting.append((self.k + self.delay, effort))
        while self._waiting and self._waiting[0][0] <= self.k:
            self._command = self._waiting.popleft()[1]
        if self._command is not None:  # brakes hold the arm before
            u, g = self._command, plant.body.gravity(plant.q)
            tau = u if drive is None else drive.torque(u, g, self.joint)
            self._reported = tau if drive is None else drive.report(u, tau, self.joint)
            plant.step(np.clip(tau, -self.limit, self.limit) + self.push, 1e-3)
        self.k += 1

    def go(self) -> None:
        """Send a set-point 0.2 to 0.5 rad away, if it can be followed."""
        goal = self.q0 + self.rng.choice([-1.0, 1.0], len(self.q0)) * self.rng.uniform(
            0.2, 0.5, len(self.q0))
        low, high = self.arm.limits.lower + 0.1, self.arm.limits.upper - 0.1
        with suppress(RobotDynamicsError):
            self.loop.follow(make_trajectory(
                self.arm.joint_names, [0.0], [np.clip(goal, low, high)]))


def _start(
    arm: ArmModel, rng: np.random.Generator, limit: FloatArray,
) -> tuple[FloatArray, int]:
    """Return a position that the drives can hold, and the joint that gravity loads most."""
    body = Plant(arm, np.zeros(arm.joint_count)).body
    low, high = np.maximum(arm.limits.lower, -3.0), np.minimum(arm.limits.upper, 3.0)
    while True:
        q = np.clip(0.5 * (low + high) + rng.uniform(-0.8, 0.8, len(low)), low + 0.3, high - 0.3)
        share = np.abs(body.gravity(q)) / limit
        if share.max() < 0.6:
            return q, int(share.argmax())


def judged(name: str, kind: str, seed: int, rate: float, law: str = 'computed_torque') -> Outcome:
    """Return the outcome of an arm with a wrong drive."""
    run = Run(name, seed, rate, law=law)
    drive = wrong_drives(run.limit)[kind]
    if kind.startswith('delay'):
        run.delay = 40
    seconds, moved, speed, words = np.nan, np.nan, 0.0, ['not observable yet'] * len(run.q0)
    for k in range(round(1e3 * SECONDS)):
        if k in [round(1e3 * t) for t in GOALS]:
            run.go()
        run.step(drive)
        if run.loop.supervisor.fault is not None:
            moved = run.moved if np.isnan(moved) else moved
            if k < 2000:
                speed = max(speed, float(np.abs(run.plant.v).max()))
        if k % round(1e3 * LOOK) == 0:
            words = [one.verdict for one in run.loop.drives.verdicts()]
            if np.isnan(seconds) and any(_is_wrong(word) for word in words):
                seconds = 1e-3 * k
                moved = run.moved if np.isnan(moved) else moved
    own = words[run.joint]
    others = [word for j, word in enumerate(words) if j != run.joint and _is_wrong(word)]
    if kind in ('delay 40 ms', 'coarse 8 %', 'motor torque') and not _is_wrong(own) and others:
        own = others[0]
    return Outcome(own, [word for word in others if word.split()[0] != own.split()[0]],
                   seconds, moved, speed)


def _is_wrong(word: str) -> bool:
    return word not in ('agrees', 'not observable yet')


def is_right(verdict: str, words: tuple[str, ...]) -> bool:
    """Return whether a verdict is one of the words, numbers within 15 %."""
    for word in words:
        name, _, number = word.rpartition(' ')
        if number.replace('.', '').isdigit():
            given = verdict.rpartition(' ')
            if given[0] == name and abs(float(given[2]) / float(number) - 1.0) < 0.15:
                return True
        elif verdict.startswith(word):
            return True
    return False


def good(name: str, seed: int, rate: float, seconds: float) -> Iterator[str]:
    """Yield the words on right drives with loads, pushes and gaps in the states."""
    run = Run(name, seed, rate, float(np.random.default_rng(seed).choice([0.0, 0.5, 1.0])))
    said = set[str]()
    for k in range(round(1e3 * seconds)):
        if k % 1500 == 700:
            run.go()
        if k % 2000 == 1400:
            run.push = 0.1 * run.limit * run.rng.uniform(-1.0, 1.0, len(run.q0))
        elif k % 2000 == 1700:
            run.push = np.zeros(len(run.q0))
        if k % 10_000 == 9_000:
            run.k += 400  # a gap in the states
        run.step(None)
        if run.loop.drives.wrong is None:
            run.loop.reset()  # a push may be too fast
        else:
            yield f'ended: {run.loop.supervisor.fault}'
            return
        if k % 500 == 0:
            for name_, one in zip(run.arm.joint_names, run.loop.drives.verdicts()):
                if one.is_wrong and one.verdict not in said:
                    said.add(one.verdict)
                    yield f'{name_}: {one.verdict}'


def accused_at_starts(name: str, count: int) -> list[str]:
    """Return the words on right drives at starts and first motions, with unknown loads."""
    words = []
    for seed in range(count):
        load = LOADS[name] * float(np.random.default_rng(1000 + seed).uniform(0.3, 1.0))
        run = Run(name, 5000 + seed, (125.0, 250.0, 500.0, 1000.0)[seed % 4], load)
        for k in range(700):
            if k == 450:
                run.go()
            run.step(None)
        words += [one.verdict for one in run.loop.drives.verdicts() if one.is_wrong]
    return words


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', type=int, default=1, metavar='N')
    parser.add_argument('--good', type=float, default=0.0, metavar='SECONDS')
    parser.add_argument('--starts', type=int, default=0, metavar='N')
    parser.add_argument('--seed', type=int, default=7, metavar='N', help='of the first good arm')
    parser.add_argument('--law', default='computed_torque', metavar='NAME')
    parser.add_argument('--drives', nargs='+', default=list(wrong_drives(np.ones(1))),
                        metavar='NAME')
    parser.add_argument('--arms', nargs='+', default=list(ARMS), metavar='ARM')
    arguments = parser.parse_args()
    try:
        arms = [arm for arm in arguments.arms if arm_named(arm)]
    except MissingDependencyError as error:
        parser.error(str(error))
    rates = 125.0, 250.0, 500.0, 1000.0
    for arm in LOADS if arguments.starts else ():
        print(f'{arm}: {arguments.starts} starts, {accused_at_starts(arm, arguments.starts)}')
    if not arguments.good and not arguments.starts:
        print('| drive | right | named together | not yet | other word | s | rad (median, 90 %) | '
              'speed after [rad/s] |\n|---|---|---|---|---|---|---|---|')
        for kind in arguments.drives:
            found = [(arm, judged(arm, kind, 100 * i + seed, rates[(i + seed) % 4], arguments.law))
                     for i, arm in enumerate(arms) for seed in range(arguments.seeds)]
            words = wrong_drives(np.ones(1))[kind].words
            _print(kind, words, [one for _, one in found])
            for arm, one in found:
                if one.others or not is_right(one.verdict, words):
                    print(f'    {arm}: {one.verdict} {one.others}')
    for i, arm in enumerate(arms if arguments.good else ()):
        said = list(good(arm, arguments.seed + i, rates[i % 4], arguments.good))
        print(f'{arm}: {arguments.good:g} s, {len(said)} words {said}', flush=True)


def _print(kind: str, words: tuple[str, ...], found: list[Outcome]) -> None:
    n, seen = len(found), [one for one in found if not np.isnan(one.moved)]
    right = sum(is_right(one.verdict, words) for one in found)
    together = sum(one.verdict.startswith('unclear') and words[0].split()[0] in one.verdict
                   for one in found)
    unknown = sum(one.verdict in ('agrees', 'not observable yet') for one in found)
    moved = [one.moved for one in seen] or [0.0]
    seconds = [one.seconds for one in found if not np.isnan(one.seconds)] or [0.0]
    print(f'| {kind} | {right} of {n} | {together} | {unknown} | '
          f'{n - right - together - unknown + sum(bool(one.others) for one in found)} | '
          f'{np.median(seconds):.1f} | {np.median(moved):.3f}, {np.percentile(moved, 90):.3f} | '
          f'{max((one.speed for one in found), default=0.0):.1f} |', flush=True)


if __name__ == '__main__':
    main()
