# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Hand guiding: how easily an arm moves, whether it rests, and a leader that feels its follower.

The plants are those of `safe_motion`: rigid dry friction, or the LuGre model of gearboxes, with
the friction that the loop knows, or less. Random poses, joints, rates and delays.
"""

import argparse
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
import sys
from typing import NamedTuple
from xml.etree import ElementTree

from benchmarks.safe_motion_cases import arm_named
from benchmarks.safe_motion_gearbox import DISTANCES, GearedPlant, given_friction
from benchmarks.safe_motion_plant import Plant
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.force_feedback import ForceFeedback
from robot_dynamics.control.laws.hand_guiding import HandGuiding
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics_tools.reporting.figures import (
    BLUE,
    save_figure,
    styled_figure,
    VERMILION,
)

OPENARM_LIKE = 'openarm-like'
ARMS = (OPENARM_LIKE, 'z1', 'panda', 'ur10', 'xarm7', 'kinova')
LINKS = ((1.2, 0.12, 40.0), (0.9, 0.05, 40.0), (0.8, 0.15, 27.0), (0.7, 0.05, 27.0),
         (0.5, 0.12, 7.0), (0.4, 0.04, 7.0), (0.5, 0.08, 7.0))
"""Mass [kg], length [m] and effort limit [N·m] of the links of an arm with DM motors."""
PERIODS = (1, 2, 4, 10)
"""[ms] of the joint states."""
YIELD = 0.02
"""[rad] that the hand yields under the friction of a joint."""
SPEEDS = (0.1, 0.2, 0.4)
"""[rad/s] at which a joint is moved."""
MASS_ERROR, OVERESTIMATE, SHARE, LARGEST_SHARE = 1.05, 1.2, 0.6, 0.7
"""Of the plant's masses; of the friction that the loop knows; compensated by default."""
COVERED = 0.9
"""Largest gravity error, by the dry friction, of a pose in which friction covers it."""
CREEP_TIME, CALM_TIME = 10.0, 20.0
"""[s]"""
BORNE = 0.9
"""Largest gravity of a pose, by the effort limit."""
WALL_WAY, WALLS = 0.08, (500.0, 10000.0)
"""[rad] to the wall of the follower, and its stiffness [N·m/rad]."""
THROW = (0.2, 0.7)
"""Speed [rad/s] at which the leader is thrown, or share of a lower velocity limit."""
IMPACT, IMPACT_TIME, SET_POINT_PERIOD = 300, 3000, 10
"""[ms]"""
HAND, SHOWN = 30.0, 0
"""[1/s²] of the spring in the figure, and its case."""
LATEST = 20
"""[ms]: largest delay between two arms."""
FIRST_STAMP, MS = 1_000_000_000, 1_000_000
Effort = Callable[[int, Plant], FloatArray]
"""Returns an effort (n,) of the environment at a time [ms]."""


@cache
def arm_of(name: str) -> ArmModel:
    """Return an arm with known friction."""
    return given_friction(load_arm(openarm_like()) if name == OPENARM_LIKE else arm_named(name))


def openarm_like() -> str:
    """Return the URDF of a chain of seven joints with LINKS, whose axes alternate."""
    robot = ElementTree.Element('robot', name='openarm_like')
    ElementTree.SubElement(robot, 'link', name='base')
    parent, height = 'base', 0.1
    for i, (mass, length, effort) in enumerate(LINKS, 1):
        link = ElementTree.SubElement(robot, 'link', name=f'link{i}')
        inertial = ElementTree.SubElement(link, 'inertial')
        ElementTree.SubElement(inertial, 'origin', xyz=f'0 0.01 {0.5 * length}')
        ElementTree.SubElement(inertial, 'mass', value=str(mass))
        thick, long = (str(mass * r**2) for r in (0.03, max(0.4 * length, 0.03)))
        ElementTree.SubElement(
            inertial, 'inertia', ixx=long, iyy=long, izz=thick, ixy='0', ixz='0', iyz='0')
        joint = ElementTree.SubElement(robot, 'joint', name=f'joint{i}', type='revolute')
        ElementTree.SubElement(joint, 'origin', xyz=f'0 0 {height}')
        ElementTree.SubElement(joint, 'parent', link=parent)
        ElementTree.SubElement(joint, 'child', link=link.get('name', ''))
        ElementTree.SubElement(joint, 'axis', xyz='0 0 1' if i % 2 else '0 1 0')
        ElementTree.SubElement(
            joint, 'limit', lower='-2.5', upper='2.5', effort=str(effort), velocity='5')
        parent, height = link.get('name', ''), length
    return ElementTree.tostring(robot, encoding='unicode')


