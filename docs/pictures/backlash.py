# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/images/backlash.png: hysteresis, dead zone, and the limit cycle that backlash causes.

A motor moves a light load with dry friction like the play operator: the load stands still while
the motor crosses the gap. Sources: J.-J. E. Slotine and W. Li, *Applied
Nonlinear Control*, Prentice Hall 1991, sections 5.1 to 5.4 (describing functions, that of
backlash, limit cycles); M. Nordin and P.-O. Gutman, Automatica 38, 2002, section 3.
"""

from pathlib import Path
import sys
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints import make_actuators, make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics_tools.reporting.figures import (
    BLACK,
    BLUE,
    GREY,
    legend_below,
    ORANGE,
    SKY,
    styled_figure,
    VERMILION,
)
from scipy.optimize import fsolve

MILLI = 1e3
HALF_GAP = 0.01
"""b [rad]"""
LOAD, MOTOR = 2e-3, 1.0
"""Inertia of the link, and of its motor on the joint side [kg·m²]."""
AMPLITUDE, FREQUENCY = 0.03, np.pi
"""Amplitude [rad] and frequency [rad/s] of the sinusoidal motor motion."""
DRAG = 0.02
"""Dry friction of the load [N·m], far more than braking LOAD needs."""

K_D, K_P, K_I = 10.0, 100.0, 400.0
"""Gains of the loop with a limit cycle: motor speed, joint position, integral of the position."""
CYCLE_DRAG = 5e-3
"""Dry friction of its load [N·m]: 0.4 % of the motor effort, which the prediction neglects."""
PERIOD = 2e-3
"""Period of both control loops [s]."""


class Way(NamedTuple):
    """Time [s], θ of the motor and q of the joint, each (m,)."""

    t: FloatArray
    theta: FloatArray
    q: FloatArray


class Cycle(NamedTuple):
    """Amplitude [rad] and frequency [rad/s] of the fundamental of the motor motion."""

    amplitude: float
    frequency: float


def arm(gap: float, drag: float) -> ArmModel:
    bare = load_arm(
        planar_arm_urdf([0.1], [0.2], [0.1], [LOAD - 1e-3]), gravity=(0.0, 0.0, 0.0))
    with_drag = bare.with_friction(make_friction(bare.joint_names, coulomb=[drag]))
    return with_drag.with_actuators(make_actuators(
        bare.joint_names, [0.05], [100.0], rotor_inertia=[MOTOR / 1e4], backlash=[gap]))


def swing(duration: float) -> Way:
    """Return the motion of a motor that a stiff motor-side servo moves through the gap."""
    simulation, rows, w = ArmSimulation(arm(2.0 * HALF_GAP, DRAG)), [], FREQUENCY
    simulation.release()
    for k in range(round(duration / PERIOD)):
        theta, omega = simulation.motor_state
        goal, rate = AMPLITUDE * np.sin(w * k * PERIOD), AMPLITUDE * w * np.cos(w * k * PERIOD)
        simulation.step(
            1e4 * (goal - theta) + 200.0 * (rate - omega) - MOTOR * w * w * goal, PERIOD)
        rows.append(((k + 1) * PERIOD, simulation.motor_state.position[0], simulation.q[0]))
    return Way(*np.array(rows).T)


def feed_back(duration: float, gap: float = 2.0 * HALF_GAP, start: float = 0.1) -> Way:
    """Return the motion back to 0 with integral action on the joint position."""
    simulation, rows, integral = ArmSimulation(arm(gap, CYCLE_DRAG), (start,)), [], 0.0
    simulation.release()
    for k in range(round(duration / PERIOD)):
        integral -= float(simulation.q[0]) * PERIOD
        simulation.step(
            K_I * integral - K_P * simulation.q - K_D * simulation.motor_state.velocity, PERIOD)
        rows.append(((k + 1) * PERIOD, simulation.motor_state.position[0], simulation.q[0]))
    return Way(*np.array(rows).T)


def describing_function(amplitude: float) -> complex:
    """Return the ratio of the fundamentals of load and motor (Slotine and Li, section 5.2)."""
    b, A = HALF_GAP, amplitude
    r = 2.0 * b / A - 1.0
    in_phase = (0.5 * np.pi - np.arcsin(r) - r * np.sqrt(1.0 - r * r)) / np.pi
    return complex(in_phase, 4.0 * b / (np.pi * A) * (b / A - 1.0))


def predicted_cycle() -> Cycle:
    """Return the solution of L(jω) N(A) = −1 with L(s) = (K_P s + K_I) / (s² (J s + K_D))."""

    def balance(unknown: FloatArray) -> list[float]:
        s = 1j * np.exp(unknown[1])
        rest = (K_P * s + K_I) / (s * s * (MOTOR * s + K_D)) * describing_function(
            HALF_GAP * (1.0 + np.exp(unknown[0]))) + 1.0
        return [rest.real, rest.imag]

    logarithms, _, found, message = fsolve(balance, [0.0, np.log(5.0)], full_output=True)
    assert found == 1, message
    return Cycle(float(HALF_GAP * (1.0 + np.exp(logarithms[0]))), float(np.exp(logarithms[1])))


def after(way: Way, seconds: float) -> Way:
    """Return the rest of a motion, from a time [s] on."""
    return Way(*(x[way.t > seconds] for x in way))


def draw_hysteresis(axes: Any, way: Way) -> None:
    b, A = MILLI * HALF_GAP, MILLI * AMPLITUDE
    h = A - b
    corners = np.array([(A, h), (A - 2.0 * b, h), (-A, -h), (2.0 * b - A, -h), (A, h)])
    axes.plot(MILLI * way.theta, MILLI * way.q, color=SKY, linewidth=5.0, label='simulated')
    axes.plot(*corners.T, color=BLACK, linestyle=(0, (4, 2)), linewidth=1.2,
              label='play operator')
    axes.annotate('', (A, h + 1.5), (A - 2.0 * b, h + 1.5), arrowprops={
        'arrowstyle': '<->', 'color': VERMILION, 'shrinkA': 0.0, 'shrinkB': 0.0})
    axes.text(A - b, h + 2.5, 'gap 2b', color=VERMILION, ha='center', va='bottom')
    axes.set(xlabel='motor position / N [mrad]', ylabel='joint position [mrad]',
             ylim=(-25.0, 29.0), title='Hysteresis of the joint')
    legend_below(axes, 2)


def draw_dead_zone(axes: Any, way: Way) -> None:
    still = np.abs(way.theta - way.q) < HALF_GAP - 1e-9
    axes.plot(way.t, MILLI * way.theta, color=ORANGE, linestyle=(0, (5, 2)), linewidth=1.8,
              label='motor / N')
    axes.plot(way.t, MILLI * way.q, color=BLUE, linewidth=1.8, label='joint')
    axes.fill_between(way.t, 0.0, 1.0, where=still, transform=axes.get_xaxis_transform(),
                      color=GREY, alpha=0.2, linewidth=0.0, label='no contact')
    axes.set(xlabel='time [s]', ylabel='position [mrad]', title='Dead zone')
    legend_below(axes, 3)


def draw_cycle(axes: Any) -> None:
    way, predicted = feed_back(20.0, start=0.04), predicted_cycle()
    first, last = Way(*(x[way.t < 5.0] for x in way)), after(way, 15.0)

    def orbit(part: Way) -> tuple[np.ndarray, np.ndarray]:
        return MILLI * part.theta, MILLI * np.gradient(part.theta, part.t)

    axes.plot(*orbit(first), color=GREY, linewidth=0.9, label='transient')
    axes.plot(*orbit(last), color=SKY, linewidth=5.0, label='after 15 s')
    phase = np.linspace(0.0, 2.0 * np.pi, 200)
    A = MILLI * predicted.amplitude
    axes.plot(A * np.cos(phase), A * predicted.frequency * np.sin(phase), color=BLACK,
              linestyle=(0, (4, 2)), linewidth=1.2, label='harmonic balance')
    axes.set(xlabel='motor position / N [mrad]', ylabel='motor velocity / N [mrad/s]',
             title='Limit cycle with joint feedback')
    legend_below(axes, 3)


def main(directory: Path) -> None:
    """Write the picture into a directory."""
    way = after(swing(6.0), 2.0)
    with styled_figure(12.0, 4.4) as figure:
        hysteresis, dead_zone, cycle = figure.subplots(1, 3)
        draw_hysteresis(hysteresis, way)
        draw_dead_zone(dead_zone, way)
        draw_cycle(cycle)
        figure.savefig(directory / 'backlash.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
