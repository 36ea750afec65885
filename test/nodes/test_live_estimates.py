# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes: `~/external_effort` and `~/residual` while the simulated arm is pushed."""

from collections.abc import Callable
import math
from typing import Any

from bounded_waits import Collector, has_stamp
from closed_loop import closed_loop, collecting, NAMES, send, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from disturbances import push, set_payload
from geometry_msgs.msg import WrenchStamped
from held_robot import HeldRobot, STEP
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, ExternalWrench, load_arm, make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_from_ros, stamp_to_ros
from robot_dynamics_interfaces.msg import Contact, WrenchCovariance
from ros_harness import DYNAMICS, LONG, NodeProcess, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

BANDWIDTH = 5.0
K = 2.0 * math.pi * BANDWIDTH
RATE = 500.0
STEP_NS = round(1e9 / RATE)
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


def by_stamp(messages: list[Any], field: str) -> dict[int, np.ndarray]:
    return {stamp_from_ros(m.header.stamp): np.array(getattr(m, field)) for m in messages}


def pairs(states: Collector, estimates: Collector) -> list[int]:
    """Return the stamps [ns] with a state and an estimate, at the stamp and one step before."""
    q, r = by_stamp(states.messages, 'position'), by_stamp(estimates.messages, 'effort')
    return [t for t in r if {t, t - STEP_NS} <= q.keys() and t - STEP_NS in r]


def test_a_push_is_seen_through_a_filter_of_first_order(client):
    """In lock-step, so that the values at each stamp do not depend on the machine."""
    with collecting(
            client, '/pushed', 'joint_states', 'dynamics/external_effort', 'dynamics/residual',
            'dynamics/residual_deviation') as (states, estimates, residuals, deviations), \
            closed_loop(
                '/pushed', {**ROBOT, 'external_effort_bandwidth': BANDWIDTH,
                            'gains.natural_frequency': [40.0]}, **ROBOT, rate=RATE):
        states.wait_for(lambda m: any(m.effort), LONG)  # nothing is followed before an effort
        send(client, '/pushed', (0.0, START))
        client.wait_for(JointState, '/pushed/dynamics/computed_torque', timeout=LONG)
        first = estimates.wait_count(20, LONG)[-1]
        push(client, '/pushed/simulated_arm', FORCE)
        seen = estimates.wait_for(lambda m: np.abs(m.effort).max() > 1.0, LONG)
        end = stamp_from_ros(seen.header.stamp) + round(12e9 / K)
        # an observer misses some messages
        wait_until(lambda: len(pairs(states, estimates)) > 20 and any(
            t >= end for t in pairs(states, estimates)), 'states in a row', LONG)
        residuals.wait_for(lambda m: stamp_from_ros(m.header.stamp) >= end, LONG)
        left = residuals.messages[-1]  # later residuals are affected by the end of the nodes
    assert not deviations.messages  # the arm has no uncertainty
    assert list(first.name) == NAMES
    assert not len(first.position)
    assert np.abs(first.effort).max() < 1e-6
    q, r = by_stamp(states.messages, 'position'), by_stamp(estimates.messages, 'effort')
    decay, wrench = math.exp(-K / RATE), ExternalWrench('tool0', FORCE, np.zeros(3))
    for t in pairs(states, estimates):
        found = (r[t] - decay * r[t - STEP_NS]) / (1.0 - decay)
        true = -BODY.external(0.5 * (q[t] + q[t - STEP_NS]), [wrench])
        acts = np.abs(found).max() > 1.0
        assert found == pytest.approx(true if acts else 0.0 * true, abs=0.05)
    # The arm is at rest by now; later samples show how the arm falls once the nodes end.
    settled = next(t for t in sorted(pairs(states, estimates)) if t >= end)
    true = -BODY.external(q[settled], [wrench])
    assert np.abs(true).max() > 20.0
    assert r[settled] == pytest.approx(true, abs=0.05)
    # measured − model is the torque that the actuators exert against the environment
    assert left.effort == pytest.approx(-true, abs=0.1)


# ------------------------------------------------------------------------- a robot without nodes