class Setting(NamedTuple):
    """One random case: pose q (n,), joint j, period and delay [ms], d [m] or 0 for rigid."""

    name: str
    q: FloatArray
    j: int
    period: int
    delay: int
    distance: float
    rng: np.random.Generator

    @classmethod
    def random(cls, name: str, seed: int) -> 'Setting':
        arm, rng = arm_of(name), np.random.default_rng(seed)
        lower, upper = np.clip((arm.limits.lower, arm.limits.upper), -2.8, 2.8)
        dynamics, period = ArmDynamics(arm), int(rng.choice(PERIODS))
        while True:
            q = lower + rng.uniform(0.3, 0.7, len(lower)) * (upper - lower)
            if (MASS_ERROR * np.abs(dynamics.gravity(q)) <= BORNE * arm.limits.effort).all():
                break
        return cls(
            name, q, int(rng.integers(min(arm.joint_count, 7))), period,
            int(rng.integers(2 * period + 1)),
            float(np.exp(rng.uniform(*np.log(DISTANCES)))) if rng.uniform() < 0.7 else 0.0, rng)

    def plant(self, mass: float = 1.0, friction: float = 1.0, has_rotors: bool = False) -> Plant:
        """Return the plant with scaled masses and friction, and rotors."""
        arm = arm_of(self.name)
        model = arm.pinocchio_model.copy()
        for i, inertia in enumerate(model.inertias):
            model.inertias[i] = type(inertia)(
                mass * inertia.mass, inertia.lever, mass * inertia.inertia)
        coulomb, viscous = friction * arm.friction.coulomb, friction * arm.friction.viscous
        plant = replace(arm.with_friction(make_friction(
            arm.joint_names, viscous=viscous, coulomb=coulomb)), pinocchio_model=model)
        if self.distance == 0.0:
            return Plant(plant, self.q)
        limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 0.0)
        rotors = self.rng.uniform(0.1, 1.0, len(limit)) * limit / 500.0
        return GearedPlant(
            plant, self.q, coulomb, self.distance, rotors if has_rotors else 0.0 * limit)


