# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node `simulated_arm`: efforts in, joint states out; backlash."""

from collections.abc import Iterator
import time

from builtin_interfaces.msg import Time
from closed_loop import NAMES, START
from lock_stepped_arm import lock_stepped, LockStepped
import numpy as np
import pytest
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot
from ros_harness import has_stamp, NodeProcess, RosClient, SIMULATED_ARM, TIMEOUT
from sensor_msgs.msg import JointState
from simulated_arms import released
from std_srvs.srv import Trigger

ARM = load_arm(default_arm_urdf())
RATE = 500.0
PERIOD_NS = 2_000_000
SPEED = 0.2
"""Upper limit of simulated by real time."""


@pytest.fixture(scope='module')
def stepped(client: RosClient) -> Iterator[LockStepped]:
    with lock_stepped(client, '/stepped', rate=RATE, real_time_factor=SPEED) as one:
        yield one


def test_it_waits_for_the_first_effort_at_the_initial_pose(stepped):
    assert stamp_from_ros(stepped.state.header.stamp) == PERIOD_NS
    assert list(stepped.state.name) == NAMES
    assert list(stepped.state.position) == START
    assert list(stepped.state.velocity) == [0.0, 0.0]
    again = stepped.states.wait_count(3)  # the arm repeats its state until an effort arrives
    assert {stamp_from_ros(m.header.stamp) for m in again} == {PERIOD_NS}


def test_each_effort_makes_the_next_state(stepped):
    twin = released(ARM, START)
    stepped.step(ArmDynamics(ARM).rigid_body.gravity(np.array(START)).tolist())
    # the state after other tests does not matter: continue from the published state
    twin.place(np.array(stepped.state.position), np.array(stepped.state.velocity))
    for k in range(20):
        effort = [10.0 * np.sin(k), 5.0 * np.cos(k)]
        stamp = stamp_from_ros(stepped.state.header.stamp)
        state = stepped.step(effort)
        twin.step(np.array(effort), 1.0 / RATE)
        assert stamp_from_ros(state.header.stamp) == stamp + PERIOD_NS
        assert list(state.position) == twin.q.tolist()
        assert list(state.velocity) == twin.v.tolist()
        assert list(state.effort) == effort


def test_a_pause_keeps_time_and_arm_until_it_ends(client):
    parameters = {'publish_clock': True, 'lock_step': False, 'paused': True, 'rate': RATE,
                  'brakes': False, 'command_timeout': 0.0}
    with lock_stepped(client, '/paused', **parameters) as paused:
        for _ in range(3):  # the arm accepts an effort, and no simulated time passes
            paused.efforts.publish(JointState(
                header=paused.state.header, name=NAMES, effort=[1.0, 1.0]))
            again = paused.states.wait_count(len(paused.states.messages) + 1)[-1]
            assert stamp_from_ros(again.header.stamp) == PERIOD_NS
            assert list(again.position) == START
        client.set_parameters('/paused/simulated_arm', {'paused': False})
        paused.step([1.0, 1.0])
        assert list(paused.state.position) != START


def test_efforts_are_matched_by_name_and_the_clock_is_that_of_the_states(stepped):
    state = stepped.step([9.0, 2.0, 1.0], ['lid', 'joint2', 'joint1'])
    assert list(state.effort) == [1.0, 2.0]
    stepped.clock.wait_for(lambda message: message.clock == state.header.stamp)


def test_a_bad_effort_or_an_old_one_moves_nothing(stepped):
    for bad in ({'effort': [float('nan'), 0.0]}, {'effort': [1.0]}, {'effort': []},
                {'effort': [1.0, 2.0], 'name': ['joint1', 'elbow']}):
        before = stepped.state.header.stamp
        message = JointState(**{'name': NAMES, **bad})
        message.header.stamp = before
        stepped.efforts.publish(message)
        old = JointState(name=NAMES, effort=[50.0, 50.0])
        old.header.stamp = Time(sec=0, nanosec=1)
        stepped.efforts.publish(old)
        state = stepped.step([1.5, -2.5])
        assert list(state.effort) == [1.5, -2.5]
        assert stamp_from_ros(state.header.stamp) == stamp_from_ros(before) + PERIOD_NS


def test_lock_step_is_no_faster_than_requested(stepped):
    began = time.monotonic()
    for _ in range(11):  # the arm publishes the first state after `began`, and ten more follow
        stepped.step([0.0, 0.0])
    assert time.monotonic() - began >= 10 / RATE / SPEED


