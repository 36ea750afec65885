# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The calibration motion of a running node: confirmation, recordings, weight, orderly end."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
import time
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.payload import describe_payloads, Payload
from robot_dynamics.ros.middleware.conversions import payload_from_ros, payload_to_ros
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_interfaces.srv import SetPayload
from robot_dynamics_tools.gravity_motion.plan import (
    approach_of,
    make_plan,
    MotionPlan,
    MotionSettings,
    within_a_turn,
)
from robot_dynamics_tools.gravity_motion.poses import chosen_poses, PoseChoice
from robot_dynamics_tools.gravity_motion.preview import preview
from robot_dynamics_tools.gravity_motion.watch import ArmWatch
from robot_dynamics_tools.recorder import Recorder, write_description
from robot_dynamics_tools.recordings.interrupts import interrupted_by_sigterm, uninterrupted
from robot_dynamics_tools.recordings.writer import prepare_recording, RecordingWriter
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, RefusedError
from robot_dynamics_tools.ros2_dynamics.motion_watch import goal_publication
from robot_dynamics_tools.ros2_dynamics.record import topic_specs
from std_srvs.srv import Trigger

TRANSITION = 3.0
"""[s] over which the node changes the compensation of the weight."""
RECORDED = ('effort_command', '~/reference', '~/payload')
"""The recorded topics in addition to the joint states and the URDF."""
FRICTION_COMPENSATION = 'friction_compensation'
"""
The parameter of the node that is `none` during the holds.

Compensation of friction pushes a joint at rest towards its goal: friction then differs between
the approaches from both sides, and does not cancel in their mean.
"""
WITHOUT_GRAVITY = ('none', 'joint_torque_without_gravity')
"""Values of `measured_effort` that do not permit a calibration."""


class MotionRequest(NamedTuple):
    """
    What the user asks for.

    `node` is the name of the node, empty for the only one; `timeout` [s] that of its answers;
    `urdf` the URDF, None for that of the node; `parameters` those of the calculation. `outputs`
    are the new directories of the recordings: one, and one more with `weight`.
    """

    outputs: Sequence[Path]
    choice: PoseChoice = PoseChoice()
    settings: MotionSettings = MotionSettings()
    weight: Payload | None = None
    node: str = ''
    timeout: float = 5.0
    urdf: str | None = None
    parameters: Mapping[str, Any] = MappingProxyType({})
    is_confirmed: bool = False
    previews: bool = False


def record_holds(request: MotionRequest) -> str | None:
    """
    Move the arm and record the holds; return the topic of the joint states, None for a preview.

    The arm moves after a confirmation on the terminal. SIGINT and SIGTERM stop the arm, and the
    recording up to then is kept. Raises KeyboardInterrupt then; InvalidInputError or NoAnswerError
    if the arm cannot move, ToolError after an error during the motion.
    """
    for output in request.outputs:
        prepare_recording(output, '--recording')
    if not (request.previews or request.is_confirmed or sys.stdin.isatty()):
        raise InvalidInputError(
            'standard input is no terminal, expected one for the confirmation, or --yes')
    with interrupted_by_sigterm(), DynamicsClient(request.node, request.timeout) as client:
        return _record_holds(client, request)


def _record_holds(client: DynamicsClient, request: MotionRequest) -> str | None:
    urdf = request.urdf if request.urdf is not None else client.description()
    arm = arm_from_parameters(urdf, request.parameters)
    _check_node(client, arm, request.parameters.get('measured_effort', 'joint_torque'))
    found = (payload_from_ros(arm, message) for message in client.payloads())
    payloads = [payload for payload in found if payload is not None]
    _check_weight(payloads, request.weight)
    arm = arm.with_payloads(payloads)
    watch = ArmWatch(client, arm)
    with watch.following():
        watch.wait_ready()
        if not (request.is_confirmed or request.previews):  # each pass begins with this check
            watch.check_free()
        start = np.array(watch.measured())
    poses = chosen_poses(
        arm, request.choice, approach_of(arm, request.settings.approach), request.weight)
    plan = make_plan(arm, start, poses, request.settings)
    print(preview(plan, client.name, request.weight, request.outputs), flush=True)
    if request.previews:
        return None
    if not request.is_confirmed:
        print('Type yes and press Enter to move the arm: ', end='', flush=True)
        if sys.stdin.readline().strip().lower() != 'yes':
            raise ToolError('not confirmed; the arm has not moved')
    CalibrationMotion(client, watch, urdf, request.weight).run(plan, request.outputs)
    return client.joint_state_topic()