def simulate(
    one: Setting, plant: Plant, share: float, seconds: float, push: Effort | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the motion (m, n) each of a guided arm, one row per ms."""
    arm = arm_of(one.name)
    loop = ControlLoop.of_arm(
        arm, command='hand_guiding', parameters={'hand_guiding.friction_share': share})
    pending, effort, states = deque[tuple[int, FloatArray]](), None, []
    for k in range(round(1e3 * seconds)):
        if k % one.period == 0:
            answer = loop.answer(FIRST_STAMP + MS * k, plant.q, plant.v).effort
            if answer is not None:
                pending.append((k + one.delay, answer))
        while pending and pending[0][0] <= k:
            effort = pending.popleft()[1]
        if effort is not None:
            plant.step(effort + (0.0 if push is None else push(k, plant)), 1e-3)
        states.append((plant.q, plant.v))
    q, v = zip(*states)
    return np.array(q), np.array(v)


def push_ratio(one: Setting) -> float:
    """Return the mean push that keeps a joint moving, by that without compensation."""
    M, friction = ArmDynamics(arm_of(one.name)).mass_matrix(one.q), arm_of(one.name).friction
    speed, pushes = float(one.rng.choice(SPEEDS)), []
    stiffness = (friction.coulomb[one.j] + friction.viscous[one.j] * speed) / YIELD
    for share in (SHARE, 0.0):
        total: list[float] = []

        def push(k: int, plant: Plant, total: list[float] = total) -> FloatArray:
            t = 1e-3 * k - 0.2
            e, e_dot = one.q[one.j] + speed * max(t, 0.0) - plant.q[one.j], (
                speed * (t > 0.0) - plant.v[one.j])
            effort = 400.0 * M[:, one.j] * e + 40.0 * M[:, one.j] * e_dot
            effort[one.j] += stiffness * e
            if t > 0.5:
                total.append(effort[one.j])
            return np.asarray(effort)
        simulate(one, one.plant(), share, 1.2, push)
        pushes.append(float(np.mean(total)))
    return pushes[0] / pushes[1]


def creep(one: Setting) -> float | None:
    """Return how far [rad] a released arm creeps with a mass error, None if friction is small."""
    arm = arm_of(one.name)
    error = (MASS_ERROR - 1.0) * np.abs(ArmDynamics(arm).gravity(one.q))
    if (error > COVERED * arm.friction.coulomb).any():
        return None
    q, _ = simulate(one, one.plant(MASS_ERROR), SHARE, CREEP_TIME)
    return float(np.abs(q[-1] - q[0]).max())


def last_speed(one: Setting) -> float:
    """Return the speed [rad/s] long after a kick, with the largest share of too much friction."""
    plant = one.plant(1.0, 1.0 / OVERESTIMATE, bool(one.rng.uniform() < 0.5))
    plant.v = one.rng.uniform(-0.3, 0.3, len(one.q))
    _, v = simulate(one, plant, LARGEST_SHARE, CALM_TIME)
    return float(np.abs(v[-1000:]).max())


def impact(
    name: str, seed: int, link: int, has_friction: bool = False, hand: float = 0.0,
) -> FloatArray:
    """
    Return the energies [J] of a leader, one per ms, whose follower hits a wall.

    `link` [ms] is the delay of each direction. The leader is thrown at IMPACT; or the spring
    `hand` [1/s²] per inertia of the joint pulls it to a point behind the wall, and its energy
    counts too.
    """
    arm = arm_of(name) if has_friction else arm_of(name).with_friction(
        make_friction(arm_of(name).joint_names))
    one, dynamics = Setting.random(name, seed), ArmDynamics(arm)
    j, rng, n = one.j % 4, one.rng, arm.joint_count
    sign, stiffness = rng.choice([-1.0, 1.0]), rng.uniform(*WALLS)
    wall = one.q[j] + sign * WALL_WAY
    rest, spring = wall + sign * WALL_WAY, hand * dynamics.mass_matrix(one.q)[j, j]
    leader, follower = Plant(arm, one.q), Plant(arm, one.q)
    guided = ControlLoop.of_arm(
        arm, command='hand_guiding', parameters={'hand_guiding.feedback_gain': 0.5})
    law = guided.controller.law
    assert isinstance(law, HandGuiding)
    moved, observer = ControlLoop.of_arm(arm), ExternalEffort(dynamics, 10.0)
    efforts, energy = [np.zeros(n), np.zeros(n)], []
    forces, set_points = deque[tuple[int, FloatArray]](), deque[tuple[int, FloatArray]]()
    for k in range(IMPACT_TIME):
        stamp = FIRST_STAMP + MS * k
        if k == IMPACT and not hand:
            leader.v[j] = sign * rng.uniform(*THROW) * min(1.0, arm.limits.velocity[j])
        if k % 2 == 0:
            r = observer.update(2e-3, follower.q, follower.v, efforts[1])
            if r is not None:
                forces.append((k + link, r))
            while forces and forces[0][0] <= k:
                law.feel(forces.popleft()[1])
            for i, (loop, plant) in enumerate(((guided, leader), (moved, follower))):
                answer = loop.answer(stamp, plant.q, plant.v).effort
                efforts[i] = efforts[i] if answer is None else answer
        if k % SET_POINT_PERIOD == 0 and k > 100:
            set_points.append((k + link, np.array([leader.q, leader.v])))
        while set_points and set_points[0][0] <= k:
            q, v = set_points.popleft()[1]
            with suppress(TrajectoryError):  # during a fault
                moved.follow(
                    make_trajectory(arm.joint_names, [0.0], [q], [v], [], arm.joint_names))
        contact = np.zeros(n)
        contact[j] = -sign * stiffness * max(sign * (follower.q[j] - wall), 0.0)
        pull = np.zeros(n)
        if k >= IMPACT:
            pull[j] = spring * (rest - leader.q[j])
        leader.step(efforts[0] + pull, 1e-3)
        follower.step(efforts[1] + contact, 1e-3)
        kinetic = 0.5 * leader.v @ dynamics.mass_matrix(leader.q) @ leader.v
        energy.append(kinetic + (0.5 * spring * (rest - leader.q[j])**2 if k >= IMPACT else 0.0))
    return np.array(energy)


def gain_of_energy(energy: FloatArray) -> float:
    """Return the largest energy after the leader was thrown, by that at once."""
    return float(energy[IMPACT + 1:].max() / energy[IMPACT])


def main(argv: Sequence[str] = ()) -> None:
    """Print the tables; save the figure of two coupled arms."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.hand_guiding', description=__doc__)
    parser.add_argument('--cases', type=int, default=4, help='random cases per arm')
    parser.add_argument('--impacts', type=int, default=100, help='impacts of coupled arms')
    parser.add_argument('--arms', nargs='+', default=list(ARMS), help='arms')
    parser.add_argument('--figure', type=Path, metavar='FILE', help='energy over time (PNG)')
    arguments = parser.parse_args(argv)
    print('| arm | push, by that without compensation | creep in 10 s [mrad] '
          '| last speed after a kick [rad/s] |\n| --- | --- | ---: | ---: |')
    for name in arguments.arms:
        cases = [Setting.random(name, seed) for seed in range(arguments.cases)]
        ratios = [push_ratio(one) for one in cases]
        creeps = [c for c in map(creep, cases) if c is not None]
        speeds = [last_speed(one) for one in cases]
        print(f'| {name} | {min(ratios):.2f}–{max(ratios):.2f} | '
              f'{1e3 * max(creeps, default=0.0):.2g} ({len(creeps)} cases) | {max(speeds):.1g} |',
              flush=True)
    gains = [gain_of_energy(impact(
        arguments.arms[i % len(arguments.arms)], i, i % (LATEST + 1), i % 3 == 0))
        for i in range(arguments.impacts)]
    print(f'\nEnergy of the leader after {len(gains)} impacts, by that before: largest '
          f'{max(gains, default=0.0):.3f}')
    if arguments.figure is not None:
        draw(arguments.figure)


def draw(path: Path) -> None:
    """Draw the energy of a leader over time, with and without the energy tank."""
    tank = ForceFeedback.effort

    def plain(self: ForceFeedback, external: FloatArray, *_: object) -> FloatArray:
        return np.asarray(np.clip(self._gain * external, -self._limit, self._limit))

    with styled_figure(10.0, 4.0) as figure:
        axes = figure.subplots()
        for law, colour, label in ((tank, BLUE, 'energy tank'), (plain, VERMILION, 'gain only')):
            ForceFeedback.effort = law  # type: ignore[method-assign,assignment]
            energy = impact('panda', SHOWN, LATEST, hand=HAND)
            axes.plot(1e-3 * np.arange(len(energy)), energy, color=colour, label=label)
        ForceFeedback.effort = tank  # type: ignore[method-assign]
        axes.set(xlabel='time [s]', ylabel='energy [J]')
        axes.set_title(
            'Panda, pulled by a spring until its follower hits a wall; delay 20 ms, gain 0.5')
        axes.legend()
        save_figure(figure, path)


if __name__ == '__main__':
    main(sys.argv[1:])