def test_a_state_may_wait_for_its_effort_as_long_as_it_takes(stepped):
    """The arm moves, and gets no effort for longer than `command_timeout`."""
    before = stepped.step([20.0, -5.0])
    assert any(before.velocity)
    stamp = before.header.stamp
    again = stepped.states.wait_count(4)  # the arm repeats the state every 0.1 s
    assert all(message.header.stamp == stamp for message in again)
    twin = released(ARM, before.position, before.velocity)
    state = stepped.step([1.0, 2.0])
    twin.step(np.array([1.0, 2.0]), 1.0 / RATE)
    assert list(state.position) == twin.q.tolist()
    assert list(state.velocity) == twin.v.tolist()
    assert 'No valid effort' not in stepped.node.log


def test_reset_goes_back_to_the_initial_pose(stepped):
    for _ in range(5):
        stepped.step([20.0, -5.0])
    assert list(stepped.state.position) != START
    assert stepped.client.call(Trigger, '/stepped/simulated_arm/reset').success
    state = stepped.step([0.0, 0.0])  # simulated time continues
    twin = released(ARM, START)
    assert list(state.position) == twin.step(np.zeros(2), 1.0 / RATE).position.tolist()


@pytest.mark.parametrize('kind', [0, 1, 2], ids=['position', 'velocity', 'effort'])
def test_noise_is_on_what_is_measured_alone(kind):
    """The noise of each kind is independent of the other kinds."""
    plant = SimulatedRobot(
        ArmSimulation(ARM, START), InnerController(ARM, EffortConvention()), True,
        np.random.default_rng(0))
    plant.position_noise, plant.velocity_noise, plant.effort_noise = (
        0.3 * (kind == k) for k in range(3))
    measured = [plant.measure() for _ in range(2000)]
    for k, true in enumerate((START, [0.0, 0.0], [0.0, 0.0])):
        values = np.array([m[k] for m in measured])
        assert values.mean(axis=0) == pytest.approx(true, abs=0.03)
        assert values.std(axis=0) == pytest.approx(0.3 * (kind == k), rel=0.1)
    assert plant.simulation.q.tolist() == START


def test_the_time_of_the_computer_advances_without_efforts_and_cannot_be_paused(client):
    parameters = {'rate': 200.0, 'initial_position': START}
    with NodeProcess(SIMULATED_ARM, parameters, namespace='/wall'), \
            client.collect(JointState, '/wall/joint_states') as states:
        got = states.wait_count(100)
        stamps = np.array([stamp_from_ros(m.header.stamp) for m in got])
        steps = np.diff(stamps)
        assert (steps > 0).all()
        assert (steps % 5_000_000 == 0).all()
        now = client.node.get_clock().now().nanoseconds
        assert abs(now - stamps[-1]) < TIMEOUT * 1e9
        # the brakes hold the arm, because there is no effort
        assert {tuple(m.position) for m in got} == {tuple(START)}
        assert client.node.count_publishers('/wall/clock') == 0
        reason = client.rejection('/wall/simulated_arm', 'paused', True)
        assert 'expected false, or lock_step or publish_clock as well' in reason


GAP = 0.02
GEARED = {
    'actuator.torque_constant': [0.1], 'actuator.gear_ratio': [100.0],
    'actuator.rotor_inertia': [1e-5], 'actuator.backlash': [GAP], 'joints': NAMES,
    'initial_position': [1.0, 0.5]}


def motor_offsets(arm: LockStepped, steps: int = 60) -> np.ndarray:
    """Return the offsets (steps, 2) of the motors from the measured joints during the motion."""
    arm.motors.wait_matched()
    found = []
    for _ in range(steps):
        motor = arm.motors.wait_for(has_stamp(arm.state.header.stamp))
        assert list(motor.name) == NAMES
        found.append(np.subtract(motor.position, arm.state.position))
        arm.step([20.0, 5.0])
    return np.array(found)


def test_joint_and_motor_are_apart_by_the_gap(client):
    """The links rest on their gears; under an opposite torque the motors cross the gap."""
    with lock_stepped(client, '/at_joint', **GEARED) as arm:
        offsets = motor_offsets(arm)
    # The arm falls forward, g(q) < 0, so that at first the motors are behind the joints.
    assert offsets[0] == pytest.approx([-0.5 * GAP] * 2, abs=1e-10)
    assert offsets[-1] == pytest.approx([0.5 * GAP] * 2, abs=1e-10)
    assert np.abs(offsets).max() <= 0.5 * GAP + 1e-10
    assert np.abs(offsets[:, 0]).min() < 0.4 * GAP  # observed while the motor crosses the gap


def test_encoders_at_the_motor_do_not_see_the_gap(client):
    with lock_stepped(client, '/at_motor', **GEARED, encoders='motor') as arm:
        assert np.abs(motor_offsets(arm)).max() == 0.0