class CalibrationMotion:
    """The passes of a calibration; every end leaves an arm that holds, and is reported."""

    def __init__(
        self, client: DynamicsClient, watch: ArmWatch, urdf: str, weight: Payload | None,
    ) -> None:
        """Take the client and the watch of a node; `urdf` is recorded."""
        self._client, self._watch, self._urdf, self._weight = client, watch, urdf, weight
        self._has_moved, self._holds = False, 0
        self._notes: list[str] = []
        self._weight_note = ''

    def run(self, plan: MotionPlan, outputs: Sequence[Path]) -> None:
        """Record a pass per output, with the weight in the second; raise ToolError."""
        try:
            with self._without_friction_compensation():
                self._pass(plan, outputs[0])
                if self._weight is not None:
                    self._attach(self._weight)
                    self._pass(replace(plan, poses=plan.poses[::-1]), outputs[1])
                    self._remove(self._weight)
        except KeyboardInterrupt:
            print('\n'.join(self._ending()), file=sys.stderr, flush=True)
            raise
        except (RobotDynamicsError, OSError) as error:
            raise ToolError('\n'.join([str(error), *self._ending()])) from None

    @contextmanager
    def _without_friction_compensation(self) -> Iterator[None]:
        """Switch the compensation off, and restore it at any end."""
        client, name = self._client, FRICTION_COMPENSATION
        before = client.parameters([name])[name]
        if before == 'none':
            yield
            return
        client.set_parameter(name, 'none')
        try:
            yield
        finally:
            with uninterrupted():
                try:
                    client.set_parameter(name, before)
                except RobotDynamicsError as error:
                    print(f'{client.name} still has {name} none, before it was {before}: {error}',
                          file=sys.stderr, flush=True)

    def _ending(self) -> list[str]:
        return [note for note in (*self._notes, self._weight_note) if note]

    # ------------------------------------------------------------------ one pass

    def _pass(self, plan: MotionPlan, output: Path) -> None:
        client = self._client
        names = [client.joint_state_topic(), *map(client.resolve, RECORDED)]
        specs = topic_specs(client, names)
        self._holds = 0
        with RecordingWriter(output) as writer:
            write_description(writer, '/robot_description', self._urdf, time.time_ns())
            client.recorder = recorder = Recorder(client.node, writer, specs)
            try:
                self._follow(plan)
            except BaseException:
                client.recorder = None  # the disk may be full
                self._stop()
                raise
            finally:
                client.recorder = None
                self._notes.append(
                    f'Recorded {self._holds} of {2 * len(plan.poses)} holds: {output}')
                recorder.close()

    def _follow(self, plan: MotionPlan) -> None:
        """Move through the plan from the measured position."""
        watch, passed = self._watch, 0.0
        with watch.following():
            watch.wait_ready()
            watch.check_free()
            plan = replace(plan, start=within_a_turn(plan.arm, np.array(watch.measured())))
            with (goal_publication(self._client, plan.arm.joint_names) as publish,
                  Progress(plan.seconds, 's') as progress):
                for _, move in plan.moves():
                    self._has_moved = True
                    watch.move(move, publish, partial(_show, progress, passed, move.duration))
                    if move.hold:
                        watch.wait_held(move.goal, move.hold, plan.tolerance)
                        self._holds += 1
                    passed += move.duration + move.hold
                    progress.update(passed)

    def _stop(self) -> None:
        """Call ~/stop if the arm has moved; a second signal waits for the answer."""
        if not self._has_moved:
            return
        with uninterrupted():
            try:
                report = self._client.call(Trigger, 'stop', Trigger.Request()).message
            except RobotDynamicsError as error:
                report = (f'no answer: {error}. The node completes the present move, of at most '
                          '--step, and holds; use the emergency stop if it does not')
        self._notes.append(f'Called ~/stop: {report}')

    # ------------------------------------------------------------------ the weight

    def _attach(self, weight: Payload) -> None:
        """Wait for the operator to attach the weight, then compensate it."""
        self._weight_note = (
            'The compensation of the weight is not set. If the weight is attached, the arm holds '
            'it by feedback only:\nremove the weight')
        centre = ', '.join(f'{value:g}' for value in weight.com)
        _wait_for_enter(
            f'The arm holds its position. Attach {weight.mass:g} kg to {weight.link}, with its '
            f'centre of mass at ({centre}) m in the frame of this link.\nThe arm may sag '
            'a little. Leave the reach of the arm, then press Enter: the node compensates the '
            f'weight within {TRANSITION:g} s, and the arm moves through the poses again. ')
        note, self._weight_note = self._weight_note, (
            f'The node still compensates {describe_payloads([weight])}, because the weight is '
            'attached. Remove the weight,\nthen end the compensation with: ros2 dynamics payload '
            f'{weight.link} 0 --transition {TRANSITION:g} --node {self._client.name}')
        try:
            report = self._set_payload(weight)
        except RefusedError:
            self._weight_note = note
            raise
        print(f'~/set_payload: {report}', flush=True)
        watch = self._watch
        with watch.following():
            watch.wait_ready()
            assert watch.reference is not None
            watch.wait_held(np.array(watch.reference[1]), TRANSITION)

    def _remove(self, weight: Payload) -> None:
        """Wait for the operator to remove the weight, then end the compensation."""
        _wait_for_enter(
            f'The arm holds its position. Remove the weight from {weight.link}. The arm may rise '
            'a little. Leave the reach of the arm, then press Enter: the node ends the '
            f'compensation within {TRANSITION:g} s. ')
        report = self._set_payload(replace(
            weight, mass=0.0, com=np.zeros(3), inertia=np.zeros((3, 3))))
        self._weight_note = ''
        print(f'~/set_payload: {report}', flush=True)

    def _set_payload(self, payload: Payload) -> str:
        return str(self._client.call(SetPayload, 'set_payload', SetPayload.Request(
            payload=payload_to_ros(payload), transition_time=TRANSITION)).message)