def test_the_external_wrench_has_its_frame_and_a_bias_on_request(client):
    """Of the planar arm, the lift of joint2 is a force and a torque at tool0."""
    parameters = {
        'joints': NAMES, 'uncertainty.noise_deviation': [0.1, 0.1],
        'uncertainty.noise_bandwidth': 10.0, 'external_wrench.largest_force': 200.0}
    with NodeProcess(DYNAMICS, parameters, namespace='/wrench'):
        robot, topic = HeldRobot(client, '/wrench', **HELD), '/wrench/dynamics'
        robot.say()
        zero = f'{topic}/zero_external_wrench'
        refused = client.call(Trigger, zero)
        assert not refused.success
        assert 'has been estimated for 0.0 s' in refused.message
        with client.collect(WrenchStamped, f'{topic}/external_wrench') as wrenches, \
                client.collect(
                    WrenchCovariance, f'{topic}/external_wrench_covariance') as covariances:
            for one in (wrenches, covariances):
                one.wait_matched()
            wait_until(lambda: bool(robot.say() and wrenches.messages), 'a wrench', LONG)
            robot.say(200)
            message = wrenches.wait_for(has_stamp(stamp_to_ros(robot.stamp)))
            covariance = covariances.wait_for(has_stamp(stamp_to_ros(robot.stamp)))
            assert message.header.frame_id == covariance.header.frame_id == 'tool0'
            force, torque = message.wrench.force, message.wrench.torque
            F = [np.array([each.x, each.y, each.z]) for each in (force, torque)]
            assert -BODY.external(np.array(START), [ExternalWrench('tool0', *F)]) == (
                pytest.approx(LIFT, abs=0.05))
            deviation = np.sqrt(np.diag(np.reshape(covariance.covariance, (6, 6))))
            assert deviation[1] == pytest.approx(200.0)  # across the plane of the arm
            assert deviation[0] < 20.0
            assert len(covariance.unobservable) == 4 * 6
            assert client.call(Trigger, zero).success
            robot.say(2)
            message = wrenches.wait_for(has_stamp(stamp_to_ros(robot.stamp)))
            assert abs(message.wrench.force.x) < 0.05
            assert abs(message.wrench.torque.y) < 0.05


def test_a_contact_is_an_event_and_a_fault_if_wanted(client):
    """The lift of joint2 exceeds its level; the robot rests, so that the velocity adds nothing."""
    parameters = {
        'joints': NAMES, 'contact.effort': [1.0, 2.0], 'contact.effort_per_velocity': [5.0]}
    with NodeProcess(DYNAMICS, parameters, namespace='/touched') as node, \
            client.collect(Contact, '/touched/dynamics/contacts') as contacts:
        robot = HeldRobot(client, '/touched', **HELD)
        contacts.wait_matched()
        free = {'effort': GRAVITY.tolist()}
        robot.say(20, **free)
        assert not contacts.messages
        robot.say(30)
        contact, = contacts.wait_count(1, LONG)
        assert (contact.joint_name, contact.level) == ('joint2', 2.0)
        assert contact.effort > 2.0
        assert contact.message == (
            f"external effort at 'joint2' is {contact.effort:.3g}, level 2: a contact, or a "
            'changed payload, a limit stop or stiction')
        robot.say(100, **free)  # the contact ends
        robot.say(10)
        assert len(contacts.wait_count(2, LONG)) == 2
        client.set_parameters('/touched/dynamics', {'contact.is_fault': True})
        robot.say(10)
        node.wait_for_log(
            r"Fault external_effort: .*'joint2'.* at most 2 \(external_effort_limit or contact")
        reason = client.rejection('/touched/dynamics', 'contact.effort', [0.0, 0.0])
        assert 'contact.is_fault is true without levels' in reason


def says(words: str, key: str = '', value: str = '') -> Callable[[DiagnosticArray], bool]:
    """Return a predicate: a status of the estimates has these words and this figure."""
    def fits(message: DiagnosticArray) -> bool:
        status = next(s for s in message.status if s.name.endswith(': estimates'))
        return words in status.message and (status.level == DiagnosticStatus.WARN) == (
            words.startswith('none')) and (not key or any(
                pair.key == key and pair.value == value for pair in status.values))

    return fits


