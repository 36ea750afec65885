# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""The library compared with other engines, called from Python on the same arm and states."""

from typing import Any

from benchmarks.chains import chain_urdf, ChainLink, spatial_chain
from benchmarks.engine_calls import Calls, GRAVITY
from benchmarks.engines import PEERS
from benchmarks.timing import medians
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody

JOINTS = 7
STATES = 20
ROUNDS = 15
TOLERANCE = 1e-6
"""Largest difference between engines, relative to the largest number of the answer."""
QUANTITIES = {'inverse_dynamics': 3, 'gravity': 1, 'mass_matrix': 1, 'forward_dynamics': 3}
"""The questions, and how many vectors of a state each takes: q, v, and q̈ or τ."""
OURS = 'robot_dynamics'


def library(links: list[ChainLink], weight: float = -GRAVITY[2]) -> Calls:
    """
    Return the calls of the library for rigid bodies, the quantities of all other engines.

    `weight` is the gravitational acceleration [m/s²].
    """
    body = UncheckedRigidBody(load_arm(chain_urdf(links), gravity=(0.0, 0.0, -weight)))
    return Calls(
        OURS, body.inverse_dynamics, body.gravity, body.mass_matrix, body.forward_dynamics)


def library_with_friction(links: list[ChainLink]) -> Calls:
    """Return the calls of the library with its friction model; all coefficients are zero here."""
    dynamics = UncheckedArmDynamics(load_arm(chain_urdf(links)))
    body = dynamics.rigid_body
    return Calls(
        f'{OURS}, ArmDynamics', dynamics.inverse_dynamics, body.gravity, body.mass_matrix,
        dynamics.forward_dynamics)


def installed(links: list[ChainLink]) -> tuple[list[Calls], list[str]]:
    """Return the calls of the installed engines, and a line for each engine not installed."""
    found, missing = [library(links), library_with_friction(links)], []
    for peer in PEERS:
        try:
            found.append(peer.make(links))
        except ImportError:
            missing.append(f'{peer.name} is left out, as it is not installed: {peer.source}')
    return found, missing


def largest_difference(engine: Calls, links: list[ChainLink], states: FloatArray) -> float:
    """Return the largest difference to the library, relative to the largest number of a result."""
    ours, found = library(links, engine.weight), []
    for state in states:
        for quantity in QUANTITIES:
            arguments = _arguments(quantity, state)
            expected = np.asarray(getattr(ours, quantity)(*arguments))
            difference = np.asarray(getattr(engine, quantity)(*arguments)) - expected
            found.append(np.abs(difference).max() / np.abs(expected).max())
    return float(np.max(found))  # NaN if any number is NaN


def _arguments(quantity: str, state: FloatArray) -> tuple[Any, ...]:
    return tuple(state[:QUANTITIES[quantity]])


def main() -> None:
    """Print the differences, and µs per call with the ratios to the library."""
    links = spatial_chain(JOINTS)
    engines, missing = installed(links)
    states = np.random.default_rng(0).uniform(-1.0, 1.0, (STATES, 3, JOINTS))
    differences = {
        engine.engine: largest_difference(engine, links, states) for engine in engines}
    wrong = {name: value for name, value in differences.items() if not value <= TOLERANCE}
    if wrong:
        raise ValueError(f'these engines have other answers (relative difference): {wrong}')
    print(f'{JOINTS} revolute joints in space with full inertias, {STATES} random states; arrays '
          'in, arrays out, a new state each call.')
    print(f'All answers are the same within {max(differences.values()):.0e} of the largest '
          f'number (bound {TOLERANCE:g}).')
    _print_times(engines, states)
    for line in missing:
        print(line)


def _print_times(engines: list[Calls], states: FloatArray) -> None:
    times: dict[str, dict[str, float]] = {}
    for quantity in QUANTITIES:
        arguments = [_arguments(quantity, state) for state in states]
        times[quantity] = medians(
            {engine.engine: (getattr(engine, quantity), arguments) for engine in engines}, ROUNDS)
    _print_table(engines, times)
    for name in (engine.engine for engine in engines if not engine.engine.startswith(OURS)):
        faster = [quantity.replace('_', ' ') for quantity, found in times.items()
                  if found[name] < found[OURS]]
        if faster:
            print(f'Faster than {OURS}: {name} in {", ".join(faster)}.')


def _print_table(engines: list[Calls], times: dict[str, dict[str, float]]) -> None:
    heads = ''.join(f'{quantity.replace("_", " "):>21}' for quantity in QUANTITIES)
    print(f'{"µs per call, and × ours":30}{heads}')
    for engine in engines:
        cells = [
            f'{1e6 * found[engine.engine]:11.2f} {found[engine.engine] / found[OURS]:7.2f} ×'
            for found in times.values()]
        print(f'{engine.engine:30}{"".join(cells)}')
