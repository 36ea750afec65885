# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Receivers of messages in the library and in the nodes, as targets of the fuzz tests.

Each function passes one input to the same functions as a node does, and does not catch their
exceptions.
"""

from typing import Any

from controller_bench import update
from fuzz_arms import ARMS, CROWD
from fuzz_law import accepts, check_finite, check_words, over_the_wire, RefusalError
import numpy as np
from robot_dynamics.control import Controller, ControllerOptions, make_gains
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model import ArmModel, Payload
from robot_dynamics.ros.middleware import conversions
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot

_LONG_LIVED_READERS = {arm.name: JointStateReader(arm.joint_names) for arm in (*ARMS, CROWD)}


def _read(reader: JointStateReader, message: Any) -> list[str]:
    """Return the result of the reader per field: numbers, the text of a rejection, or None."""
    outcomes: list[str] = []
    for read in (reader.read, reader.effort, reader.finite_effort):
        try:
            numbers = read(message)
        except InvalidInputError as error:
            check_words(str(error))
            outcomes.append(str(error))
        else:
            if read != reader.effort:
                check_finite(numbers)
            outcomes.append(repr(numbers))
    return outcomes


def take_joint_state(arm: ArmModel, message: Any) -> None:
    """Read a state with a new reader, and with one that read other states: results are equal."""
    message = over_the_wire(message)
    fresh = _read(JointStateReader(arm.joint_names), message)
    assert fresh == _read(_LONG_LIVED_READERS[arm.name], message)
    JointStateReader(arm.joint_names).read(message)


# ---------------------------------------------------------------------------------- parts of nodes

def take_states(arm: ArmModel, events: list[Any]) -> None:
    """Make a controller answer states, trajectories and payloads, as the control path does."""
    controller = Controller(arm, ControllerOptions(
        make_gains(arm.joint_names), effort_rate=1e3, scales_gains=True,
        conditions_references=True, stops_and_holds=True))
    reader = JointStateReader(arm.joint_names)
    payloads_done: list[Any] = []

    def act(event: Any) -> None:
        stamp = conversions.stamp_from_ros(event.header.stamp)
        if hasattr(event, 'points'):
            controller.follow(conversions.trajectory_from_ros(event, arm.joint_names), stamp)
        elif hasattr(event, 'inertia'):
            controller.set_payloads(loads_of(arm, event), 0.5, payloads_done.append)
        else:
            q, v = reader.read(event)
            output = update(controller, stamp, q, 0.0 * q if v is None else v)
            check_finite(conversions.floats_to_ros(output.gravity_compensation), 'gravity')
            if output.computed_torque is not None:
                check_finite(conversions.floats_to_ros(output.computed_torque), 'computed_torque')
            assert output.command is not None
            check_finite(output.command, 'command')
            if output.terms is not None:  # None if an energy is not finite
                check_finite(over_the_wire(conversions.terms_to_ros(
                    output.terms, arm.joint_names, event.header.stamp)))

    refuse_if_most(events, sum(not accepts(act, event) for event in map(over_the_wire, events)))


def refuse_if_most(events: list[Any], refused: int) -> None:
    """Reject the events if there were rejections for more than half of them."""
    if refused > len(events) // 2:
        raise RefusalError('most of the events were rejected')


def loads_of(arm: ArmModel, message: Any) -> list[Payload]:
    """Return the loads of a message: one, or none."""
    payload = conversions.payload_from_ros(arm, message)
    return [] if payload is None else [payload]


def take_plant(arm: ArmModel, events: list[Any]) -> None:
    """Apply efforts, wrenches and payloads to a simulated arm, as its loop does."""
    plant = SimulatedRobot(
        ArmSimulation(arm), InnerController(arm, EffortConvention()), True,
        np.random.default_rng(0))
    reader = JointStateReader(arm.joint_names)
    refused = 0

    def act(event: Any) -> None:
        if hasattr(event, 'wrench'):
            wrench, = conversions.wrenches_from_ros(arm, [event])
            plant.wrenches[wrench.link] = wrench
        elif hasattr(event, 'inertia'):
            plant.simulation.set_payloads(loads_of(arm, event))
        else:
            plant.take_effort(reader.finite_effort(event))

    for event in map(over_the_wire, events):
        refused += not accepts(act, event)
        if not accepts(plant.step, 0.002):
            refused += 1
            plant.reset()
        measured = plant.measure()
        check_finite([*measured[:3], *measured.motors])
    refuse_if_most(events, refused)
