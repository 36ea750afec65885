# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One joint with backlash, in control theory and in the simulated arm.

A motor moves a light load with dry friction like the play operator: the load stands still while
the motor crosses the gap. Sources: J.-J. E. Slotine and W. Li, *Applied
Nonlinear Control*, Prentice Hall 1991, sections 5.1 to 5.4 (describing functions, that of
backlash, limit cycles); M. Nordin and P.-O. Gutman, Automatica 38, 2002, section 3. The test and
the figure of the documentation use the same runs.
"""

from typing import NamedTuple

import numpy as np
from optional_library import library
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints import make_actuators, make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation

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


def play_operator(theta: FloatArray, q: float) -> FloatArray:
    """Return the position of a load that stands still while θ (m,) is within the gap."""
    way = []
    for x in theta:
        q = min(max(q, x - HALF_GAP), x + HALF_GAP)
        way.append(q)
    return np.array(way)


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

    logarithms, _, found, message = library('scipy.optimize').fsolve(
        balance, [0.0, np.log(5.0)], full_output=True)
    assert found == 1, message
    return Cycle(float(HALF_GAP * (1.0 + np.exp(logarithms[0]))), float(np.exp(logarithms[1])))


def fundamental(way: Way, frequency: float) -> tuple[complex, complex]:
    """Return the fundamentals of motor and joint over whole periods at the end of a motion."""
    period = 2.0 * np.pi / frequency
    last = way.t > way.t[-1] - np.floor(way.t[-1] / period) * period
    wave = np.exp(-1j * frequency * way.t[last])
    theta, q = (2.0 * np.mean(x[last] * wave) for x in (way.theta, way.q))
    return complex(theta), complex(q)


def measured_cycle(way: Way) -> Cycle:
    """Return the limit cycle of a settled motion; 0 without an oscillation."""
    centred = way.theta - 0.5 * (way.theta.max() + way.theta.min())
    k = np.flatnonzero((centred[:-1] < 0.0) & (centred[1:] >= 0.0))
    if len(k) < 3:
        return Cycle(0.0, 0.0)
    rises = way.t[k] - centred[k] * (way.t[k + 1] - way.t[k]) / (centred[k + 1] - centred[k])
    frequency = float(2.0 * np.pi / np.mean(np.diff(rises)))
    whole = Way(*(x[k[0]:k[-1]] for x in way))
    wave = np.exp(-1j * frequency * whole.t)
    return Cycle(float(abs(2.0 * np.mean(whole.theta * wave))), frequency)


def after(way: Way, seconds: float) -> Way:
    """Return the rest of a motion, from a time [s] on."""
    return Way(*(x[way.t > seconds] for x in way))