def test_missing_data_are_reported_and_estimates_restart(client):
    def begun(steps: int) -> Any:
        return pytest.approx(LIFT * -math.expm1(-K * steps * STEP), abs=1e-9)

    parameters = {
        'external_effort_bandwidth': BANDWIDTH, 'require_measured_velocities': True}
    with NodeProcess(DYNAMICS, parameters, namespace='/held') as node, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        robot, topic = HeldRobot(client, '/held', **HELD), '/held/dynamics/external_effort'
        robot.say()
        diagnostics.wait_for(says('no subscribers'))
        with client.collect(JointState, topic) as estimates:
            estimates.wait_matched()
            wait_until(lambda: bool(robot.say() and estimates.messages), 'an estimate', LONG)
            robot.say(10)

            def estimate(stamp: int) -> np.ndarray:
                message = estimates.wait_for(has_stamp(stamp_to_ros(stamp)))
                return np.array(message.effort)

            assert estimate(robot.stamp)[1] > 2.0
            robot.say(effort=[])
            diagnostics.wait_for(says('none: joint states have no effort'))
            node.wait_for_log('No ~/external_effort, .*: joint states have no effort')
            robot.say(5)
            assert estimate(robot.stamp) == begun(4)
            robot.say(step=0.2)
            robot.say(3)
            assert estimate(robot.stamp) == begun(3)
            diagnostics.wait_for(says('made', 'reset: gap', '1'))
            robot.say(effort=[math.nan, 1.0])
            robot.say(velocity=[])
            diagnostics.wait_for(says('none: joint states have no velocity'))
            robot.say(3)
            before = estimate(robot.stamp)
            load = make_payload('tool0', 2.0)
            set_payload(client, '/held/dynamics', load)
            robot.say()
            # from now on the payload, which the measured effort lacks, appears as external torque
            lift = LIFT + ArmDynamics(ARM.with_payloads([load])).rigid_body.gravity(
                np.array(START)) - GRAVITY
            fraction = -math.expm1(-K * STEP)
            assert estimate(robot.stamp) == pytest.approx(
                before + fraction * (lift - before), abs=1e-9)
            set_payload(client, '/held/dynamics')
            robot.say(30)
            assert estimate(robot.stamp) == pytest.approx(LIFT, abs=0.1)
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


def test_the_noise_of_the_estimates_is_the_published_deviation(client):
    """White noise on the effort of a robot at rest; the deviation of the model is the smaller."""
    noise, band = np.array([2.0, 0.5]), 5.0
    uncertainty = {
        'joints': NAMES, 'uncertainty.parameters': ['mx(link2)', 'viscous(joint1)'],
        'uncertainty.covariance': [1e-6, 0.0, 1.0], 'uncertainty.noise_bandwidth': band,
        'uncertainty.noise_deviation': (noise * math.sqrt(2.0 * band * STEP)).tolist()}
    rng = np.random.default_rng(0)
    with NodeProcess(DYNAMICS, uncertainty, namespace='/noisy'):
        robot, topic = HeldRobot(client, '/noisy', **HELD), '/noisy/dynamics'
        with collecting(client, topic, 'residual', 'residual_deviation', 'external_effort',
                        'external_effort_deviation') as topics:
            for one in topics:
                one.wait_matched()
            wait_until(lambda: bool(robot.say() and topics[1].messages), 'estimates', LONG)
            robot.say(50)
            begin = robot.stamp
            for sample in rng.normal(size=(500, 2)):
                robot.say(effort=(GRAVITY + noise * sample).tolist())
            wait_until(lambda: all(
                robot.stamp in by_stamp(one.messages, 'effort') for one in topics),
                'the newest estimates', LONG)
            found = [by_stamp(one.messages, 'effort') for one in topics]
    for estimates, deviations in (found[:2], found[2:]):
        stamps = [t for t in estimates if t > begin + 50 * round(1e9 * STEP)]
        measured = np.std([estimates[t] for t in stamps], axis=0)
        expected = deviations[robot.stamp]
        assert len(stamps) > 300
        assert measured == pytest.approx(expected, rel=0.25)
