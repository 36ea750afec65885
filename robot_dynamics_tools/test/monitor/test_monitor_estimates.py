# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Real nodes: estimates of `dynamics_monitor` while the arm of `dynamics` is pushed.

`~/estimate_payload` finds a payload that only the simulated arm has.
"""

from collections.abc import Callable, Iterator
import math
from typing import Any

from bounded_waits import has_stamp
from builtin_interfaces.msg import Duration
from closed_loop import closed_loop, collecting, NAMES, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from disturbances import push, set_payload
from geometry_msgs.msg import InertiaStamped, WrenchStamped
from held_robot import HeldRobot, monitored, STEP
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, ExternalWrench, load_arm, make_payload, RigidBody
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_from_ros, stamp_to_ros
from robot_dynamics_interfaces.msg import Contact, WrenchCovariance
from robot_dynamics_interfaces.srv import EstimatePayload
from ros_harness import LONG, NodeProcess, RosClient, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

CENTRE = np.array([0.8, 0.5])
RUBBING = {
    'joints': NAMES, 'friction.viscous': [1.5, 0.5], 'friction.coulomb': [1.0, 0.5],
    'effort.command_scale': [0.8, 1.2], 'effort.command_offset': [0.5, -0.3],
    'effort.report_scale': [0.8, 1.2], 'effort.report_offset': [0.5, -0.3]}
CALIBRATED = [1e-6, 0.0, 1e-6, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4]
LOAD = make_payload('tool0', 2.0, (0.05, 0.0, 0.1))
SECONDS = 8
HOLDS = ((10, 0.2), (11, 0.0), (13, 0.0), (14, -0.2), (15, 0.0), (17, 0.0))
"""Times [s] and distances [rad] from CENTRE of a hold from either direction."""


def swing() -> JointTrajectory:
    """Return sines around CENTRE, and two holds there."""
    points = []
    for t in np.arange(0.0, SECONDS + 0.1, 0.25).tolist():
        phase = 2.0 * math.pi * np.array([0.25, 0.375]) * t
        rate = 2.0 * math.pi * np.array([0.25, 0.375])
        points.append(JointTrajectoryPoint(
            positions=CENTRE + 0.4 * (1.0 - np.cos(phase)), velocities=0.4 * rate * np.sin(phase),
            time_from_start=Duration(sec=int(t) + 1, nanosec=round(1e9 * (t % 1.0)))))
    points += [
        JointTrajectoryPoint(
            positions=CENTRE + distance, velocities=[0.0, 0.0], time_from_start=Duration(sec=time))
        for time, distance in HOLDS]
    return JointTrajectory(joint_names=NAMES, points=points)


def ask(client: RosClient, **fields: Any) -> Any:
    return client.call(
        EstimatePayload, '/carried/dynamics_monitor/estimate_payload',
        EstimatePayload.Request(**fields), LONG)


def test_a_hidden_payload_is_estimated_and_applied(client):
    with client.collect(JointState, '/carried/dynamics/gravity_compensation') as gravity, \
            client.collect(InertiaStamped, '/carried/dynamics/payload') as payloads, \
            client.collect(JointState, '/carried/dynamics/reference') as references, \
            closed_loop(
                '/carried', {**RUBBING, 'gains.natural_frequency': [12.0]},
                monitor={'effort.report_covariance': CALIBRATED}, **RUBBING, effort_noise=0.05,
                seed=1, real_time_factor=1.0):  # a busy monitor skips states
        gravity.wait_count(500, LONG)  # 0.3 s after the first command, a load is no wrong drive
        set_payload(client, '/carried/simulated_arm', LOAD)
        assert ask(client, start=True, link='tool0').message == "estimation for 'tool0' started"
        publisher = client.publisher(JointTrajectory, '/carried/dynamics/joint_trajectory')
        client.ask(publisher, swing(), references, lambda m: any(m.velocity), LONG)
        found: list[Any] = []

        def is_found() -> bool:
            found.append(ask(client))
            return bool(found[-1].success and found[-1].duration > SECONDS)

        wait_until(is_found, 'the whole motion', LONG)
        check(found[-1])
        assert not ask(client, link='link1').success
        wait_until(  # the node compensates friction by default
            lambda: any('set friction_compensation to none' in one for one in ask(client).remarks),
            'the remark on friction of pairs', LONG)
        motions = 1

        def is_applied() -> bool:
            """Repeat the motion when it is over, until mz is observable."""
            nonlocal motions
            found.append(ask(client, apply=True))
            if found[-1].duration > 20.0 * motions:
                motions += 1
                publisher.publish(swing())
            return bool(found[-1].success)

        wait_until(is_applied, 'the payload', LONG)
        assert "kg on 'tool0'; a restart begins with no payload" in found[-1].message
        payloads.wait_for(lambda m: m.inertia.m > 0.0, LONG)
        assert payloads.messages[-1].inertia.m == pytest.approx(LOAD.mass, rel=0.05)
        state = client.wait_for(JointState, '/carried/joint_states', timeout=LONG)
        loaded = RigidBody(load_arm(default_arm_urdf()).with_payloads([LOAD])).gravity(
            np.array(state.position))
        gravity.wait_for(lambda m: np.allclose(m.effort, loaded, atol=1.0), LONG)
        ask(client, stop=True)
        assert 'no estimation is active' in ask(client).message


def test_an_estimation_ends_with_its_model_and_needs_effort(client):
    with monitored('/carried', {'joints': NAMES}):
        states = client.publisher(JointState, '/carried/joint_states', 1)

        def start() -> None:
            assert ask(client, start=True, link='tool0').success

        start()
        assert 'no usable joint states yet' in ask(client).message

        def lacks_effort() -> bool:
            state = JointState(name=NAMES, position=CENTRE.tolist(), velocity=[0.0, 0.0])
            state.header.stamp = client.node.get_clock().now().to_msg()
            states.publish(state)
            return 'joint states have no effort' in ask(client).message

        wait_until(lacks_effort, 'the report of the missing effort', LONG)
        set_payload(client, '/carried/dynamics', make_payload('link1', 1.0))
        wait_until(lambda: 'the payload of another link has changed' in ask(client).message,
                   'the end of the estimation', LONG)
        start()
        wait_until(lacks_effort, 'an estimation', LONG)
        client.set_parameters('/carried/dynamics', {'gravity': [0.0, 0.0, -9.77]})
        wait_until(lacks_effort, 'an estimation that a change of 0.04 m/s² does not end', LONG)
        client.set_parameters('/carried/dynamics', {'gravity': [0.0, 0.0, -9.75]})
        wait_until(lambda: 'the gravity of the base has changed' in ask(client).message,
                   'the end of the estimation', LONG)


def check(answer: Any) -> None:
    """Check the estimate of a payload in the plane of the arm, of which z is upwards."""
    values = dict(zip(answer.parameters, zip(answer.values, answer.deviations, answer.verdicts)))
    truth = {'m': LOAD.mass, 'mx': LOAD.mass * 0.05, 'mz': LOAD.mass * 0.1}
    for name, expected in truth.items():
        value, deviation, verdict = values[name]
        assert verdict == 'observable', (name, values)
        assert value == pytest.approx(expected, abs=4.0 * deviation)
    assert values['m'][0] == pytest.approx(LOAD.mass, abs=0.04)
    assert values['my'][2] == 'no effect'
    assert values['my'][1] == math.inf
    assert not any('torque constant' in remark for remark in answer.remarks)
    assert answer.payload.header.frame_id == 'tool0'


BANDWIDTH = 5.0
K = 2.0 * math.pi * BANDWIDTH
FORCE = np.array([30.0, 0.0, -10.0])
ROBOT = {
    'joints': NAMES, 'friction.viscous': [1.5, 0.5], 'actuator.torque_constant': [0.1, 0.1],
    'actuator.gear_ratio': [100.0, 50.0], 'actuator.rotor_inertia': [2e-5, 2e-5]}
"""Parameters of the arm that both nodes have in addition to the URDF."""
ARM = load_arm(default_arm_urdf())
BODY = ArmDynamics(ARM).rigid_body
GRAVITY = BODY.gravity(np.array(START))
LIFT = np.array([0.0, 3.0])
HELD = {'position': START, 'effort': (GRAVITY - LIFT).tolist()}
"""A robot that is held at rest under an external torque on joint2."""


def test_a_push_is_the_external_effort_and_the_residual(client):
    """In lock-step; the values are compared at the same stamp."""
    wrench = ExternalWrench('tool0', FORCE, np.zeros(3))

    def is_estimated() -> bool:
        """Return whether the estimates at the stamp of a state are settled on the push."""
        found = [{stamp_from_ros(m.header.stamp): m for m in one.messages[-100:]}
                 for one in (states, estimates, residuals)]
        for stamp in found[0].keys() & found[1].keys() & found[2].keys():
            state, estimate, residual = (one[stamp] for one in found)
            true = -BODY.external(np.array(state.position), [wrench])
            # measured − model is the torque that the actuators exert on the environment; it
            # settles later than the estimate if the monitor skips states
            if np.abs(true).max() > 20.0 and np.allclose(
                    estimate.effort, true, atol=0.05) and np.allclose(
                    residual.effort, -true, atol=0.1):
                return True
        return False

    with collecting(
            client, '/pushed', 'joint_states', 'dynamics_monitor/external_effort',
            'dynamics_monitor/residual', 'dynamics_monitor/residual_deviation') as (
                states, estimates, residuals, deviations), \
            closed_loop('/pushed', {
                **ROBOT, 'gains.natural_frequency': [40.0]}, monitor={}, **ROBOT, rate=250.0):
        first = estimates.wait_count(20, LONG)[-1]
        assert list(first.name) == NAMES
        assert not len(first.position)
        assert np.abs(first.effort).max() < 1e-6
        push(client, '/pushed/simulated_arm', FORCE)
        wait_until(is_estimated, 'the push', LONG)
        assert not deviations.messages  # the arm has no uncertainty


# ------------------------------------------------------------------------- a robot without nodes

NOISE = 0.05
"""Deviation of the measured effort [N·m] after a filter of 2 Hz."""


@pytest.fixture(scope='module')
def node() -> Iterator[NodeProcess]:
    """Run `dynamics` and its monitor; return the process of the monitor."""
    with monitored('/held', {
            'joints': NAMES, 'external_effort_bandwidth': BANDWIDTH,
            'uncertainty.noise_deviation': [NOISE], 'uncertainty.noise_bandwidth': 2.0},
            {'external_wrench.largest_force': 200.0}) as process:
        yield process


@pytest.fixture(scope='module')
def robot(client: RosClient, node: NodeProcess) -> HeldRobot:
    return HeldRobot(client, '/held', is_paced=True, **HELD)


def test_the_external_wrench_has_its_frame_and_a_bias_on_request(client, robot):
    """Of the planar arm, the lift of joint2 is a force and a torque at tool0."""
    topic = '/held/dynamics_monitor'
    robot.say()
    zero = f'{topic}/zero_external_wrench'
    refused = client.call(Trigger, zero)
    assert not refused.success
    assert 'has been estimated for 0.0 s' in refused.message
    with client.collect(WrenchStamped, f'{topic}/external_wrench') as wrenches, \
            client.collect(
                WrenchCovariance, f'{topic}/external_wrench_covariance') as covariances, \
            client.collect(JointState, f'{topic}/external_effort_deviation') as deviations:
        for one in (wrenches, covariances, deviations):
            one.wait_matched()
        for one in (wrenches, deviations):
            wait_until(lambda one=one: bool(robot.say() and one.messages), 'estimates', LONG)
        robot.say(200)
        stamp = has_stamp(stamp_to_ros(robot.stamp))
        message, covariance = wrenches.wait_for(stamp), covariances.wait_for(stamp)
        assert message.header.frame_id == covariance.header.frame_id == 'tool0'
        force, torque = message.wrench.force, message.wrench.torque
        F = [np.array([each.x, each.y, each.z]) for each in (force, torque)]
        assert -BODY.external(np.array(START), [ExternalWrench('tool0', *F)]) == (
            pytest.approx(LIFT, abs=0.05))
        deviation = np.sqrt(np.diag(np.reshape(covariance.covariance, (6, 6))))
        assert deviation[1] == pytest.approx(200.0)  # across the plane of the arm
        assert deviation[0] < 20.0
        assert len(covariance.unobservable) == 4 * 6
        assert deviations.wait_for(stamp).effort == pytest.approx(
            [NOISE * math.sqrt(0.25 * K / 2.0)] * 2)  # K/4 is the noise bandwidth of the observer
        assert client.call(Trigger, zero).success
        robot.say(2)
        message = wrenches.wait_for(has_stamp(stamp_to_ros(robot.stamp)))
        assert abs(message.wrench.force.x) < 0.05
        assert abs(message.wrench.torque.y) < 0.05


def says(words: str, key: str = '', value: str = '') -> Callable[[DiagnosticArray], bool]:
    """Return a predicate: a status of the estimates has these words and this figure."""
    def fits(message: DiagnosticArray) -> bool:
        status = next((s for s in message.status if s.name.endswith(': estimates')), None)
        return status is not None and words in status.message and (
            status.level == DiagnosticStatus.WARN) == words.startswith('none') and (
                not key or any(
                    pair.key == key and pair.value == value for pair in status.values))

    return fits


def test_missing_data_are_reported_and_estimates_restart(client, node, robot):
    def begun(steps: int) -> Any:
        return pytest.approx(LIFT * -math.expm1(-K * steps * STEP), abs=1e-9)

    topic = '/held/dynamics_monitor/external_effort'
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        # subscribers of the test before may be known for some time
        wait_until(lambda: bool(robot.say()) and any(
            map(says('no subscribers'), diagnostics.messages)), 'no subscribers', LONG)
        with client.collect(JointState, topic) as estimates:
            estimates.wait_matched()
            wait_until(lambda: bool(robot.say() and estimates.messages), 'an estimate', LONG)
            robot.say(10)
            robot.say(step=0.09)  # the longest step without a reset is 0.1 s
            robot.say(10)

            def estimate(stamp: int) -> np.ndarray:
                return np.array(estimates.wait_for(has_stamp(stamp_to_ros(stamp))).effort)

            assert estimate(robot.stamp)[1] > 2.0
            robot.say(effort=[])
            diagnostics.wait_for(says('none: joint states have no effort'))
            node.wait_for_log('No ~/external_effort, .*: joint states have no effort')
            robot.say(5)
            assert estimate(robot.stamp) == begun(4)
            robot.say(step=0.11)
            robot.say(3)
            assert estimate(robot.stamp) == begun(3)
            diagnostics.wait_for(says('made', 'reset: gap', '1'))
            robot.say(effort=[math.nan, 1.0])
            robot.say(3)
        diagnostics.clear()
        wait_until(
            lambda: bool(robot.say() and diagnostics.find(says('no subscribers'), 0.1)),
            'no subscriber', LONG)
        # so slow that the estimates after the first messages are small, even if some are lost
        client.set_parameters('/held/dynamics', {'external_effort_bandwidth': 0.1})
        with client.collect(JointState, topic) as estimates:
            estimates.wait_matched()
            wait_until(lambda: bool(robot.say() and estimates.messages), 'an estimate', LONG)
        assert 0.0 < estimates.messages[0].effort[1] < 1.5


def test_a_contact_is_an_event(client, robot):
    """The lift of joint2 exceeds its level; the robot rests, so that the velocity adds nothing."""
    client.set_parameters('/held/dynamics', {
        'contact.effort': [1.0, 2.0], 'contact.effort_per_velocity': [5.0],
        'external_effort_bandwidth': BANDWIDTH})
    with client.collect(Contact, '/held/dynamics_monitor/contacts') as contacts:
        contacts.wait_matched()
        free = {'effort': GRAVITY.tolist()}
        robot.say(100, **free)
        assert not contacts.messages
        robot.say(30)
        contact, = contacts.wait_count(1, LONG)
        assert (contact.joint_name, contact.level) == ('joint2', 2.0)
        assert contact.effort > 2.0
        assert contact.message == (
            f"external effort at 'joint2' is {contact.effort:.3g}, level 2: a contact, or a "
            'changed payload, a limit stop or stiction')
        robot.say(100, **free)  # the contact ends
        robot.say(30)
        assert len(contacts.wait_count(2, LONG)) == 2