def _show(progress: Progress, passed: float, most: float, seconds: float) -> None:
    progress.update(passed + min(seconds, most))


# ------------------------------------------------------------------------------ before the motion

def _check_node(client: DynamicsClient, arm: ArmModel, measured_effort: str) -> None:
    """Raise InvalidInputError unless the node moves this arm, and measures what is expected."""
    found = client.parameters(['command', 'measured_effort', 'gravity'])
    if found['command'] != 'computed_torque':
        raise InvalidInputError(
            f'parameter command of {client.name} is {found["command"]!r}, expected '
            "'computed_torque', with which the node moves the arm")
    if found['measured_effort'] in WITHOUT_GRAVITY:
        raise InvalidInputError(
            f'parameter measured_effort of {client.name} is {found["measured_effort"]!r}, '
            'expected an effort that includes gravity')
    for name, given, wanted in (
            ('joints', list(arm.joint_names), client.joint_names()),
            ('gravity', arm.gravity.tolist(), list(found['gravity'])),
            ('measured_effort', measured_effort, found['measured_effort'])):
        if given != wanted:
            raise InvalidInputError(
                f'--urdf and --parameters have {name} {given!r}, expected {wanted!r} of '
                f'{client.name}: use the parameter file of the node')


def _check_weight(payloads: Sequence[Payload], weight: Payload | None) -> None:
    for payload in payloads:
        if weight is not None and payload.link == weight.link:
            raise InvalidInputError(
                f'--weight-link is {weight.link!r}, which carries a payload of {payload.mass:g} '
                'kg already, which the weight would replace; expected another link that is fixed '
                'to this one, or no payload on it')
    if payloads:
        print(f'The node compensates {describe_payloads(payloads)}. The calculation counts them '
              'as parts of the tool.')


def _wait_for_enter(text: str) -> None:
    print(f'\n{text}', flush=True)
    if not sys.stdin.readline():
        raise ToolError('standard input ended before the confirmation')
    print(flush=True)
