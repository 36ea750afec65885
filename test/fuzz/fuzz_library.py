# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Receivers of messages in the library and in the nodes, as targets of the fuzz tests.

Each function passes one input to the same functions as a node does, and does not catch their
exceptions.
"""

from typing import Any, NamedTuple

from fuzz_arms import ARMS, CROWD
from fuzz_law import accepts, check_finite, check_words, over_the_wire, RefusalError
import numpy as np
from robot_dynamics.control import Controller, ControllerOptions, make_gains
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model import ArmModel, JointOrder, Payload
from robot_dynamics.references.follower import TrajectoryFollower
from robot_dynamics.ros.middleware.conversions import (
    floats_to_ros,
    payload_from_ros,
    payload_to_ros,
    stamp_from_ros,
    terms_to_ros,
    trajectory_from_ros,
    trajectory_to_ros,
    wrenches_from_ros,
)
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot

_LONG_LIVED_READERS = {arm.name: JointStateReader(arm.joint_names) for arm in (*ARMS, CROWD)}


def _read(reader: JointStateReader, message: Any) -> list[bytes | str | None]:
    """Return the result of the reader per field: numbers, the text of a rejection, or None."""
    def position_and_velocity(message: Any) -> np.ndarray:
        q, v = reader.read(message)
        return q if v is None else np.concatenate((q, v))

    outcomes: list[bytes | str | None] = []
    for read in (position_and_velocity, reader.effort, reader.finite_effort):
        try:
            numbers = read(message)
        except InvalidInputError as error:
            check_words(str(error))
            outcomes.append(str(error))
        else:
            if read != reader.effort:
                check_finite(numbers)
            outcomes.append(None if numbers is None else numbers.tobytes())
    return outcomes


def take_joint_state(arm: ArmModel, message: Any) -> None:
    """Read a state with a new reader, and with one that read other states: results are equal."""
    message = over_the_wire(message)
    fresh = _read(JointStateReader(arm.joint_names), message)
    assert fresh == _read(_LONG_LIVED_READERS[arm.name], message)
    JointStateReader(arm.joint_names).read(message)


def take_joint_order(arm: ArmModel, motion: dict[str, Any], rows: int) -> None:
    order = JointOrder(arm, motion['joint_names'])
    q = order.positions(motion['position'])
    v = order.rates(motion['velocity'], len(q), 'velocity')
    a = order.rates(motion['acceleration'], len(q), 'acceleration')
    assert q.shape == v.shape == a.shape
    check_finite([q, v, a])
    if len(q) == rows == 1:
        assert order.position(motion['position']).tolist() == q[0].tolist()
        assert order.rate(motion['velocity'], 'velocity').tolist() == v[0].tolist()
        check_finite(order.effort(motion['position']))
    assert order.answer(q).shape == (len(q), len(order.names))


def take_wrenches(arm: ArmModel, messages: list[Any]) -> None:
    for wrench in wrenches_from_ros(arm, [over_the_wire(message) for message in messages]):
        check_finite([wrench.force, wrench.torque])


def take_payload(arm: ArmModel, message: Any) -> None:
    payload = payload_from_ros(arm, over_the_wire(message))
    if payload is None:
        return
    back = payload_from_ros(arm, over_the_wire(payload_to_ros(payload)))
    assert back.inertia.tolist() == payload.inertia.tolist()
    loaded = arm.with_payloads([payload])
    assert loaded.payloads == (payload,)


class FollowedTrajectory(NamedTuple):
    """A trajectory, the state and time at its arrival, and the time spans [ns] to sample."""

    message: Any
    now_ns: int
    position: list[float]
    velocity: list[float]
    spans: list[int]


def take_trajectories(arm: ArmModel, cases: list[FollowedTrajectory]) -> None:
    """Follow trajectories one after the other; a rejection does not affect the others."""
    kinds = zip(arm.joint_names, arm.joint_kinds)
    follower = TrajectoryFollower(
        arm.joint_names, [name for name, kind in kinds if kind == 'continuous'])
    refusals = []
    for case in cases:
        before = follower.active
        message = over_the_wire(case.message)
        try:
            trajectory = trajectory_from_ros(message, arm.joint_names)
            follower.start(
                trajectory, case.now_ns, case.position, case.velocity,
                stamp_from_ros(message.header.stamp))
        except InvalidInputError as error:
            check_words(str(error))
            assert follower.active is before
            refusals.append(error)
        else:
            over_the_wire(trajectory_to_ros(trajectory))
        for span in (0, 1, *case.spans):
            reference = follower.sample(case.now_ns + span)
            check_finite(list(reference or ()))
    if len(refusals) == len(cases):
        raise refusals[0]


# ---------------------------------------------------------------------------------- parts of nodes

def take_states(arm: ArmModel, events: list[Any]) -> None:
    """Make a controller answer states, trajectories and payloads, as the control path does."""
    controller = Controller(arm, ControllerOptions(
        make_gains(arm.joint_names), effort_rate=1e3, scales_gains=True,
        conditions_references=True, stops_and_holds=True))
    reader = JointStateReader(arm.joint_names)
    payloads_done: list[Any] = []

    def act(event: Any) -> None:
        stamp = stamp_from_ros(event.header.stamp)
        if hasattr(event, 'points'):
            controller.follow(trajectory_from_ros(event, arm.joint_names), stamp)
        elif hasattr(event, 'inertia'):
            controller.set_payloads(loads_of(arm, event), 0.5, payloads_done.append)
        else:
            output = controller.update(stamp, *reader.read(event))
            check_finite(floats_to_ros(output.gravity_compensation), 'gravity')
            if output.computed_torque is not None:
                check_finite(floats_to_ros(output.computed_torque), 'computed_torque')
            assert output.command is not None
            check_finite(output.command, 'command')
            if output.terms is not None:  # None if an energy is not finite
                check_finite(over_the_wire(terms_to_ros(
                    output.terms, arm.joint_names, event.header.stamp)))

    refuse_if_most(events, sum(not accepts(act, event) for event in map(over_the_wire, events)))


def refuse_if_most(events: list[Any], refused: int) -> None:
    """Reject the events if there were rejections for more than half of them."""
    if refused > len(events) // 2:
        raise RefusalError('most of the events were rejected')


def loads_of(arm: ArmModel, message: Any) -> list[Payload]:
    """Return the loads of a message: one, or none."""
    payload = payload_from_ros(arm, message)
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
            wrench, = wrenches_from_ros(arm, [event])
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
